/* What every C program needs before main. */

#include "cores/core.h"

int main(void);

void core_run(void)
{
    const uint32_t *from = data_load;
    for (uint32_t *to = data_start; to < data_end; ++to) {
        *to = *from;
        ++from;
    }
    for (uint32_t *to = bss_start; to < bss_end; ++to) {
        *to = 0u;
    }
    (void)main();
    core_panic();
}
