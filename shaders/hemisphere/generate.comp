// Hemisphere kernel: the share of weighted points in the half ball above the surface that are behind the depth image.
//
// The well-known tutorial form (64 points, a random turn per pixel, range check, less weight for points along the view).
// Departures, off with `published`: points are compared by their own depth, not the surface's, which darkened every slope;
// occluders within the radius count, less those on the tangent plane; the mean is over the weights, not the points.
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
layout(binding = 3, rgba32f) readonly uniform imageBuffer kernel; // tangent, bitangent, normal
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { HemisphereConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "lib/points.glsl"

void main() {
    HemisphereConstants h = constants;
    k = h.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);

    // Axes about the normal, rotated at random. They start from a coordinate axis that is never parallel to the normal.
    vec3 axis = abs(s.normal.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
    vec3 e1 = normalize(axis - s.normal * dot(axis, s.normal)), e2 = cross(s.normal, e1);
    vec2 turn = vec2(cos(noise.x * 6.2831853), sin(noise.x * 6.2831853));
    vec3 tangent = e1 * turn.x + e2 * turn.y, bitangent = cross(s.normal, tangent);
    float slack = k.tangent_sigmas * sigma_of(s.point.z) + 1e-4 * s.point.z;

    float occluded = 0.0, weights = 0.0, known = 0.0;
    int i = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        vec3 c = imageLoad(kernel, i).xyz;
        vec3 a = tangent * c.x + bitangent * c.y + s.normal * c.z, q = s.point + k.radius * a;
        Seen seen = seen_at(q);
        vec3 apart = seen.point - s.point;
        float away2 = dot(apart, apart) + 1e-20;
        bool behind = seen.z < q.z - slack && away2 <= k.radius * k.radius && rises(s, apart, away2 * quick_scale * quick_inversesqrt(away2));
        float across2 = dot(a.xy, a.xy), side = at_most_one(5.0 * quick_scale * across2 * quick_inversesqrt(across2));
        float weight = side * side * (3.0 - 2.0 * side);
        if (published != 0) behind = seen.z + h.bias < s.point.z && abs(apart.z) <= k.radius;
        occluded += seen.known && behind ? weight : 0.0;
        weights += weight;
        known += seen.known ? 1.0 : 0.0;
    } while (++i < h.count);
    known /= float(h.count);
    weights = published != 0 ? float(h.count) : max(weights, 1e-6);
    occluded /= renormalise != 0 ? weights * max(known, 0.5) : weights;
    finish(s, !(z > 0.0), here, 1.0 - occluded);
}
