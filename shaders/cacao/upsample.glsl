// CACAO upsampling, second half: 5x5 bilateral filter of the staged grid by distance and depth, 2x2 image pixels a thread.
#include "lib/cacao.glsl"

#ifdef FOR_GPU
layout(local_size_x = cacao_tile, local_size_y = cacao_tile) in;
#else
layout(local_size_x = cacao_row) in;
#endif
layout(constant_id = spec_resolve) const int resolve = resolve_smart;
layout(constant_id = spec_power) const int power = 0;
layout(constant_id = spec_device_depth) const int device_depth = 0;
layout(binding = 0, rg32f) readonly uniform imageBuffer staged;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;
#include "lib/cacao_out.glsl"

const float self_weight = 1e-3;

float full_depth(ivec2 p) {
    if (any(greaterThanEqual(p, k.image))) return k.outside_depth;
    float d = imageLoad(depth_in, p.y * k.image.x + p.x).x;
    return device_depth != 0 ? linear_depth(d) : d;
}

// AMD's LOWEST runs in binary16 throughout; every operation is rounded here.
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

#ifdef FOR_GPU // the 25 taps of neighbours overlap: through shared memory
const int tile = cacao_tile, wide = tile + 4;
shared vec2 near[wide * wide];
vec2 staged_at(int at) { return near[at]; }
int staged_row() { return wide; }

// Grid pixels round the work group's; returns where the thread's own one lies.
int load_staged() {
    ivec2 first = tile * ivec2(gl_WorkGroupID.xy);
    for (int i = int(gl_LocalInvocationIndex); i < wide * wide; i += tile * tile) {
        ivec2 g = first + ivec2(i % wide, i / wide);
        near[i] = all(lessThan(g, k.grid)) ? imageLoad(staged, g.y * k.grid.x + g.x).xy : vec2(0.0);
    }
    barrier();
    return (int(gl_LocalInvocationID.y) + 2) * wide + int(gl_LocalInvocationID.x) + 2;
}
#else
vec2 staged_at(int at) { return imageLoad(staged, at).xy; }
int staged_row() { return k.grid.x; }
int load_staged() { return (int(gl_GlobalInvocationID.y) + 2) * k.grid.x + int(gl_GlobalInvocationID.x) + 2; }
#endif

// Scan: four pixels share each tap. (1 - x / 4)^4 stands for exp(-x): no exponential, and nothing beyond two sigma. Depths are
// in units of 2 sigma.
struct Four {
    vec4 z, sum, total;
    float unit; // 1 / (2 sigma)
};

void tap(inout Four four, int at, vec2 gx) {
    vec2 s = staged_at(at);
    vec4 dz = four.z - (s.y > 0.0 ? s.y * four.unit : 1e9); // holes lie far off
    vec4 w = clamp(1.0 - dz * dz, 0.0, 1.0);
    w *= w;
    w *= w * gx.xyxy;
    four.sum += w * s.x;
    four.total += w;
}

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

vec4 upsampled(int at, vec4 z) {
    int step = staged_row();
    vec2 own = staged_at(at);
    float known = own.y > 0.0 ? self_weight : 0.0, unit = 0.5 * inversesqrt(k.sigma_depth);
    Four four = Four(z * unit, vec4(known * own.x), vec4(known), unit);
    row(four, at - 2 * step, GX(0));
    row(four, at - step, GX(1));
    row(four, at, GX(2));
    row(four, at + step, GX(3));
    row(four, at + 2 * step, GX(4));
    return mix(vec4(1.0), four.sum / max(four.total, 1e-12), greaterThan(four.total, vec4(0.0)));
}

float result(float zf, float v) { return scan != 0 ? or_unknown(v, zf > 0.0) : stored(power != 0 ? pow(v, 2.2) : v); }

float reference(ivec2 g, vec2 shift, float zf) {
    return resolve == resolve_half ? filtered_in_half(g, shift, zf) : gaussian(g, shift, zf);
}

void main() {
    k = constants;
    ivec2 h = ivec2(gl_GlobalInvocationID.xy);
    ivec2 p = 2 * h, g = h + 2;
    int at = load_staged();
    if (any(greaterThanEqual(p, k.image))) return;
    const ivec2 x = ivec2(1, 0), y = ivec2(0, 1);
    vec4 z = vec4(full_depth(p), full_depth(p + x), full_depth(p + y), full_depth(p + x + y));
    vec4 v;
    if (scan != 0)
        v = upsampled(at, z);
    else
        v = vec4(reference(g, vec2(0.0), z.x), reference(g, vec2(0.5, 0.0), z.y), reference(g, vec2(0.0, 0.5), z.z),
                 reference(g, vec2(0.5), z.w));
    store_visibility(p, vec2(result(z.x, v.x), result(z.y, v.y)));
    store_visibility(p + y, vec2(result(z.z, v.z), result(z.w, v.w)));
}
