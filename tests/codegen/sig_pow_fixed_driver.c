/*
 * The power for integers for the tests: over arrays, for a shared library; with FIXED_FILTER as a
 * program that turns records of five words on stdin into pairs of results on stdout; with
 * FIXED_BARE_METAL as one that prints digest(FIXED_BARE_METAL) of a Cortex-M by semihosting.
 */
#include <stddef.h>
#include <stdint.h>

#include "tdc_fixed.h"

/* Called through ctypes, and looked up in the object file. NOLINTBEGIN(misc-use-internal-linkage) */
void power_batch(const int32_t *x, const uint32_t *exponent_q31, const int32_t *scale_q24,
                 int32_t *result, size_t count);
void scale_batch(const int32_t *x, const int32_t *factor, const uint32_t *shift, int32_t *result,
                 size_t count);
void multiply_high_batch(const uint32_t *a, const uint32_t *b, uint32_t *result, size_t count);
void leading_zeros_batch(const uint32_t *x, uint32_t *result, size_t count);
int32_t power_alone(int32_t x, uint32_t exponent_q31, int32_t scale_q24);
int32_t scale_alone(int32_t x, int32_t factor, uint32_t shift);
uint32_t digest(uint32_t count);
/* NOLINTEND(misc-use-internal-linkage) */

void power_batch(const int32_t *x, const uint32_t *exponent_q31, const int32_t *scale_q24,
                 int32_t *result, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        const tdc_fixed_power p = {exponent_q31[i], scale_q24[i]};
        result[i] = tdc_fixed_sig_pow(x[i], p);
    }
}

void scale_batch(const int32_t *x, const int32_t *factor, const uint32_t *shift, int32_t *result,
                 size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        result[i] = tdc_fixed_scale(x[i], factor[i], shift[i]);
    }
}

void multiply_high_batch(const uint32_t *a, const uint32_t *b, uint32_t *result, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        result[i] = tdc_multiply_high(a[i], b[i]);
    }
}

void leading_zeros_batch(const uint32_t *x, uint32_t *result, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        result[i] = tdc_leading_zeros(x[i]);
    }
}

/* One of each that isn't inlined, to look at its instructions. */
int32_t power_alone(int32_t x, uint32_t exponent_q31, int32_t scale_q24)
{
    const tdc_fixed_power p = {exponent_q31, scale_q24};
    return tdc_fixed_sig_pow(x, p);
}

int32_t scale_alone(int32_t x, int32_t factor, uint32_t shift)
{
    return tdc_fixed_scale(x, factor, shift);
}

/* Marsaglia's xorshift, with the period 2^32 - 1. */
static uint32_t next_random(uint32_t *state)
{
    *state ^= *state << 13u;
    *state ^= *state >> 17u;
    *state ^= *state << 5u;
    return *state;
}

/* A hash (FNV-1a over words) of many results, to compare targets by. */
uint32_t digest(uint32_t count)
{
    uint32_t state = 2463534242u;
    uint32_t hash = 2166136261u;
    for (uint32_t i = 0u; i < count; ++i) {
        const uint32_t bits = next_random(&state);
        const uint32_t size = next_random(&state);
        const int32_t x = tdc_signed((bits >> (size & 31u)) - (size >> 31u));
        const uint32_t exponent_q31 = next_random(&state);
        const int32_t scale_q24 = tdc_signed(next_random(&state) >> 2u) - INT32_C(0x20000000);
        const int32_t factor = tdc_signed(next_random(&state));
        const uint32_t shift = 1u + (size >> 27u) + ((size >> 22u) & 15u);
        hash = (hash ^ (uint32_t)power_alone(x, exponent_q31, scale_q24)) * 16777619u;
        hash = (hash ^ (uint32_t)scale_alone(x, factor, shift)) * 16777619u;
    }
    return hash;
}

#ifdef FIXED_BARE_METAL
static void semihosting(uint32_t operation, uintptr_t argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register uintptr_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

void reset(void);

void reset(void)
{
    const uint32_t hash = digest(FIXED_BARE_METAL);
    for (uint32_t i = 0u; i < 8u; ++i) {
        const char digit = "0123456789abcdef"[(hash >> (28u - (4u * i))) & 15u];
        semihosting(0x03u, (uintptr_t)&digit); /* SYS_WRITEC */
    }
    semihosting(0x18u, 0x20026u); /* SYS_EXIT, ADP_Stopped_ApplicationExit */
}

__attribute__((section(".vectors"), used)) static const uintptr_t vectors[2] = {
    0x20004000u, /* the top of the smallest RAM */
    (uintptr_t)&reset,
};
#endif

#ifdef FIXED_FILTER
#include <stdio.h>

int main(void)
{
    struct {
        int32_t x;
        uint32_t exponent_q31;
        int32_t scale_q24;
        int32_t factor;
        uint32_t shift;
    } record;
    while (fread(&record, sizeof record, 1, stdin) == 1) {
        const int32_t results[2] = {
            power_alone(record.x, record.exponent_q31, record.scale_q24),
            scale_alone(record.x, record.factor, record.shift),
        };
        if (fwrite(results, sizeof results, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
#endif
