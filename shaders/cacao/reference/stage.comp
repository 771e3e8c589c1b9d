// CACAO `reference`, first half of upsampling (U, section 8.9): one AO value and one depth per pixel of the half-size grid, with a halo of
// two. AMD's shader does this in shared memory; its behaviour outside the image is kept.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"
#include "cacao/reference/resolve.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 1, r32f) readonly uniform imageBuffer depths;
layout(binding = 16, rg32f) uniform writeonly imageBuffer staged;

const int wrapped = 1 << 24; // stands for an unsigned coordinate that wrapped below zero

bool in_slice(ivec2 t) { return all(greaterThanEqual(t, ivec2(0))) && all(lessThan(t, k.slice)); }
float depth_or_zero(int slice, ivec2 t) { return in_slice(t) ? imageLoad(depths, depth_index(slice, 0, t)).x : 0.0; }
float texel_clamped(int slice, ivec2 t) { return ao_value(imageLoad(ao, slice_index(slice, clamp(t, ivec2(0), k.slice - 1))).x); }

// The tie of the slice 3 sample on even columns and rows, as lavapipe's arithmetic breaks it.
int tie(int x, float r, int size) {
    precise float a = (float(x) + 0.5) * r;
    precise float b = 0.5 * r;
    precise float c = a - b;
    precise float t = c * float(size);
    return int(floor(t));
}
ivec2 corner_tie(ivec2 t) { return ivec2(tie(t.x, k.slice_inv.x, k.slice.x), tie(t.y, k.slice_inv.y, k.slice.y)); }

// U-plain and U-half.
vec2 plain_staged(ivec2 h, ivec2 parity, ivec2 t) {
    float sum = 0.0;
    if (resolve == resolve_half) {
        ivec2 s0 = t + parity;
        ivec2 s3 = parity == ivec2(0) ? corner_tie(t) : t;
        return vec2(0.5 * (texel_clamped(0, s0) + texel_clamped(3, s3)), depth_or_zero(3 * parity.y, t));
    }
    for (int n = 0; n < 4; ++n) { // forward 2x2 box
        ivec2 p = h + ivec2(n & 1, n >> 1);
        ivec2 q = p >> 1;
        if (n == 3 && parity == ivec2(0)) q = corner_tie(t);
        sum += texel_clamped((p.x & 1) + 2 * (p.y & 1), q);
    }
    return vec2(0.25 * sum, depth_or_zero(parity.x + 2 * parity.y, t));
}

// U-smart.
vec2 smart_staged(ivec2 h, ivec2 parity, ivec2 seen) {
    ivec2 t = ivec2(h.x == -1 ? 0 : h.x >> 1, h.y >> 1); // column -1 reads column 1: its remainder is floored, its half wraps
    bool known = in_slice(t) && h.y >= 0;
    uint c = known ? imageLoad(ao, slice_index(parity.x + 2 * parity.y, t)).x : 0u;
    float v = smart(c, vec2(seen), parity);
    return vec2(v, depth_or_zero(parity.x + 2 * parity.y, ivec2((h.x + 1) >> 1, h.y >> 1))); // one column too far, as in AMD's
}

// AO and depth of grid pixel h.
vec2 staged_of(ivec2 h) {
    ivec2 parity = h & 1;
    ivec2 seen = ivec2(h.x < 0 ? wrapped + h.x : h.x, h.y < 0 ? wrapped + h.y : h.y);
    vec2 v = resolve == resolve_smart ? smart_staged(h, parity, seen) : plain_staged(seen, parity, seen >> 1);
    if (any(lessThan(h, ivec2(0))) && resolve != resolve_smart) v.y = 0.0;
    return vec2(half_even(v.x), v.y);
}

// 2x2 grid pixels a thread, from the halo on.
void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy) - 1;
    if (any(greaterThanEqual(2 * t, k.grid - 2))) return;
    for (int slice = 0; slice < 4; ++slice) {
        ivec2 h = 2 * t + parity_of(slice), g = h + 2;
        vec2 v = staged_of(h);
        if (all(lessThan(g, k.grid))) imageStore(staged, g.y * k.grid.x + g.x, vec4(v, 0.0, 0.0));
    }
}
