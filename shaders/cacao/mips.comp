// CACAO depth mips: one thread builds the 4x4, 2x2 and single texel of mips 1 to 3 over 8x8 texels of one slice.
// The chain runs on unrounded values; only the stored copies are binary16 in the reference.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"

layout(local_size_x = 64) in;
layout(constant_id = spec_device_depth) const int device_depth = 0;

layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32f) uniform writeonly imageBuffer depths;

// Mean of what lies on the nearest surface. Scan leaves holes out and yields a hole when all four are.
float nearest_surface(float a, float b, float c, float d) {
    vec4 z = vec4(a, b, c, d);
    vec4 known = scan != 0 ? vec4(greaterThan(z, vec4(0.0))) : vec4(1.0);
    float nearest = min(min(a, b), min(c, d));
    if (scan != 0) { // as unsigned integers less one, holes are the farthest; a far stand-in for them came out as 0 on NVIDIA
        uvec4 order = floatBitsToUint(z) - 1u;
        nearest = uintBitsToFloat(min(min(order.x, order.y), min(order.z, order.w)) + 1u);
    }
    vec4 away = z - nearest;
    vec4 w = known * clamp(1.0 + k.mip_weight * (away * away), 0.0, 1.0);
    float total = w.x + w.y + w.z + w.w;
    if (scan != 0 && total == 0.0) return 0.0;
    return (w.x * a + w.y * b + w.z * c + w.w * d) / total;
}

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
