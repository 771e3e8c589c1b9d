// CACAO apply, native resolution: visibility of each image pixel from the four slices.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"

layout(local_size_x = cacao_row) in;
layout(constant_id = spec_resolve) const int resolve = resolve_smart;
layout(constant_id = spec_power) const int power = 0;
layout(binding = 0, r32ui) readonly uniform uimageBuffer ao;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;
#include "lib/cacao_out.glsl"

Texel texel_or_hole(int slice, ivec2 t) {
    bool inside = all(lessThan(uvec2(t), uvec2(k.slice)));
    uint texel = imageLoad(ao, inside ? slice_index(slice, t) : 0).x;
    return Texel(inside && texel < hole_texel ? float(texel & 0xffffu) : -1.0, texel >> 16);
}
#include "lib/cacao_resolve.glsl"
#include "lib/cacao_resolve_reference.glsl"

float reference(ivec2 p) {
    if (resolve == resolve_smart) {
        ivec2 parity = p & 1;
        uint c = grid_texel(p);
        return smart_reference(ao_value(c), unpack_edges(ao_edges(c)), vec2(p), parity);
    }
    vec2 at = vec2(p) * k.image_inv * vec2(k.slice);
    precise float sum = slice_filtered(0, at); // sums of 8-bit steps tie; their order is part of the result
    if (resolve == resolve_half) {
        sum = sum + slice_filtered(3, at);
        return 0.5 * sum;
    }
    for (int slice = 1; slice < 4; ++slice) sum = sum + slice_filtered(slice, at);
    return 0.25 * sum;
}

float result(ivec2 p, float v) {
    if (scan == 0) return stored(power != 0 ? pow(v, 2.2) : v);
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
    vec4 v = scan != 0 ? resolved_block(t) : vec4(reference(p), reference(p + x), reference(p + y), reference(p + x + y));
    store_visibility(p, vec2(result(p, v.x), result(p + x, v.y)));
    store_visibility(p + y, vec2(result(p + y, v.z), result(p + x + y, v.w)));
}
