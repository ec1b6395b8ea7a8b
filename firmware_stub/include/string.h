/* All of <string.h> that the firmware needs: the compiler's own headers leave it to a libc. */
#ifndef STRING_H
#define STRING_H

#include <stddef.h>

void *memcpy(void *restrict target, const void *restrict source, size_t size);
void *memset(void *target, int value, size_t size);

#endif
