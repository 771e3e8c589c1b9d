// A level of SAO's depth pyramid: each texel keeps one of the four below it, chosen by a rotated grid, so that no depth is
// invented (McGuire, Mara, Luebke 2012, section 2.1). Departures: a texel remembers its pixel; where the chosen depth is a
// hole, another of the four is taken.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/alchemy.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_level) const int level = 1;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rg32ui) readonly uniform uimageBuffer below; // the level before; unused for the first
layout(binding = 16, scalar) writeonly buffer Levels { uvec2 levels[]; };
layout(binding = 32, scalar) uniform Constants { AlchemyConstants constants; };

uvec2 below_at(ivec2 q, ivec2 size) {
    if (any(greaterThanEqual(q, size))) return uvec2(0u);
    if (level == 1) return uvec2(floatBitsToUint(imageLoad(depth_in, index_of(q)).x), uint(q.x) | uint(q.y) << 16);
    return imageLoad(below, pyramid_start(k.size, level - 1) + q.y * size.x + q.x).xy;
}

void main() {
    k = constants.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy), size = pyramid_size(k.size, level);
    if (any(greaterThanEqual(p, size))) return;
    ivec2 first = ivec2((p.y & 1) ^ 1, (p.x & 1) ^ 1); // the published choice
    ivec2 size_below = pyramid_size(k.size, level - 1);
    uvec2 kept = uvec2(0u);
    for (int i = 0; i < 4; ++i) { // the chosen one, then the others in the order of the grid
        ivec2 offset = first ^ ivec2(i & 1, i >> 1);
        uvec2 texel = below_at(2 * p + offset, size_below);
        kept = kept.x == 0u ? texel : kept;
    }
    levels[pyramid_start(k.size, level) + p.y * size.x + p.x] = kept;
}
