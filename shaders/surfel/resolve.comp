// Last pass of the surfel bitmask: the mean over samples of the same plane, then the tone curve. Open and whole measure
// are averaged separately, since slices that see little of the hemisphere must count less.
//
// Sixteen rotations repeat every four samples, and the window weighs each of them alike. Where only every other pixel of
// every other row was sampled, the rest is filled in here. 2x2 pixels a thread, because they share what they read.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"

layout(constant_id = spec_denoise) const int denoise = 1;
layout(constant_id = spec_spacing) const int spacing = 1;
layout(constant_id = spec_packed) const int packed = 1;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer surfels;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer sampled;
layout(binding = 16, scalar) writeonly buffer Visibility { float visibility[]; };
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

#include "lib/surfel.glsl"

ivec2 plane, samples; // sizes

struct Tap {
    vec3 point, normal; // both zero where nothing is known
    vec2 measure;       // open, whole
};

struct Mean {
    vec3 normal_over_tolerance; // a plane's distances then come in tolerances
    float at;                   // of the pixel's own point along it
    vec3 normal;
    vec2 sum;
};

// Normal and depth, from fewer bytes where surfels are packed.
vec4 surface_at(ivec2 p) {
    if (packed == 0) return imageLoad(surfaces, index_of(p));
    uvec2 word = imageLoad(surfels, surfel_index(p, plane)).xy;
    return vec4(vec3(bytes_of_normal(word.y)) * (1.0 / 127.0), uintBitsToFloat(word.x));
}

Tap tap_at(ivec2 q) {
    bool exists = all(lessThan(uvec2(q), uvec2(samples)));
    q = exists ? q : ivec2(0);
    ivec2 p = q * spacing + k.origin;
    vec4 surface = surface_at(p);
    float z = exists ? surface.w : 0.0;
    vec2 measure = imageLoad(sampled, q.y * samples.x + q.x).xy;
    return Tap(ray_of(vec2(p)) * z, z > 0.0 ? surface.xyz : vec3(0.0), z > 0.0 ? measure : vec2(0.0));
}

Mean mean_at(ivec2 p, out float z) {
    bool exists = inside(p);
    vec4 surface = imageLoad(surfaces, exists ? index_of(p) : 0);
    z = exists ? surface.w : 0.0;
    vec3 point = ray_of(vec2(p)) * z, n = surface.xyz;
    vec3 scaled = n / (0.05 * k.radius + 3.0 * sigma_of(z));
    return Mean(scaled, dot(scaled, point), n, vec2(0.0));
}

void add(inout Mean mean, Tap tap, float share) {
    float distance = dot(mean.normal_over_tolerance, tap.point) - mean.at;
    float cosine = positive(dot(mean.normal, tap.normal));
    cosine *= cosine;
    float apart = distance * distance;
    float weight = positive(1.0 - apart) * (cosine * cosine);
    // A pixel without a sample of its surface takes a mean weighted by nearness to its plane.
    if (spacing > 1) weight += 1e-4 / (1.0 + apart);
    mean.sum += share * weight * tap.measure;
}

void put(ivec2 p, float z, Mean mean) {
    if (!inside(p)) return;
    bool hole = !(z > 0.0);
    float v = mean.sum.y > 0.0 ? mean.sum.x / mean.sum.y : 1.0;
    visibility[index_of(p)] = hole ? uintBitsToFloat(not_a_number) : shown(clamp(v, 0.0, 1.0));
}

// Share of a sample x columns (or rows) from the first pixel's in the mean of the first and the second pixel.
float of_first(int x) { return denoise == 0 ? float(x == 0) : abs(x) == 2 ? 0.5 : abs(x) < 2 ? 1.0 : 0.0; }
float of_second(int x) {
    if (spacing == 1) return of_first(x - 1);
    return denoise == 0 ? float(x == 0) : x >= -1 && x <= 2 ? 1.0 : 0.0;
}

#define TAP(x, y) { Tap t = tap_at(q + ivec2(x, y)); \
    add(a, t, of_first(x) * of_first(y)); add(b, t, of_second(x) * of_first(y)); \
    add(c, t, of_first(x) * of_second(y)); add(d, t, of_second(x) * of_second(y)); }
#define ROW(y) TAP(-2, y) TAP(-1, y) TAP(0, y) TAP(1, y) TAP(2, y) if (spacing == 1) TAP(3, y)

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    plane = s.plane;
    samples = s.samples;
    ivec2 p = 2 * ivec2(gl_GlobalInvocationID.xy), q = p / spacing;
    if (any(greaterThanEqual(p, k.window))) return;
    p += k.origin;
    float za, zb, zc, zd;
    Mean a = mean_at(p, za), b = mean_at(p + ivec2(1, 0), zb), c = mean_at(p + ivec2(0, 1), zc), d = mean_at(p + ivec2(1, 1), zd);
    ROW(-2) ROW(-1) ROW(0) ROW(1) ROW(2)
    if (spacing == 1) { ROW(3) }
    put(p, za, a);
    put(p + ivec2(1, 0), zb, b);
    put(p + ivec2(0, 1), zc, c);
    put(p + ivec2(1, 1), zd, d);
}
