// Last pass of the screen-space methods: a 5x5 mean over the pixels of the same plane, then the tone curve. 2x2 pixels a thread,
// because they share most of what they read.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/screen.glsl"
#include "lib/cheap.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_denoise) const int denoise = 1;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 1, r32f) readonly uniform imageBuffer raw;
layout(binding = 16, scalar) writeonly buffer Visibility { float visibility[]; };
layout(binding = 32, scalar) uniform Constants { ScreenConstants constants; };

struct Mean {
    vec3 normal_over_tolerance; // a plane's distances then come in tolerances
    float at;                   // of the pixel's own point along it
    vec3 normal;
    float sum, weight;
};

struct Tap {
    vec3 point, normal; // normal zero where nothing is known
    float value;
};

Tap tap_at(ivec2 p) {
    bool known = inside(p);
    int i = known ? index_of(p) : 0;
    vec4 surface = imageLoad(surfaces, i);
    return Tap(ray_of(vec2(p)) * surface.w, known ? surface.xyz : vec3(0.0), imageLoad(raw, i).x);
}

Mean mean_about(Tap centre) {
    float tolerance = 0.05 * k.radius + 3.0 * sigma_of(centre.point.z);
    vec3 n = centre.normal / tolerance;
    return Mean(n, dot(n, centre.point), centre.normal, centre.value, 1.0);
}

void add(inout Mean mean, Tap tap) {
    float distance = dot(mean.normal_over_tolerance, tap.point) - mean.at;
    float cosine = positive(dot(mean.normal, tap.normal));
    cosine *= cosine;
    float weight = positive(1.0 - distance * distance) * (cosine * cosine);
    mean.sum += weight * tap.value;
    mean.weight += weight;
}

void put(ivec2 p, Tap centre, Mean mean) {
    if (!inside(p)) return;
    bool hole = !(centre.point.z > 0.0);
    visibility[index_of(p)] = hole ? uintBitsToFloat(not_a_number) : shown(mean.sum / mean.weight);
}

// One tap for those of the four pixels that have it in their window; none is its own neighbour.
#define TAP(x, y) { Tap t = tap_at(p + ivec2(x, y)); \
    if (x <= 2 && y <= 2) add(a, t); \
    if (x >= -1 && y <= 2) add(b, t); \
    if (x <= 2 && y >= -1) add(c, t); \
    if (x >= -1 && y >= -1) add(d, t); }
#define ROW(y) TAP(-2, y) TAP(-1, y) TAP(0, y) TAP(1, y) TAP(2, y) TAP(3, y)
#define OUTER(y) TAP(-2, y) TAP(-1, y) TAP(2, y) TAP(3, y)

void main() {
    k = constants;
    ivec2 p = 2 * ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    Tap ta = tap_at(p), tb = tap_at(p + ivec2(1, 0)), tc = tap_at(p + ivec2(0, 1)), td = tap_at(p + ivec2(1, 1));
    Mean a = mean_about(ta), b = mean_about(tb), c = mean_about(tc), d = mean_about(td);
    if (denoise != 0) {
        ROW(-2) ROW(-1) OUTER(0) OUTER(1) ROW(2) ROW(3)
        add(a, tb); add(a, tc); add(a, td);
        add(b, ta); add(b, tc); add(b, td);
        add(c, ta); add(c, tb); add(c, td);
        add(d, ta); add(d, tb); add(d, tc);
    }
    put(p, ta, a);
    put(p + ivec2(1, 0), tb, b);
    put(p + ivec2(0, 1), tc, c);
    put(p + ivec2(1, 1), td, d);
}
