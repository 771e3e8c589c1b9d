// CACAO `scan`, first half of upsampling (section 8.9): one AO value and one depth per pixel of the half-size grid, with a halo of two.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/scan/scan.glsl"
#include "cacao/scan/resolve.glsl"
#include "cacao/scan/buffers/slices.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 1, r32f) readonly uniform imageBuffer depths;
layout(binding = 16, scalar) writeonly buffer Staged { vec2 staged[]; };

// Depth 0 keeps holes and pixels that LOWEST has not computed out of the upsampler.
float depth_or_hole(int slice, ivec2 t) {
    bool own = two_slices == 0 || slice == 0 || slice == 3;
    bool inside = all(greaterThanEqual(t, ivec2(0))) && all(lessThan(t, k.slice));
    return own && inside ? imageLoad(depths, depth_index(slice, 0, t)).x : 0.0;
}

void put(int slice, ivec2 t, float v) {
    ivec2 g = 2 * t + parity_of(slice) + 2;
    float z = depth_or_hole(slice, t);
    if (all(lessThan(g, k.grid))) staged[g.y * k.grid.x + g.x] = vec2(v, z);
}

// 2x2 grid pixels a thread, from the halo on.
void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy) - 1;
    if (any(greaterThanEqual(2 * t, k.grid - 2))) return;
    vec4 v = resolved_block(t);
    put(0, t, v.x);
    put(1, t, v.y);
    put(2, t, v.z);
    put(3, t, v.w);
}
