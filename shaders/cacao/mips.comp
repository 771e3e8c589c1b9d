// CACAO depth mips: one thread builds the 4x4, 2x2 and single texel of mips 1 to 3 over 8x8 texels of one slice.
// The chain runs on unrounded values; only the stored copies are binary16 in the reference.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"

layout(local_size_x = 8, local_size_y = 1) in;
layout(constant_id = spec_device_depth) const int device_depth = 0;

layout(binding = 0) uniform samplerBuffer depth_in;
layout(binding = 16, scalar) writeonly buffer Depths { float depths[]; };

// Mean of what lies on the nearest surface. Scan leaves holes out and yields a hole when all four are.
float nearest_surface(float a, float b, float c, float d) {
    vec4 z = vec4(a, b, c, d);
    vec4 known = scan != 0 ? vec4(greaterThan(z, vec4(0.0))) : vec4(1.0);
    vec4 candidate = scan != 0 ? mix(vec4(3e38), z, known) : z;
    float nearest = min(min(candidate.x, candidate.y), min(candidate.z, candidate.w));
    vec4 away = z - nearest;
    vec4 w = known * clamp(1.0 + k.mip_weight * (away * away), 0.0, 1.0);
    float total = w.x + w.y + w.z + w.w;
    if (scan != 0 && total == 0.0) return 0.0;
    return (w.x * a + w.y * b + w.z * c + w.w * d) / total;
}

void store(int slice, int mip, ivec2 t, float z) {
    if (any(greaterThanEqual(t, k.mip_size[mip]))) return;
    depths[k.mip_offset[mip] + (slice * k.mip_size[mip].y + t.y) * k.mip_size[mip].x + t.x] =
        scan != 0 ? z : half_toward_zero(z);
}

void main() {
    int slice = int(gl_GlobalInvocationID.z);
    ivec2 block = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(block * 8, k.slice))) return;
    ivec2 origin = ivec2(slice & 1, slice >> 1);
    float z1[4][4];
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) {
            float z0[4];
            for (int n = 0; n < 4; ++n) { // column by column, as AMD orders the four
                ivec2 t = 8 * block + 2 * ivec2(i, j) + ivec2(n >> 1, n & 1);
                ivec2 p = spacing * (2 * t + origin);
                ivec2 q = min(p, k.image - 1);
                float d = texelFetch(depth_in, q.y * k.image.x + q.x).x;
                if (device_depth != 0) d = linear_depth(d);
                z0[n] = scan != 0 && q != p ? 0.0 : d;
            }
            z1[j][i] = nearest_surface(z0[0], z0[1], z0[2], z0[3]);
            store(slice, 1, 4 * block + ivec2(i, j), z1[j][i]);
        }
    float z2[2][2];
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i) {
            z2[j][i] = nearest_surface(z1[2 * j][2 * i], z1[2 * j + 1][2 * i], z1[2 * j][2 * i + 1], z1[2 * j + 1][2 * i + 1]);
            store(slice, 2, 2 * block + ivec2(i, j), z2[j][i]);
        }
    store(slice, 3, block, nearest_surface(z2[0][0], z2[1][0], z2[0][1], z2[1][1]));
}
