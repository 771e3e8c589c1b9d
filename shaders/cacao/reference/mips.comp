// CACAO `reference`, depth mips (D, section 8.2): one thread builds the 4x4, 2x2 and single texel of mips 1 to 3 over 8x8 texels of one
// slice. The chain runs on unrounded values; only the stored copies are binary16.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32f) uniform writeonly imageBuffer depths;

// avg*: the mean of what lies on the nearest surface.
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

// The texel of mip 1 at t, from four of mip 0 taken column by column, as AMD orders them.
float mip1(int slice, ivec2 t) {
    float z = nearest_surface(depth_at(slice, 2 * t), depth_at(slice, 2 * t + ivec2(0, 1)), depth_at(slice, 2 * t + ivec2(1, 0)),
                              depth_at(slice, 2 * t + ivec2(1, 1)));
    store(slice, 1, t, z);
    return z;
}

float mip2(int slice, ivec2 t) {
    float z = nearest_surface(mip1(slice, 2 * t), mip1(slice, 2 * t + ivec2(0, 1)), mip1(slice, 2 * t + ivec2(1, 0)),
                              mip1(slice, 2 * t + ivec2(1, 1)));
    store(slice, 2, t, z);
    return z;
}

void main() {
    k = constants;
    int i = int(gl_GlobalInvocationID.x);
    ivec2 blocks = (k.slice + 7) / 8;
    int slice = i / (blocks.x * blocks.y);
    if (slice > 3) return;
    i -= slice * blocks.x * blocks.y;
    ivec2 t = ivec2(i % blocks.x, i / blocks.x);
    float z = nearest_surface(mip2(slice, 2 * t), mip2(slice, 2 * t + ivec2(0, 1)), mip2(slice, 2 * t + ivec2(1, 0)),
                              mip2(slice, 2 * t + ivec2(1, 1)));
    store(slice, 3, t, z);
}
