// SSDO, its visibility: a sample at a random distance along each of several directions over the surface; a direction is blocked
// where the depth image lies in front of its sample.
//
// Ritschel, Grosch, Seidel, "Approximating Dynamic Global Illumination in Image Space" (2009), section 3.1: directions uniform
// over the hemisphere, weighed by their cosine. Departures: what blocks must lie within the radius (the paper's test makes
// haloes behind the foreground) and above the surface by rule (2); directions and distances are sequences of low discrepancy.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/ssdo.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_renormalise) const int renormalise = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { SsdoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "lib/points.glsl"
#include "lib/taps.glsl"

// Of the golden angle, 2 pi 0.6180339887.
const float golden_cosine = -0.73736888, golden_sine = -0.67549029;

void main() {
    SsdoConstants c = constants;
    k = c.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);

    // Axes about the normal. They start from a coordinate axis that is never parallel to it.
    vec3 axis = abs(s.normal.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
    vec3 e1 = normalize(axis - s.normal * dot(axis, s.normal)), e2 = cross(s.normal, e1);
    vec2 direction = vec2(cos(noise.x * 6.2831853), sin(noise.x * 6.2831853));
    float inverse = 1.0 / float(c.directions);
    float length_of_first = 3.0 * noise.x + noise.y + 0.5;

    float blocked = 0.0, all = 0.0, known = 0.0;
    int i = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        float cosine = 1.0 - (float(i) + noise.x) * inverse, sine = sqrt(positive(1.0 - cosine * cosine));
        float share = fract(float(i) * 0.7548776662 + length_of_first); // lambda: of the radius, uniform as published
        vec3 q = s.point + k.radius * share * (sine * (e1 * direction.x + e2 * direction.y) + cosine * s.normal);
        Seen seen = seen_at(q);
        Tap t = tap_of(s, seen.known, seen.point);
        float slack = k.tangent_sigmas * sigma_of(q.z) + 1e-4 * q.z;
        blocked += t.counts && seen.z < q.z - slack ? cosine : 0.0;
        all += cosine;
        known += seen.known ? cosine : 0.0;
        direction = turned_by(direction, golden_cosine, golden_sine);
    } while (++i < c.directions);
    all = max(renormalise != 0 ? max(known, 0.5 * all) : all, 1e-6);
    finish(s, !(z > 0.0), here, 1.0 - blocked / all);
}
