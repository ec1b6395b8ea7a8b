/*
 * Writer and reader of the telemetry ring as two threads, which interrupt each other more freely
 * than an interrupt and a main loop do. Built with ThreadSanitizer, which reports every data race.
 */

#include <pthread.h>
#include <stdio.h>

#include "firmware_stub/telemetry.h"

#define RECORDS 100000u

static telemetry_ring ring;
static int writer_is_done;

static void *write_records(void *unused)
{
    (void)unused;
    for (uint32_t k = 0u; k < RECORDS; ++k) {
        telemetry_record record = {.tick = k, .overruns = ~k};
        record.counts[JOINTS - 1u] = (int32_t)k;
        telemetry_put(&ring, &record);
    }
    __atomic_store_n(&writer_is_done, 1, __ATOMIC_RELEASE);
    return NULL;
}

/* The record is whole, in order, and what is missing before it was counted. */
static int is_next(const telemetry_record *record, uint32_t taken)
{
    return (record->overruns == ~record->tick) &&
           (record->counts[JOINTS - 1u] == (int32_t)record->tick) &&
           (record->tick == taken + record->dropped);
}

/* Takes everything; returns the number of records, or 0 if one was broken. */
static uint32_t read_records(void)
{
    telemetry_record record;
    uint32_t taken = 0u;
    for (;;) {
        /* Read before the ring, or the last records could slip in between. */
        const int done = __atomic_load_n(&writer_is_done, __ATOMIC_ACQUIRE);
        if (telemetry_take(&ring, &record)) {
            if (is_next(&record, taken) == 0) {
                (void)fprintf(stderr, "record %u is broken\n", (unsigned)record.tick);
                return 0u;
            }
            ++taken;
        } else if (done != 0) {
            return taken;
        } else {
            /* Not yet. */
        }
    }
}

int main(void)
{
    pthread_t writer;
    if (pthread_create(&writer, NULL, write_records, NULL) != 0) {
        return 2;
    }
    const uint32_t taken = read_records();
    (void)pthread_join(writer, NULL);
    return ((taken > 0u) && (taken + ring.dropped == RECORDS)) ? 0 : 1;
}
