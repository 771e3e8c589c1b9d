// Bricks for the surfaces of other views, as far as they are within the radius of what this one shows.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer neighbours; // one view after the other
layout(binding = 16, scalar) coherent buffer Table { uint table[]; };
layout(binding = 17, scalar) coherent buffer Counters { uint counters[]; };
layout(binding = 18, scalar) writeonly buffer Keys { uint keys[]; }; // of the bricks of each level
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "vxao/grid.glsl"
#include "vxao/patch.glsl"
#include "vxao/insert.glsl"
#include "vxao/neighbour.glsl"

bool within_reach(ivec3 cell, VxaoConstants c) {
    if (!has_key(cell)) return false;
    uint key = key_of(cell), mask = (1u << c.slots_log2) - 1u;
    uint slot = first_slot(key, c.slots_log2), step_ = slot_step(key, c.slots_log2);
    uint known = 1u;
    for (int i = 0; i < probes && known != key && known != 0u; ++i) {
        known = table[2u * ((uint(vxao_reach) << c.slots_log2) + slot)];
        slot = (slot + step_) & mask;
    }
    return known == key;
}

void main() {
    VxaoConstants c = constants;
    k = c.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    int view = int(gl_GlobalInvocationID.z);
    if (any(greaterThanEqual(p, k.window)) || view >= k.neighbours) return;
    Patches patches;
    if (!patches_of_neighbour(p, view, c, patches)) return;
    ivec3 cell = ivec3(floor(clamp(patches.middle, -1e6, 1e6))) >> cell_log2(c);
    if (within_reach(cell, c)) insert_patches(patches, c);
}
