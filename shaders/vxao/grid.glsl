// Where voxels are kept. A level has a hash table of its bricks: key and number. Bricks of the coarsest level come first, so
// that the finest is left out where room is short. Expects `constants`.

const int probes = 64; // tables are at most half full: more will not be needed
const int middle = 512; // bricks have 10 bits of coordinate along each axis

// A point of this view's space, in voxels of level 0.
vec3 in_grid(vec3 point, VxaoConstants c) {
    return vec3(dot(c.grid_x, point), dot(c.grid_y, point), dot(c.grid_z, point)) * c.per_voxel + c.shift;
}

// Never 0. Only of bricks within reach of the coordinates.
uint key_of(ivec3 brick) {
    uvec3 b = uvec3(brick + middle);
    return (b.x | b.y << 10 | b.z << 20) + 1u;
}
bool has_key(ivec3 brick) { return all(lessThan(uvec3(brick + middle), uvec3(2 * middle))); }
ivec3 brick_of(uint key) {
    uint k0 = key - 1u;
    return ivec3(k0 & 1023u, k0 >> 10 & 1023u, k0 >> 20) - middle;
}

// Double hashing (Knuth, volume 3, 6.4): the first slot, and an odd step to the next ones.
uint first_slot(uint key, int slots_log2) { return key * 2654435769u >> (32 - slots_log2); }
uint slot_step(uint key, int slots_log2) { return (key * 2246822519u >> (32 - slots_log2)) | 1u; }

int stored_at(ivec3 in_brick) { return (in_brick.z * vxao_rimmed + in_brick.y) * vxao_rimmed + in_brick.x; }
int inner_at(ivec3 in_brick) { return (in_brick.z * vxao_side + in_brick.y) * vxao_side + in_brick.x; }
ivec3 inner_place(int i) { return ivec3(i & 7, i >> 3 & 7, i >> 6); }

// Coverages along x, y, z, ten bits each.
uint packed_coverage(vec3 a) {
    uvec3 q = uvec3(clamp(a, 0.0, 1.0) * 1023.0 + 0.5);
    return q.x | q.y << 10 | q.z << 20;
}
vec3 coverage_of(uint q) { return vec3(q & 1023u, q >> 10 & 1023u, q >> 20 & 1023u) * (1.0 / 1023.0); }
