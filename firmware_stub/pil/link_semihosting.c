/*
 * The link through the emulator's or debugger's file access: two FIFOs of the host. A read blocks
 * the whole target, so that it costs no emulated instruction, and a step is one read and one write.
 */

#include "pil/link.h"

#include "cores/core.h"

#define SYS_OPEN 0x01
#define SYS_WRITE 0x05
#define SYS_READ 0x06
#define SYS_EXIT 0x18

#define MODE_READ_BINARY 1u
#define MODE_WRITE_BINARY_UNBUFFERED 5u
#define EXIT_GOOD 0x20026u    /* ADP_Stopped_ApplicationExit */
#define EXIT_FAILURE 0x20023u /* ADP_Stopped_RunTimeErrorUnknown */

static const char FROM_HOST[] = "from_host";
static const char TO_HOST[] = "to_host";

static int32_t from_host;
static int32_t to_host;

static int32_t open_file(const char *name, uint32_t length, uint32_t mode)
{
    const uintptr_t arguments[3] = {(uintptr_t)name, mode, length};
    return core_semihosting(SYS_OPEN, arguments);
}

bool link_open(void)
{
    from_host = open_file(FROM_HOST, sizeof FROM_HOST - 1u, MODE_READ_BINARY);
    to_host = open_file(TO_HOST, sizeof TO_HOST - 1u, MODE_WRITE_BINARY_UNBUFFERED);
    return (from_host >= 0) && (to_host >= 0);
}

/* Moves what one call can; SYS_READ and SYS_WRITE return how many bytes they left undone. */
static bool transfer(int32_t operation, int32_t file, uintptr_t data, size_t size)
{
    while (size > 0u) {
        const uintptr_t arguments[3] = {(uintptr_t)file, data, size};
        const int32_t left = core_semihosting(operation, arguments);
        if ((left < 0) || ((size_t)left >= size)) {
            return false;
        }
        data += size - (size_t)left;
        size = (size_t)left;
    }
    return true;
}

bool link_read(void *data, size_t size)
{
    return transfer(SYS_READ, from_host, (uintptr_t)data, size);
}

bool link_write(const void *data, size_t size)
{
    return transfer(SYS_WRITE, to_host, (uintptr_t)data, size);
}

void link_close(bool good)
{
    /* The 32-bit form of SYS_EXIT takes the reason itself, not a pointer to it. */
    (void)core_semihosting(SYS_EXIT, (const void *)(uintptr_t)(good ? EXIT_GOOD : EXIT_FAILURE));
}
