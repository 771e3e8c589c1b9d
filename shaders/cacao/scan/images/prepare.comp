// CACAO `scan`, prepare, on GPUs: depth and its mips (section 8.2) into images, in one pass through shared memory.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU
#include "cacao/scan/prepare.glsl"
#include "cacao/scan/mip.glsl"

const int tile = cacao_mip_tile;
layout(local_size_x = tile, local_size_y = tile) in;
layout(constant_id = spec_mips) const int mips = 0;
layout(binding = 16, r32f) uniform writeonly image2DArray depths[4];
layout(binding = 18, r32ui) uniform writeonly uimageBuffer load_counter;

shared float mip0[4][tile][tile], mip1[4][tile / 2][tile / 2], mip2[4][tile / 4][tile / 4];

#define FOUR(from, s, x, y) nearest_surface(from[s][2 * y][2 * x], from[s][2 * y + 1][2 * x], from[s][2 * y][2 * x + 1], from[s][2 * y + 1][2 * x + 1])
void store_mip(int mip, int slice, ivec2 t, float z) { imageStore(depths[mip], ivec3(t, slice), vec4(z)); }
void store_depth(int slice, ivec2 t, float z) { store_mip(0, slice, t, z); }

// All mips of the tile at once, of all slices: thread i makes texel i of each.
void make_mips(ivec2 l, vec4 z) {
    for (int slice = 0; slice < 4; ++slice) mip0[slice][l.y][l.x] = z[slice];
    barrier();
    int i = int(gl_LocalInvocationIndex);
    ivec2 group = ivec2(gl_WorkGroupID.xy);
    {
        int slice = i >> 4, x = i & 3, y = i >> 2 & 3;
        float made = FOUR(mip0, slice, x, y);
        mip1[slice][y][x] = made;
        store_mip(1, slice, 4 * group + ivec2(x, y), made);
    }
    barrier();
    if (i < 16) {
        int slice = i >> 2, x = i & 1, y = i >> 1 & 1;
        float made = FOUR(mip1, slice, x, y);
        mip2[slice][y][x] = made;
        store_mip(2, slice, 2 * group + ivec2(x, y), made);
    }
    barrier();
    if (i < 4) store_mip(3, i, group, FOUR(mip2, i, 0, 0));
}

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    vec4 z = vec4(0.0);
    if (t == ivec2(0)) imageStore(load_counter, 0, uvec4(0));
    if (all(lessThan(t, k.slice))) z = prepared(t);
    if (mips != 0) make_mips(ivec2(gl_LocalInvocationID.xy), z);
}
