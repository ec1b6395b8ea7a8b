/*
 * Does on a target what the host asks for, and exits. Requests and answers are two files of the
 * host, read and written by semihosting; all words are 32 bits, little-endian on both sides.
 */

#include "verification/chain/target/steps.h"

#include "firmware_stub/cores/core.h"
#include "firmware_stub/pil/link.h"

#define HELLO_MAGIC 0x43484132u /* changes with the requests and the answers */

/* The first word of an answer file: both sides mean the same controller and the same layout. */
typedef struct {
    uint32_t magic;
    uint32_t specification;
    uint32_t case_bytes;
    uint32_t result_bytes;
    uint32_t summary_bytes;
} hello;

#define TAKE_CASES 1u   /* `count` cases follow; answers a result for each */
#define TAKE_BLOCKS 2u  /* answers the summary of each block from `first` on */
#define RECORD_BLOCK 3u /* answers case and result of each step of block `first` */

typedef struct {
    uint32_t command;
    uint32_t first;
    uint32_t count;
    uint32_t steps; /* of a block */
} request;

static bool say_hello(void)
{
    const hello said = {
        .magic = HELLO_MAGIC,
        .specification = controller_default_config.specification,
        .case_bytes = sizeof(step_case),
        .result_bytes = sizeof(step_result),
        .summary_bytes = sizeof(block_summary),
    };
    return link_write(&said, sizeof said);
}

static bool take_cases(const request *const asked)
{
    step_case step;
    step_result result;
    bool good = true;
    for (uint32_t i = 0u; good && (i < asked->count); ++i) {
        good = link_read(&step, sizeof step);
        if (good) {
            step_take(&step, &result);
            good = link_write(&result, sizeof result);
        }
    }
    return good;
}

static bool take_blocks(const request *const asked)
{
    bool good = true;
    for (uint32_t i = 0u; good && (i < asked->count); ++i) {
        block_summary summary;
        block_take(asked->first + i, asked->steps, &summary, NULL, NULL);
        good = link_write(&summary, sizeof summary);
    }
    return good;
}

static void write_step(void *const context, const step_case *const step,
                       const step_result *const result)
{
    bool *const good = context;
    if (*good) {
        *good = link_write(step, sizeof *step);
    }
    if (*good) {
        *good = link_write(result, sizeof *result);
    }
}

static bool record_block(const request *const asked)
{
    block_summary summary;
    bool good = true;
    block_take(asked->first, asked->steps, &summary, write_step, &good);
    return good;
}

static bool answer(const request *const asked)
{
    switch (asked->command) {
    case TAKE_CASES:
        return take_cases(asked);
    case TAKE_BLOCKS:
        return take_blocks(asked);
    case RECORD_BLOCK:
        return record_block(asked);
    default:
        return false;
    }
}

static bool serve(void)
{
    request asked;
    bool good = true;
    while (good && link_read(&asked, sizeof asked)) {
        good = answer(&asked);
    }
    return good;
}

int main(void)
{
    bool good = link_open();
    if (good) {
        good = say_hello();
    }
    if (good) {
        good = serve();
    }
    link_close(good);
    return 0;
}

/* No tick here: the steps come one after the other. */
void core_tick(void)
{
}

void core_panic(void)
{
    link_close(false);
    for (;;) {
    }
}
