// The mean visibility of a surface over several frames. Each pixel's point is looked up in every frame that saw it, weighted by
// the quality of that view. No value is averaged twice, so results do not blur or drift.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/gather.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"
#include "lib/neighbour.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer own_surfaces;
layout(binding = 1, r32f) readonly uniform imageBuffer own_visibility;
layout(binding = 2, rg32ui) readonly uniform uimageBuffer surfaces;  // of each frame, one after the other
layout(binding = 3, r32f) readonly uniform imageBuffer visibilities; // likewise
layout(binding = 16, scalar) writeonly buffer Means { float means[]; };
layout(binding = 17, scalar) writeonly buffer Spread { vec2 spread[]; }; // how many frames, in those as good as this one; deviation
layout(binding = 32, scalar) uniform Constants { GatherConstants constants; };

#include "lib/surfel.glsl"

// What the view of a point is worth: of a steep one little, and little at the border, near which its surroundings are unknown.
float worth(vec3 point, vec3 n, vec2 at) {
    float cosine = dot(n, point) * inversesqrt(dot(point, point));
    vec2 room = min(at, vec2(k.window) - 1.0 - at);
    float radius_px = k.radius * k.camera.fx / point.z;
    return max(cosine * cosine, 0.02) * clamp(2.0 * min(room.x, room.y) / radius_px, 0.05, 1.0);
}

// A pixel, and the sums of what was found for it.
struct Mean {
    vec3 point, n;
    float v, z, narrow, own, weights, sum, squares;
};

Mean mean_at(ivec2 p) {
    int here = index_of(p);
    uvec2 word = imageLoad(own_surfaces, here).xy;
    float v = imageLoad(own_visibility, here).x, z = uintBitsToFloat(word.x);
    z = z > 0.0 ? z : 1.0;
    vec3 point = ray_of(vec2(p)) * z, n = vec3(bytes_of_normal(word.y)) * (1.0 / 127.0);
    float narrow = 1.0 / (constants.tolerance + constants.tolerance_per_z * z + 3.0 * 1.414 * sigma_of(z));
    float own = worth(point, n, vec2(p));
    return Mean(point, n, v, z, narrow, own, own, own * v, own * v * v);
}

void add(inout Mean mean, int i, NeighbourPlace place) {
    vec3 there = point_there(mean.point, place), turned = turned_there(mean.n, place);
    vec2 at;
    bool sees = seen_there(there, place, k.window, at);
    int index = index_there(i, at, k.window, sees);
    uvec2 other = imageLoad(surfaces, index).xy;
    vec3 met = ray_there(vec2(nearest(at.x), nearest(at.y)), place) * uintBitsToFloat(other.x);
    vec3 normal = vec3(bytes_of_normal(other.y)) * (1.0 / 127.0);
    float apart = dot(turned, met - there) * mean.narrow;
    float then = imageLoad(visibilities, index).x;
    float closer = at_most_one(mean.z * mean.z / (there.z * there.z));
    float weight = positive(1.0 - apart * apart) * worth(there, turned, at) * closer;
    bool same = sees && met.z > 0.0 && dot(turned, normal) > 0.7 && then >= 0.0;
    weight = same ? weight : 0.0;
    then = same ? then : 0.0;
    mean.weights += weight;
    mean.sum += weight * then;
    mean.squares += weight * then * then;
}

void put(ivec2 p, Mean mean) {
    if (p.y >= k.size.y) return;
    int here = index_of(p);
    bool hole = !(mean.v >= 0.0);
    float m = mean.sum / mean.weights, variance = positive(mean.squares / mean.weights - m * m);
    float none = uintBitsToFloat(not_a_number);
    means[here] = hole ? none : m;
    spread[here] = hole ? vec2(none) : vec2(mean.weights / mean.own, sqrt(variance));
}

void main() {
    k = constants.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy) * ivec2(1, gathered_rows), last = k.size - 1;
    if (any(greaterThan(p, last))) return;
    Mean a = mean_at(p), b = mean_at(min(p + ivec2(0, 1), last)), c = mean_at(min(p + ivec2(0, 2), last)), d = mean_at(min(p + ivec2(0, 3), last));
    int i = 0;
    do {
        NeighbourPlace place = constants.places[i];
        add(a, i, place);
        add(b, i, place);
        add(c, i, place);
        add(d, i, place);
    } while (++i < constants.frames);
    put(p, a);
    put(p + ivec2(0, 1), b);
    put(p + ivec2(0, 2), c);
    put(p + ivec2(0, 3), d);
}
