// CACAO `reference`, what apply and stage share (section 8.8): filtered reads of the slices, and A-smart.
#include "cacao/filter.glsl"

layout(constant_id = spec_resolve) const int resolve = resolve_smart;
layout(binding = 0, r32ui) readonly uniform uimageBuffer ao;

// S: bilinear read of one slice at slice-texel coordinates (centres at one half).
float slice_filtered(int slice, vec2 at) {
    Footprint f = footprint(filter_coordinate(at * k.slice_inv, k.slice), k.slice);
    return filtered(f, imageLoad(ao, slice_index(slice, f.low)).x & 0xffffu, imageLoad(ao, slice_index(slice, ivec2(f.high.x, f.low.y))).x & 0xffffu,
                    imageLoad(ao, slice_index(slice, ivec2(f.low.x, f.high.y))).x & 0xffffu, imageLoad(ao, slice_index(slice, f.high)).x & 0xffffu);
}

// Own texel plus one filtered value from each other slice, pulled away from edges. `at` is the grid pixel as AMD's shader sees it:
// coordinates left of or above the image wrap round to a huge number. `parity` is its slice.
float smart(uint texel, vec2 at, ivec2 parity) {
    vec4 e = unpack_edges(ao_edges(texel));
    vec2 pull = vec2(e.y - e.x, e.w - e.z);
    vec2 m = vec2(parity);
    ivec2 other = 1 - parity;
    float h = slice_filtered(other.x + 2 * parity.y, vec2(at.x + m.x + pull.x - 0.5, at.y + 0.5 - m.y) * 0.5);
    float v = slice_filtered(parity.x + 2 * other.y, vec2(at.x + 0.5 - m.x, at.y + m.y + pull.y - 0.5) * 0.5);
    float d = slice_filtered(other.x + 2 * other.y, (at + m + pull - 0.5) * 0.5);
    float wh = (e.x + e.y) * 0.5, wv = (e.z + e.w) * 0.5, wd = (wh + wv) * 0.5;
    return (ao_value(texel) + wh * h + wv * v + wd * d) / (1.0 + wh + wv + wd);
}
