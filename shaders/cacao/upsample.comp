// CACAO upsampling, second half: 5x5 bilateral filter of the staged grid by distance and depth, 2x2 image pixels a thread.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(constant_id = spec_resolve) const int resolve = resolve_smart;
layout(constant_id = spec_power) const int power = 0;
layout(constant_id = spec_device_depth) const int device_depth = 0;
layout(binding = 0) uniform samplerBuffer staged;
layout(binding = 1) uniform samplerBuffer depth_in;
layout(binding = 16, scalar) writeonly buffer Out { float visibility[]; };

const float self_weight = 1e-3;

float full_depth(ivec2 p) {
    if (any(greaterThanEqual(p, k.image))) return k.outside_depth;
    float d = texelFetch(depth_in, p.y * k.image.x + p.x).x;
    return device_depth != 0 ? linear_depth(d) : d;
}

// AMD's LOWEST runs in binary16 throughout; every operation is rounded here.
float filtered_in_half(ivec2 g, vec2 shift, float zf) {
    const float c = -half_even(1.44269504);
    float rs = half_even(1.0 / half_even(k.sigma_spatial)), rd = half_even(1.0 / half_even(k.sigma_depth));
    float total = half_even(self_weight);
    float sum = half_even(total * texelFetch(staged, g.y * k.grid.x + g.x).x);
    zf = half_even(zf);
    for (int p = -2; p <= 2; ++p)
        for (int r = -2; r <= 2; ++r) {
            vec2 s = texelFetch(staged, (g.y + r) * k.grid.x + g.x + p).xy;
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

float filtered_value(ivec2 g, vec2 shift, float zf) {
    float sigma_depth = k.sigma_depth;
    vec2 own = texelFetch(staged, g.y * k.grid.x + g.x).xy;
    float total = scan != 0 && !(own.y > 0.0) ? 0.0 : self_weight;
    float sum = total * own.x;
    for (int p = -2; p <= 2; ++p)
        for (int r = -2; r <= 2; ++r) {
            vec2 s = texelFetch(staged, (g.y + r) * k.grid.x + g.x + p).xy;
            vec2 d = vec2(p, r) - shift;
            float dz = zf - s.y;
            float w = exp(-dot(d, d) / k.sigma_spatial) * exp(-dz * dz / sigma_depth);
            if (scan != 0) w = s.y > 0.0 ? w : 0.0;
            sum += w * s.x;
            total += w;
        }
    return sum / total;
}

void main() {
    ivec2 h = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(2 * h, k.image))) return;
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i) {
            ivec2 p = 2 * h + ivec2(i, j);
            if (any(greaterThanEqual(p, k.image))) continue;
            float zf = full_depth(p);
            int here = p.y * k.image.x + p.x;
            vec2 shift = vec2(i, j) * 0.5;
            if (scan != 0 && !(zf > 0.0)) {
                visibility[here] = uintBitsToFloat(0x7fc00000u);
                continue;
            }
            float v = scan == 0 && resolve == resolve_half ? filtered_in_half(h + 2, shift, zf) : filtered_value(h + 2, shift, zf);
            visibility[here] = scan != 0 ? v : stored(power != 0 ? pow(v, 2.2) : v);
        }
}
