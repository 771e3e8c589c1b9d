// Luna's SSAO: fourteen evenly spread vectors, reflected at a random one and flipped above the surface. The depth at their ends
// occludes by its distance in front of the surface and its elevation above it.
//
// Luna, "Introduction to 3D Game Programming with DirectX 12", chapter 21 (2016). Departures, off with `published`: the
// random vector is unit, so that a reflection is one and the radius is respected; what is seen is where its pixel's centre
// is, not where the vector crossed it; behind the camera and outside the image nothing is known.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/point_samples.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_published) const int published = 0;
layout(constant_id = spec_renormalise) const int renormalise = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 3, rgba32f) readonly uniform imageBuffer vectors; // set after set, each vector with its final length
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { LunaConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "lib/points.glsl"

vec3 random_vector(vec2 noise) {
    if (published != 0) return 2.0 * vec3(noise, fract(noise.x * 61.0 + noise.y * 37.0)) - 1.0;
    float height = 1.0 - 2.0 * noise.x, side = sqrt(positive(1.0 - height * height)), phi = 6.2831853 * noise.y;
    return vec3(side * cos(phi), side * sin(phi), height);
}

void main() {
    LunaConstants l = constants;
    k = l.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);
    float epsilon = l.epsilon + k.tangent_sigmas * sigma_of(s.point.z), fade = 1.0 / (l.fade_to - l.fade_from);

    float occlusion = 0.0, known = 0.0;
    int set = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        vec3 mirror = random_vector(noise);
        noise = fract(noise + vec2(0.7548776662, 0.5698402910));
        int i = 0;
        do {
            vec3 v = imageLoad(vectors, set * l.count + i).xyz;
            vec3 a = v - 2.0 * mirror * dot(mirror, v);
            a *= dot(a, s.normal) < 0.0 ? -1.0 : 1.0;
            vec3 q = s.point + k.radius * a;
            Seen seen = seen_at(q);
            vec3 apart = (published != 0 ? q * (seen.z / q.z) : seen.point) - s.point;
            float away2 = dot(apart, apart);
            float facing = away2 > 1e-12 ? positive(dot(s.normal, apart) * (quick_scale * quick_inversesqrt(away2 + 1e-20))) : 0.0;
            float in_front = -apart.z;
            float near = in_front > epsilon ? clamp((l.fade_to - in_front) * fade, 0.0, 1.0) : 0.0;
            occlusion += seen.known ? facing * near : 0.0;
            known += seen.known ? 1.0 : 0.0;
        } while (++i < l.count);
    } while (++set < l.sets);
    float share = 1.0 / float(l.sets * l.count);
    known *= share;
    occlusion *= renormalise != 0 ? share / max(known, 0.5) : share;
    finish(s, !(z > 0.0), here, 1.0 - occlusion);
}
