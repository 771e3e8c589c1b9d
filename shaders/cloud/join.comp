// The boxes of inner nodes from those of their children, several levels at once.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/cloud.h"

layout(local_size_x = 1 << (cloud_levels - 1)) in;
layout(constant_id = spec_level) const int first_level = 0;
layout(binding = 16, std430) coherent buffer Boxes { float boxes[]; };
layout(binding = 32, scalar) uniform Constants { CloudConstants k; };

void main() {
    uint width = gl_WorkGroupSize.x;
    for (int level = first_level; level > first_level - cloud_levels && level > 0; --level, width /= 2) {
        uint place = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * width + gl_LocalInvocationIndex;
        if (gl_LocalInvocationIndex < width && place < (1u << level)) {
            uint node = (1u << level) + place;
            for (int i = 0; i < 3; ++i) {
                boxes[6 * node + i] = min(boxes[12 * node + i], boxes[12 * node + 6 + i]);
                boxes[6 * node + 3 + i] = max(boxes[12 * node + 3 + i], boxes[12 * node + 9 + i]);
            }
        }
        memoryBarrierBuffer();
        barrier();
    }
}
