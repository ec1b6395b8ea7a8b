/*
 * What GCC may call even in freestanding C: copying and clearing of structures. Bytes, not words:
 * a few dozen bytes a tick are copied, and this is correct for every alignment.
 */

#include <string.h>

void *memcpy(void *restrict target, const void *restrict source, size_t size)
{
    unsigned char *to = target;
    const unsigned char *from = source;
    for (size_t i = 0u; i < size; ++i) {
        to[i] = from[i];
    }
    return target;
}

void *memset(void *target, int value, size_t size)
{
    unsigned char *to = target;
    for (size_t i = 0u; i < size; ++i) {
        to[i] = (unsigned char)value;
    }
    return target;
}
