#ifndef PIL_PROTOCOL_H
#define PIL_PROTOCOL_H

/*
 * Processor in the loop: what host and target say to each other. All frames of a direction have
 * one size; all numbers are little-endian, and structures lie as both compilers lay them out: what
 * has no double has no padding.
 *
 *     target -> host   pil_hello                         once
 *     host -> target   pil_request                       as often as the host likes
 *     target -> host   pil_reply                         one for each request, in their order
 *
 * The host may send requests ahead of the replies. A link that ends ends the program.
 */

#include <stdint.h>

#include "controller.h"

#define PIL_MAGIC 0x4C495031u /* changes with this file */

typedef struct {
    uint32_t magic;
    uint32_t specification; /* identity of the controller, as in its configuration */
    uint32_t joints;
    uint32_t config_bytes;
    uint32_t input_bytes;
    uint32_t request_bytes;
    uint32_t reply_bytes;
} pil_hello;

#define PIL_RESET 1u         /* init with this configuration, counts and torque */
#define PIL_STEP 2u          /* one step with this input */
#define PIL_MEASURED_STEP 3u /* the same, and how much stack it took; slower */

typedef struct {
    controller_config config;
    int32_t counts[JOINTS];
    controller_number holding_torque[JOINTS];
} pil_reset;

typedef struct {
    uint32_t command;
    union {
        pil_reset reset;
        controller_input input;
    } with;
} pil_request;

typedef struct {
    int32_t status;                   /* of init or step */
    uint32_t controller_stack_bytes;  /* 0 for a plain step */
    controller_number torque[JOINTS]; /* zeros for a reset */
} pil_reply;

#endif
