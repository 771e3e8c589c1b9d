// Which number a brick has. Expects the texel buffers `table` (key and number of each slot) and `counters`.

#include "vxao/room.glsl"

// The brick's place in the pool; -1 where there is none.
int brick_at(int level, ivec3 brick, int slots_log2) {
    if (!has_key(brick)) return -1;
    uint key = key_of(brick), mask = (1u << slots_log2) - 1u;
    uint slot = first_slot(key, slots_log2), step_ = slot_step(key, slots_log2);
    int start = level << slots_log2, found = -1;
    for (int i = 0; i < probes; ++i) {
        uvec2 entry = imageLoad(table, start + int(slot)).xy;
        if (entry.x == key) found = int(entry.y);
        if (entry.x == key || entry.x == 0u) break;
        slot = (slot + step_) & mask;
    }
    return found < 0 ? -1 : bricks_of_level[level].first + found;
}
