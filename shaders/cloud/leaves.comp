// Of every leaf of a cloud's tree: which points it holds, and the box round their discs.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/cloud.h"

layout(local_size_x = cloud_group) in;
layout(binding = 0, std430) readonly buffer Points { vec4 points[]; };   // with the disc's radius
layout(binding = 1, std430) readonly buffer Normals { vec4 normals[]; };
layout(binding = 16, std430) writeonly buffer Boxes { float boxes[]; };  // of a node's two children, 6 numbers each
layout(binding = 17, std430) writeonly buffer Begins { uint begins[]; }; // first point of each leaf, and the end
layout(binding = 32, scalar) uniform Constants { CloudConstants k; };
#include "cloud/tree.glsl"

void main() {
    uint leaf = own_number(), leaves = 1u << k.levels;
    if (leaf >= leaves) return;
    uint begin = 0, size = k.points;
    for (int level = int(k.levels) - 1; level >= 0; --level) {
        uint half_size = size / 2;
        bool right = ((leaf >> level) & 1) != 0;
        begin += right ? half_size : 0;
        size = right ? size - half_size : half_size;
    }
    vec3 low = vec3(1e38), high = vec3(-1e38);
    for (uint i = begin; i < begin + size; ++i) {
        vec4 point = points[i];
        vec3 n = normals[i].xyz;
        vec3 reach = point.w * (sqrt(max(1.0 - n * n, 0.0)) + 1e-4); // of a disc along each axis, rounding included
        low = min(low, point.xyz - reach);
        high = max(high, point.xyz + reach);
    }
    begins[leaf] = begin;
    if (leaf + 1 == leaves) begins[leaves] = begin + size;
    uint at = 6 * (leaves + leaf); // boxes of the children of node n begin at 12 n
    boxes[at] = low.x; boxes[at + 1] = low.y; boxes[at + 2] = low.z;
    boxes[at + 3] = high.x; boxes[at + 4] = high.y; boxes[at + 5] = high.z;
}
