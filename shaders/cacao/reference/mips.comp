// CACAO `reference`, depth mips (D, section 8.2). The chain runs on unrounded values; only the stored copies are binary16.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"
#include "cacao/mips.glsl"

layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32f) uniform writeonly imageBuffer depths;

// avg*: the mean depth of the nearest surface.
float nearest_surface(float a, float b, float c, float d) {
    vec4 z = vec4(a, b, c, d), away = z - min(min(a, b), min(c, d));
    vec4 w = clamp(1.0 + k.mip_weight * (away * away), 0.0, 1.0);
    return (w.x * a + w.y * b + w.z * c + w.w * d) / (w.x + w.y + w.z + w.w);
}

// Mips end before the partial texels at the right and lower rim.
void store(int slice, int mip, ivec2 t, float z) {
    if (all(lessThan(t, mip_size(mip)))) imageStore(depths, depth_index(slice, mip, t), vec4(whole(half_toward_zero(z))));
}

float depth_at(int slice, ivec2 t) {
    ivec2 p = min(spacing * (2 * t + parity_of(slice)), k.image - 1);
    return depth_from(imageLoad(depth_in, p.y * k.image.x + p.x).x);
}
