// What one view covers of each voxel, at most all of it. Views see the same surfaces: the largest of their coverages counts.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"

layout(local_size_x = vxao_threads) in;
layout(constant_id = spec_first) const int first = 1;
layout(binding = 0, r32ui) readonly uniform uimageBuffer counters;
layout(binding = 16, scalar) buffer Sums { uint sums[]; };
layout(binding = 17, scalar) buffer Voxels { uint voxels[]; };
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "vxao/grid.glsl"
#include "vxao/room.glsl"

const float scale = 1048576.0; // as in patch.glsl

void main() {
    VxaoConstants c = constants;
    if (first == 0 && int(imageLoad(counters, vxao_view).x) >= c.screen.neighbours) return;
    number_levels(c);
    for (int brick = int(gl_WorkGroupID.x); brick < bricks; brick += vxao_groups)
        for (int i = int(gl_LocalInvocationID.x); i < vxao_inner; i += vxao_threads) {
            int at = 3 * (brick * vxao_inner + i);
            vec3 covered = min(vec3(sums[at], sums[at + 1], sums[at + 2]) * (1.0 / scale), 1.0);
            sums[at] = sums[at + 1] = sums[at + 2] = 0u; // for the next view, and the next frame
            int to = brick * vxao_stored + stored_at(inner_place(i));
            if (first == 0) covered = max(covered, coverage_of(voxels[to]));
            voxels[to] = packed_coverage(covered);
        }
}
