/* Processor in the loop, target side: the controller as it ships, fed by the host. */

#include <string.h>

#include "cores/core.h"
#include "pil/link.h"
#include "pil/protocol.h"
#include "runtime/stack.h"

static controller_config config;
static controller_state state;

static pil_reply reset(const pil_reset *with)
{
    pil_reply reply = {.status = 0};
    config = with->config;
    stack_paint();
    const uintptr_t here = core_stack_pointer();
    reply.status = controller_init(&config, &state, with->counts, with->holding_torque);
    reply.controller_stack_bytes = (uint32_t)(here - stack_deepest());
    return reply;
}

static pil_reply step(const controller_input *input)
{
    pil_reply reply = {.status = 0};
    reply.status = controller_step(&config, &state, input, reply.torque);
    return reply;
}

static pil_reply measured_step(const controller_input *input)
{
    pil_reply reply = {.status = 0};
    stack_paint();
    const uintptr_t here = core_stack_pointer();
    reply.status = controller_step(&config, &state, input, reply.torque);
    reply.controller_stack_bytes = (uint32_t)(here - stack_deepest());
    return reply;
}

static pil_reply answer(const pil_request *request)
{
    switch (request->command) {
    case PIL_RESET:
        return reset(&request->with.reset);
    case PIL_STEP:
        return step(&request->with.input);
    case PIL_MEASURED_STEP:
        return measured_step(&request->with.input);
    default: {
        const pil_reply unknown = {.status = TDC_BAD_ARGUMENT};
        return unknown;
    }
    }
}

static bool say_hello(void)
{
    const pil_hello hello = {
        .magic = PIL_MAGIC,
        .specification = controller_default_config.specification,
        .joints = JOINTS,
        .config_bytes = sizeof(controller_config),
        .input_bytes = sizeof(controller_input),
        .request_bytes = sizeof(pil_request),
        .reply_bytes = sizeof(pil_reply),
    };
    return link_write(&hello, sizeof hello);
}

/* Serves requests until the link ends, which is the host's way to say that it is done. */
static bool serve(void)
{
    pil_request request;
    while (link_read(&request, sizeof request)) {
        const pil_reply reply = answer(&request);
        if (!link_write(&reply, sizeof reply)) {
            return false;
        }
    }
    return true;
}

int main(void)
{
    const bool good = link_open() && say_hello() && serve();
    link_close(good);
    return 0;
}

/* The host says when a step is due; a tick only wakes a link that waits. */
void core_tick(void)
{
}

void core_panic(void)
{
    link_close(false);
    for (;;) {
    }
}
