// CACAO depth mips: one thread builds the 4x4, 2x2 and single texel of mips 1 to 3 over 8x8 texels of one slice.
// The chain runs on unrounded values; only the stored copies are binary16 in the reference.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"
#include "lib/cacao_mip.glsl"

layout(local_size_x = 64) in;
layout(constant_id = spec_device_depth) const int device_depth = 0;

layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32f) uniform writeonly imageBuffer depths;

void store(int slice, int mip, ivec2 t, float z) {
    // Scan keeps the partial texels at the right and lower rim; the reference's mips end before them.
    if (scan == 0 && any(greaterThanEqual(t, mip_size(mip)))) return;
    imageStore(depths, depth_index(slice, mip, t), vec4(whole(scan != 0 ? z : half_toward_zero(z))));
}

float depth_at(int slice, ivec2 t) {
    ivec2 p = spacing * (2 * t + ivec2(slice & 1, slice >> 1));
    ivec2 q = min(p, k.image - 1);
    float d = imageLoad(depth_in, q.y * k.image.x + q.x).x;
    if (device_depth != 0) d = linear_depth(d);
    return scan != 0 && q != p ? 0.0 : d;
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
