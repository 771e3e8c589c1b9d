// CACAO `reference`, second half of upsampling (U, section 8.9): 5x5 bilateral filter of the staged grid by distance and depth, 2x2 image
// pixels a thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"
#include "cacao/out.glsl"

layout(local_size_x = cacao_row) in;
layout(constant_id = spec_resolve) const int resolve = resolve_smart;
layout(constant_id = spec_power) const int power = 0;
layout(binding = 0, rg32f) readonly uniform imageBuffer staged;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;

const float self_weight = 1e-3;

float full_depth(ivec2 p) {
    return any(greaterThanEqual(p, k.image)) ? k.outside_depth : depth_from(imageLoad(depth_in, p.y * k.image.x + p.x).x);
}

// U-half runs in binary16 throughout; every operation is rounded here.
float filtered_in_half(ivec2 g, vec2 shift, float zf) {
    const float c = -half_even(1.44269504);
    float rs = half_even(1.0 / half_even(k.sigma_spatial)), rd = half_even(1.0 / half_even(k.sigma_depth));
    float total = half_even(self_weight);
    float sum = half_even(total * imageLoad(staged, g.y * k.grid.x + g.x).x);
    zf = half_even(zf);
    for (int p = -2; p <= 2; ++p)
        for (int r = -2; r <= 2; ++r) {
            vec2 s = imageLoad(staged, (g.y + r) * k.grid.x + g.x + p).xy;
            vec2 d = vec2(p, r) - shift;
            float dz = half_even(zf - s.y);
            float a = half_even(half_even(half_even(d.x * d.x + d.y * d.y) * c) * rs);
            float b = half_even(half_even(half_even(dz * dz) * c) * rd);
            float w = half_even(exp2(half_even(a + b)));
            sum = half_even(sum + half_even(w * s.x));
            total = half_even(total + w);
        }
    return half_even(sum / total);
}

// U-plain and U-smart.
float gaussian(ivec2 g, vec2 shift, float zf) {
    float total = self_weight;
    float sum = total * imageLoad(staged, g.y * k.grid.x + g.x).x;
    for (int p = -2; p <= 2; ++p)
        for (int r = -2; r <= 2; ++r) {
            vec2 s = imageLoad(staged, (g.y + r) * k.grid.x + g.x + p).xy;
            vec2 d = vec2(p, r) - shift;
            float dz = zf - s.y;
            float w = exp(-dot(d, d) / k.sigma_spatial) * exp(-dz * dz / k.sigma_depth);
            sum += w * s.x;
            total += w;
        }
    return sum / total;
}

// Pixel p; it lies  from grid pixel g.
float result(ivec2 p, ivec2 g, vec2 shift) {
    float zf = full_depth(p);
    float v = resolve == resolve_half ? filtered_in_half(g, shift, zf) : gaussian(g, shift, zf);
    return stored(power != 0 ? pow(v, 2.2) : v);
}

void main() {
    k = constants;
    ivec2 h = ivec2(gl_GlobalInvocationID.xy);
    ivec2 p = 2 * h, g = h + 2;
    if (any(greaterThanEqual(p, k.image))) return;
    const ivec2 x = ivec2(1, 0), y = ivec2(0, 1);
    vec4 v = vec4(result(p, g, vec2(0.0)), result(p + x, g, vec2(0.5, 0.0)), result(p + y, g, vec2(0.0, 0.5)), result(p + x + y, g, vec2(0.5)));
    store_visibility(p, v.xy); // stored after all reads, because the four pixels share them
    store_visibility(p + y, v.zw);
}
