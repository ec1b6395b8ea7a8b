/* All of <math.h> that a plant needs: the compiler's own headers leave it to a libc. */
#ifndef MATH_H
#define MATH_H

typedef double double_t;

double copysign(double magnitude, double sign);
double cos(double x);
double exp(double x);
double expm1(double x);
double fabs(double x);
double floor(double x);
double fmax(double x, double y);
double sin(double x);
double tanh(double x);

/* These are instructions of WebAssembly or few of them, and no functions of its runtime library. */
#define copysign(magnitude, sign) __builtin_copysign(magnitude, sign)
#define fabs(x) __builtin_fabs(x)
#define isnan(x) __builtin_isnan(x)

#endif
