// CACAO `scan`, apply (section 8.8): native resolution, visibility of each image pixel from the four slices.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/scan/scan.glsl"
#include "cacao/scan/resolve.glsl"
#include "cacao/scan/buffers/slices.glsl"
#include "cacao/out.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;

float result(ivec2 p, float v) {
    bool surface = v >= 0.0;
    if (two_slices != 0) { // odd pixels have no hole flag
        p = min(p, k.image - 1);
        surface = surface && imageLoad(depth_in, p.y * k.image.x + p.x).x > 0.0;
    }
    return or_unknown(v, surface);
}

// 2x2 pixels a thread.
void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    ivec2 p = 2 * t;
    const ivec2 x = ivec2(1, 0), y = ivec2(0, 1);
    vec4 v = resolved_block(t);
    store_visibility(p, vec2(result(p, v.x), result(p + x, v.y)));
    store_visibility(p + y, vec2(result(p + y, v.z), result(p + x + y, v.w)));
}
