// CACAO `scan`, depth mips into a buffer (section 8.2).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/scan/scan.glsl"
#include "cacao/scan/mip.glsl"
#include "cacao/mips.glsl"

layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, scalar) writeonly buffer DepthsOut { float depths[]; };

// Partial texels at the right and lower rim are kept (AMD's mips end before them).
void store(int slice, int mip, ivec2 t, float z) { depths[depth_index(slice, mip, t)] = whole(z); }

float depth_at(int slice, ivec2 t) {
    ivec2 p = spacing * (2 * t + parity_of(slice));
    ivec2 q = min(p, k.image - 1);
    float z = depth_from(imageLoad(depth_in, q.y * k.image.x + q.x).x);
    return q != p ? 0.0 : z;
}
