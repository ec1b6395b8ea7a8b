#ifndef TELEMETRY_H
#define TELEMETRY_H

/*
 * What happened, from the tick to the main loop: a ring with one writer and one reader, which may
 * interrupt each other anywhere. Each side moves its own index only, after it is done with the
 * record. When the ring is full the new record is dropped and counted: the tick never waits.
 */

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"

#define TELEMETRY_RECORDS 16u /* a power of two, so that the indices may wrap */

typedef struct {
    uint32_t tick;
    uint32_t mode;  /* app_mode */
    uint32_t fault; /* app_fault */
    int32_t status; /* tdc_status of the controller's last call */
    uint32_t overruns;
    uint32_t elapsed; /* timer counts that the slowest tick took */
    uint32_t dropped; /* records lost before this one */
    int32_t counts[JOINTS];
    int32_t torque_mNm[JOINTS];
} telemetry_record;

typedef struct {
    uint32_t written; /* records put in so far; moved by the writer */
    uint32_t taken;   /* records taken out so far; moved by the reader */
    uint32_t dropped; /* the writer's own */
    telemetry_record records[TELEMETRY_RECORDS];
} telemetry_ring;

/** Writer: puts a record in and fills its field dropped, or drops it. */
void telemetry_put(telemetry_ring *ring, const telemetry_record *record);

/** Reader: takes the oldest record out; false if there is none. */
bool telemetry_take(telemetry_ring *ring, telemetry_record *record);

#endif
