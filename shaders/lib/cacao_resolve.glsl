// CACAO resolve: one AO value per grid pixel out of the four slices. Include after the buffer `ao` is declared.
#include "lib/cacao_filter.glsl"

// Reference: bilinear read of one slice at slice-texel coordinates (centres at one half).
float slice_filtered(int slice, vec2 at) {
    Footprint f = footprint(filter_coordinate(at * k.slice_inv, k.slice), k.slice);
    return filtered(f, texelFetch(ao, slice_index(slice, f.low)).x & 0xffffu, texelFetch(ao, slice_index(slice, ivec2(f.high.x, f.low.y))).x & 0xffffu,
                    texelFetch(ao, slice_index(slice, ivec2(f.low.x, f.high.y))).x & 0xffffu, texelFetch(ao, slice_index(slice, f.high)).x & 0xffffu);
}

// Reference: own texel plus one filtered value from each other slice, pulled away from edges. `at` is the grid pixel as
// AMD's shader sees it (coordinates left of or above the image wrap round to a huge number), parity its slice.
float smart_reference(float own, vec4 e, vec2 at, ivec2 parity) {
    vec2 pull = vec2(e.y - e.x, e.w - e.z);
    vec2 m = vec2(parity);
    ivec2 other = 1 - parity;
    float h = slice_filtered(other.x + 2 * parity.y, vec2(at.x + m.x + pull.x - 0.5, at.y + 0.5 - m.y) * 0.5);
    float v = slice_filtered(parity.x + 2 * other.y, vec2(at.x + 0.5 - m.x, at.y + m.y + pull.y - 0.5) * 0.5);
    float d = slice_filtered(other.x + 2 * other.y, (at + m + pull - 0.5) * 0.5);
    float wh = (e.x + e.y) * 0.5, wv = (e.z + e.w) * 0.5, wd = (wh + wv) * 0.5;
    return (own + wh * h + wv * v + wd * d) / (1.0 + wh + wv + wd);
}

uint grid_texel(ivec2 p) { return texelFetch(ao, slice_index((p.x & 1) + 2 * (p.y & 1), p >> 1)).x; }
bool in_grid(ivec2 p) { return all(greaterThanEqual(p, ivec2(0))) && all(lessThan(p, 2 * k.slice)); }

// Scan: the same weights centred on the pixel: neighbours left/right, above/below and diagonal, holes left out.
// Returns value and 1, or 0 and 0 at a hole.
vec2 smart_scan(ivec2 p) {
    uint c = grid_texel(p);
    if (is_hole(c)) return vec2(0.0);
    vec4 e = unpack_edges(ao_edges(c));
    float sum = ao_value(c), total = 1.0;
    vec2 pull = vec2(e.y - e.x, e.w - e.z);
    vec2 near = 0.5 - 0.5 * pull, far = 0.5 + 0.5 * pull; // shares of left/top and right/bottom
    float wh = (e.x + e.y) * 0.5, wv = (e.z + e.w) * 0.5, wd = (wh + wv) * 0.5;
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
            if (i == 0 && j == 0) continue;
            ivec2 q = p + ivec2(i, j);
            float w = (i == 0 ? 1.0 : i < 0 ? near.x : far.x) * (j == 0 ? 1.0 : j < 0 ? near.y : far.y);
            w *= j == 0 ? wh : i == 0 ? wv : wd;
            uint n = in_grid(q) ? grid_texel(q) : hole_texel;
            if (is_hole(n)) w = 0.0;
            sum += w * ao_value(n);
            total += w;
        }
    return vec2(sum / total, 1.0);
}

// Scan, LOW and LOWEST: mean of the 2x2 (LOW: tent of 3x3) grid pixels that exist and lie on no other surface cannot be
// told without edges; so the mean of the known pixels of the block.
vec2 plain_scan(ivec2 p) {
    bool half_grid = two_slices != 0;
    bool written = !half_grid || (p.x & 1) == (p.y & 1);
    float sum = 0.0, total = 0.0;
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) {
            ivec2 q = p + ivec2(i, j);
            if (!in_grid(q) || (half_grid && (q.x & 1) != (q.y & 1))) continue;
            uint n = grid_texel(q);
            float w = is_hole(n) ? 0.0 : float((2 - abs(i)) * (2 - abs(j)));
            sum += w * ao_value(n);
            total += w;
        }
    return total > 0.0 ? vec2(sum / total, 1.0) : vec2(0.0);
}
