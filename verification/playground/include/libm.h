/* All of musl's own "libm.h" that its expm1.c needs. */
#ifndef LIBM_H
#define LIBM_H

#include <math.h>
#include <stdint.h>

/* Is there for the floating-point flags, which WebAssembly does not have. */
#define FORCE_EVAL(x) ((void)(x))

#endif
