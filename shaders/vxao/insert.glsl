// Makes bricks for a piece of surface, at its level and all coarser ones. Expects the arrays `table`, `counters` and `keys` to write,
// grid.glsl and patch.glsl.

// A new brick gets the next number of its level. A full table counts as more bricks than there is room for.
void insert(int level, ivec3 brick, bool numbered, VxaoConstants c) {
    if (!has_key(brick)) return;
    uint key = key_of(brick), mask = (1u << c.slots_log2) - 1u;
    uint slot = first_slot(key, c.slots_log2), step_ = slot_step(key, c.slots_log2);
    uint start = uint(level) << c.slots_log2;
    bool done = false;
    if (numbered && counters[level] > uint(c.bricks)) return;
    for (int i = 0; i < probes && !done; ++i) {
        uint at = 2u * (start + slot), known = table[at];
        if (known == 0u) {
            known = atomicCompSwap(table[at], 0u, key);
            if (known == 0u && numbered) {
                uint number = atomicAdd(counters[level], 1u);
                table[at + 1u] = number;
                if (number < uint(c.bricks)) keys[uint(level * c.bricks) + number] = key;
            }
            done = known == 0u;
        }
        done = done || known == key;
        slot = (slot + step_) & mask;
    }
    if (!done && numbered) atomicAdd(counters[level], uint(c.bricks) + 1u);
}

// Its own brick, and those that end at the voxel: their rims hold it.
void insert_about(int level, ivec3 voxel, VxaoConstants c) {
    ivec3 high = voxel >> 3, low = (voxel - 1) >> 3;
    bvec3 two = notEqual(low, high);
    insert(level, high, true, c);
    if (any(two))
        for (int i = 1; i < 8; ++i) {
            bvec3 lower = notEqual(i & ivec3(1, 2, 4), ivec3(0));
            bvec3 wrong = bvec3(lower.x && !two.x, lower.y && !two.y, lower.z && !two.z);
            if (!any(wrong)) insert(level, mix(high, low, lower), true, c);
        }
}

void insert_patches(Patches patches, VxaoConstants c) {
    for (int i = 0; i < patches.count; ++i) {
        ivec3 voxel = voxel_of(patches, i);
        for (int level = patches.level; level < c.levels; ++level) {
            insert_about(level, voxel, c);
            voxel >>= 1;
        }
    }
}

// Cells are at least twice the radius wide.
int cell_log2(VxaoConstants c) { return c.levels; }
