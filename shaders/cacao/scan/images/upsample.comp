// CACAO `scan`, second half of upsampling, on GPUs: the 25 taps of neighbours overlap, so they go through shared memory.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU
#include "cacao/scan/upsample.glsl"

const int tile = cacao_tile, wide = tile + 4;
layout(local_size_x = tile, local_size_y = tile) in;

shared vec2 near[wide * wide]; // grid pixels round the work group's

vec2 staged_at(int at) { return near[at]; }

void load_staged() {
    ivec2 first = tile * ivec2(gl_WorkGroupID.xy);
    for (int i = int(gl_LocalInvocationIndex); i < wide * wide; i += tile * tile) {
        ivec2 g = first + ivec2(i % wide, i / wide);
        near[i] = all(lessThan(g, k.grid)) ? imageLoad(staged, g.y * k.grid.x + g.x).xy : vec2(0.0);
    }
    barrier();
}

void main() {
    k = constants;
    load_staged();
    ivec2 l = ivec2(gl_LocalInvocationID.xy);
    upsample_pixels(ivec2(gl_GlobalInvocationID.xy), (l.y + 2) * wide + l.x + 2, wide);
}
