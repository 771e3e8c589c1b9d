// Adds a piece of surface to its voxels. Expects the array `sums`, numbers.glsl and patch.glsl.
void add_patches(Patches patches, VxaoConstants c) {
    int coarser = max(finest - patches.level, 0); // where the finest levels have no room
    patches.level += coarser;
    if (patches.level >= c.levels) return;
    uvec3 coverage = uvec3(patches.coverage * (scale / float(1 << 2 * coarser)) + 0.5);
    for (int i = 0; i < patches.count; ++i) {
        ivec3 voxel = voxel_of(patches, i);
        int brick = brick_at(patches.level, voxel >> 3, c.slots_log2);
        if (brick < 0) continue;
        int at = 3 * (brick * vxao_inner + inner_at(voxel & 7));
        if (coverage.x > 0u) atomicAdd(sums[at], coverage.x);
        if (coverage.y > 0u) atomicAdd(sums[at + 1], coverage.y);
        if (coverage.z > 0u) atomicAdd(sums[at + 2], coverage.z);
    }
}
