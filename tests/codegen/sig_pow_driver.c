/*
 * sig_pow for the tests: over arrays, for a shared library; with SIG_POW_FILTER as a program that
 * turns pairs (bits of x, a - 1 in Q31) on stdin into bits of results on stdout.
 */
#include <stddef.h>
#include <stdint.h>

#include "tdc_sig_pow.h"

/* Called through ctypes, and looked up in the object file. NOLINTBEGIN(misc-use-internal-linkage) */
void sig_pow_batch(const float *x, const int32_t *minus_one_q31, float *result, size_t count);
float sig_pow_alone(float x, tdc_exponent a);
/* NOLINTEND(misc-use-internal-linkage) */

void sig_pow_batch(const float *x, const int32_t *minus_one_q31, float *result, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        const tdc_exponent a = {minus_one_q31[i]};
        result[i] = tdc_sig_pow(x[i], a);
    }
}

/* One power that isn't inlined, to look at its instructions. */
float sig_pow_alone(float x, tdc_exponent a)
{
    return tdc_sig_pow(x, a);
}

#ifdef SIG_POW_FILTER
#include <stdio.h>

int main(void)
{
    struct {
        float x;
        int32_t minus_one_q31;
    } pair;
    while (fread(&pair, sizeof pair, 1, stdin) == 1) {
        float result;
        sig_pow_batch(&pair.x, &pair.minus_one_q31, &result, 1);
        if (fwrite(&result, sizeof result, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
#endif
