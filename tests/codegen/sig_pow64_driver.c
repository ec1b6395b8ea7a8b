/*
 * sig_pow in double for the tests: over arrays, for a shared library; one power on its own with
 * SIG_POW64_ALONE; and as a program that turns pairs of x and exponent into results, from stdin
 * to stdout with SIG_POW64_FILTER, and on a board, by its link, with SIG_POW64_TARGET.
 */
#include <stddef.h>

#include "tdc_sig_pow64.h"

/* Called through ctypes, and looked up in the object file. NOLINTBEGIN(misc-use-internal-linkage) */
void sig_pow64_batch(const double *x, const tdc_exponent64 *a, double *result, size_t count);
double sig_pow64_alone(double x, tdc_exponent64 a);
tdc_status exponent64_set(tdc_exponent64 *exponent, double value);
/* NOLINTEND(misc-use-internal-linkage) */

#ifndef SIG_POW64_ALONE
void sig_pow64_batch(const double *x, const tdc_exponent64 *a, double *result, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        result[i] = tdc_sig_pow64(x[i], a[i]);
    }
}

tdc_status exponent64_set(tdc_exponent64 *exponent, double value)
{
    return tdc_exponent64_set(exponent, value);
}
#endif

/* One power that isn't inlined, to look at its instructions. */
double sig_pow64_alone(double x, tdc_exponent64 a)
{
    return tdc_sig_pow64(x, a);
}

#if defined(SIG_POW64_FILTER) || defined(SIG_POW64_TARGET)
typedef struct {
    double x;
    tdc_exponent64 a;
} argument;
#endif

#ifdef SIG_POW64_FILTER
#include <stdio.h>

int main(void)
{
    argument pair;
    while (fread(&pair, sizeof pair, 1, stdin) == 1) {
        const double result = tdc_sig_pow64(pair.x, pair.a);
        if (fwrite(&result, sizeof result, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
#endif

#ifdef SIG_POW64_TARGET
#include "cores/core.h"
#include "pil/link.h"

int main(void)
{
    argument pair;
    bool good = link_open();
    while (good && link_read(&pair, sizeof pair)) {
        const double result = tdc_sig_pow64(pair.x, pair.a);
        good = link_write(&result, sizeof result);
    }
    link_close(good);
    return 0;
}

void core_tick(void)
{
}

void core_panic(void)
{
    link_close(false);
    for (;;) {
    }
}
#endif
