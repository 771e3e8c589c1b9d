// CACAO `scan`, depth mips (section 8.2): one thread builds the 4x4, 2x2 and single texel of mips 1 to 3 over 8x8 texels of one slice.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/scan/scan.glsl"
#include "cacao/scan/mip.glsl"

layout(local_size_x = 64) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32f) uniform writeonly imageBuffer depths;

// Partial texels at the right and lower rim are kept (AMD's mips end before them).
void store(int slice, int mip, ivec2 t, float z) { imageStore(depths, depth_index(slice, mip, t), vec4(whole(z))); }

float depth_at(int slice, ivec2 t) {
    ivec2 p = spacing * (2 * t + parity_of(slice));
    ivec2 q = min(p, k.image - 1);
    float z = depth_from(imageLoad(depth_in, q.y * k.image.x + q.x).x);
    return q != p ? 0.0 : z;
}

// The texel of mip 1 at t, from four of mip 0.
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
