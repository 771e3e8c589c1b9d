// Voxels of one level from those of the next finer one. Along each axis two of them lie one behind the other: what passes the
// first meets the second. Across it the four results are averaged. A plain mean would let light leak through thin walls.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"

layout(local_size_x = vxao_threads) in;
layout(constant_id = spec_level) const int level = 1;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer table;
layout(binding = 1, r32ui) readonly uniform uimageBuffer counters;
layout(binding = 2, r32ui) readonly uniform uimageBuffer keys;
layout(binding = 16, scalar) buffer Voxels { uint voxels[]; };
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "vxao/grid.glsl"
#include "vxao/numbers.glsl"

vec3 two(vec3 a, vec3 b) { return a + b * (1.0 - a); }

void main() {
    VxaoConstants c = constants;
    number_levels(c);
    if (level >= c.levels || level - 1 < finest) return;
    Level here = bricks_of_level[level];
    for (int number = int(gl_WorkGroupID.x); number < here.count; number += vxao_groups) {
        ivec3 origin = brick_of(imageLoad(keys, level * c.bricks + number).x) * vxao_side;
        for (int i = int(gl_LocalInvocationID.x); i < vxao_inner; i += vxao_threads) {
            ivec3 child = 2 * (origin + inner_place(i)); // the eight lie in one brick
            int brick = brick_at(level - 1, child >> 3, c.slots_log2);
            if (brick < 0) continue;
            int at = brick * vxao_stored + stored_at(child & 7);
            vec3 a[8];
            for (int j = 0; j < 8; ++j)
                a[j] = coverage_of(voxels[at + stored_at(ivec3(j, j >> 1, j >> 2) & 1)]);
            vec3 covered = 0.25 * vec3(two(a[0], a[1]).x + two(a[2], a[3]).x + two(a[4], a[5]).x + two(a[6], a[7]).x,
                                       two(a[0], a[2]).y + two(a[1], a[3]).y + two(a[4], a[6]).y + two(a[5], a[7]).y,
                                       two(a[0], a[4]).z + two(a[1], a[5]).z + two(a[2], a[6]).z + two(a[3], a[7]).z);
            int to = (here.first + number) * vxao_stored + stored_at(inner_place(i));
            voxels[to] = packed_coverage(max(covered, coverage_of(voxels[to]))); // far surfaces were added here
        }
    }
}
