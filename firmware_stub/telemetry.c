#include "telemetry.h"

/*
 * GCC's and Clang's atomic loads and stores: C99 has none, and volatile alone would let the
 * compiler or the processor move the record's own words across the index.
 */
static uint32_t load_acquire(const uint32_t *index)
{
    return __atomic_load_n(index, __ATOMIC_ACQUIRE);
}

static void store_release(uint32_t *index, uint32_t value)
{
    __atomic_store_n(index, value, __ATOMIC_RELEASE);
}

void telemetry_put(telemetry_ring *ring, const telemetry_record *record)
{
    const uint32_t written = ring->written;
    if (written - load_acquire(&ring->taken) >= TELEMETRY_RECORDS) {
        ++ring->dropped;
        return;
    }
    telemetry_record *const slot = &ring->records[written % TELEMETRY_RECORDS];
    *slot = *record;
    slot->dropped = ring->dropped;
    store_release(&ring->written, written + 1u);
}

bool telemetry_take(telemetry_ring *ring, telemetry_record *record)
{
    const uint32_t taken = ring->taken;
    if (load_acquire(&ring->written) == taken) {
        return false;
    }
    *record = ring->records[taken % TELEMETRY_RECORDS];
    store_release(&ring->taken, taken + 1u);
    return true;
}
