// A brick's rim: copies of the next bricks' first voxels, so that a sample needs to find one brick only.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"

layout(local_size_x = vxao_threads) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer table;
layout(binding = 1, r32ui) readonly uniform uimageBuffer counters;
layout(binding = 2, r32ui) readonly uniform uimageBuffer keys;
layout(binding = 16, scalar) buffer Voxels { uint voxels[]; };
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "vxao/grid.glsl"
#include "vxao/numbers.glsl"

const int of_face = vxao_rimmed * vxao_rimmed;

void main() {
    VxaoConstants c = constants;
    number_levels(c);
    for (int brick = int(gl_WorkGroupID.x); brick < bricks; brick += vxao_groups) {
        int level = level_of(brick);
        ivec3 own = brick_of(imageLoad(keys, level * c.bricks + brick - bricks_of_level[level].first).x);
        // Three faces; what two of them share is copied twice, the same.
        for (int i = int(gl_LocalInvocationID.x); i < 3 * of_face; i += vxao_threads) {
            int face = i / of_face, in_face = i - face * of_face, row = in_face / vxao_rimmed;
            ivec2 across = ivec2(in_face - row * vxao_rimmed, row);
            ivec3 at = face == 0 ? ivec3(vxao_side, across) : face == 1 ? ivec3(across.x, vxao_side, across.y) : ivec3(across, vxao_side);
            int next = brick_at(level, own + (at >> 3), c.slots_log2);
            voxels[brick * vxao_stored + stored_at(at)] = next < 0 ? 0u : voxels[next * vxao_stored + stored_at(at & 7)];
        }
    }
}
