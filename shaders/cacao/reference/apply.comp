// CACAO `reference`, apply (A, section 8.8): native resolution, visibility of each image pixel from the four slices.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"
#include "cacao/reference/resolve.glsl"
#include "cacao/out.glsl"

layout(local_size_x = cacao_row) in;
layout(constant_id = spec_power) const int power = 0;

// A-plain and A-half. Sums of 8-bit steps tie; their order is part of the result.
float plain(ivec2 p) {
    vec2 at = vec2(p) * k.image_inv * vec2(k.slice);
    precise float sum = slice_filtered(0, at);
    if (resolve == resolve_half) {
        sum = sum + slice_filtered(3, at);
        return 0.5 * sum;
    }
    for (int slice = 1; slice < 4; ++slice) sum = sum + slice_filtered(slice, at);
    return 0.25 * sum;
}

float result(ivec2 p) {
    float v = resolve == resolve_smart ? smart(imageLoad(ao, slice_index((p.x & 1) + 2 * (p.y & 1), p >> 1)).x, vec2(p), p & 1) : plain(p);
    return stored(power != 0 ? pow(v, 2.2) : v);
}

// 2x2 pixels a thread.
void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    ivec2 p = 2 * t;
    const ivec2 x = ivec2(1, 0), y = ivec2(0, 1);
    vec4 v = vec4(result(p), result(p + x), result(p + y), result(p + x + y));
    store_visibility(p, v.xy);
    store_visibility(p + y, v.zw);
}
