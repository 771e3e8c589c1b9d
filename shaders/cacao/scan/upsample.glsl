// CACAO `scan`, second half of upsampling (section 8.9): 5x5 bilateral filter of the staged grid by distance and depth, 2x2 image pixels a
// thread. The includer has main() and staged_at().
#include "cacao/scan/scan.glsl"
#include "cacao/out.glsl"

layout(binding = 0, rg32f) readonly uniform imageBuffer staged;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;

// Value and depth of a grid pixel. `at` is an index of the includer's, as passed to upsample_pixels().
vec2 staged_at(int at);

// Four pixels share each tap. (1 - x / 4)^4 stands for exp(-x): it needs no exponential, and is 0 beyond two sigma. Depths are
// in units of 2 sigma.
struct Four {
    vec4 z, sum, total;
    float unit; // 1 / (2 sigma)
};

void tap(inout Four four, int at, vec2 gx) {
    vec2 s = staged_at(at);
    vec4 dz = four.z - (s.y > 0.0 ? s.y * four.unit : 1e9); // holes are far from any depth
    vec4 w = clamp(1.0 - dz * dz, 0.0, 1.0);
    w *= w;
    w *= w * gx.xyxy;
    four.sum += w * s.x;
    four.total += w;
}

// Spatial weights of tap i - 2, for even and odd pixels.
#define GX(i) vec2(k.spatial[i], k.spatial[5 + i])
void row(inout Four four, int at, vec2 gy) {
    Four part = Four(four.z, vec4(0.0), vec4(0.0), four.unit);
    tap(part, at - 2, GX(0));
    tap(part, at - 1, GX(1));
    tap(part, at, GX(2));
    tap(part, at + 1, GX(3));
    tap(part, at + 2, GX(4));
    four.sum += part.sum * gy.xxyy;
    four.total += part.total * gy.xxyy;
}

// Visibilities of four pixels at depths z, around the grid pixel `at`.
vec4 upsampled(int at, int row_length, vec4 z) {
    const float self_weight = 1e-3;
    vec2 own = staged_at(at);
    float known = own.y > 0.0 ? self_weight : 0.0, unit = 0.5 * inversesqrt(k.sigma_depth);
    Four four = Four(z * unit, vec4(known * own.x), vec4(known), unit);
    row(four, at - 2 * row_length, GX(0));
    row(four, at - row_length, GX(1));
    row(four, at, GX(2));
    row(four, at + row_length, GX(3));
    row(four, at + 2 * row_length, GX(4));
    return mix(vec4(1.0), four.sum / max(four.total, 1e-12), greaterThan(four.total, vec4(0.0)));
}

float full_depth(ivec2 p) {
    if (any(greaterThanEqual(p, k.image))) return 0.0;
    return depth_from(imageLoad(depth_in, p.y * k.image.x + p.x).x);
}

// Pixels 2h + (0 or 1, 0 or 1).
void upsample_pixels(ivec2 h, int at, int row_length) {
    ivec2 p = 2 * h;
    if (any(greaterThanEqual(p, k.image))) return;
    const ivec2 x = ivec2(1, 0), y = ivec2(0, 1);
    vec4 z = vec4(full_depth(p), full_depth(p + x), full_depth(p + y), full_depth(p + x + y));
    vec4 v = upsampled(at, row_length, z);
    store_visibility(p, vec2(or_unknown(v.x, z.x > 0.0), or_unknown(v.y, z.y > 0.0)));
    store_visibility(p + y, vec2(or_unknown(v.z, z.z > 0.0), or_unknown(v.w, z.w > 0.0)));
}
