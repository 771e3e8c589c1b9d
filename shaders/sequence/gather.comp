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
layout(binding = 16, scalar) writeonly buffer Mean { float mean[]; };
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

void main() {
    k = constants.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (!inside(p)) return;
    int here = index_of(p);
    uvec2 word = imageLoad(own_surfaces, here).xy;
    float v = imageLoad(own_visibility, here).x, z = uintBitsToFloat(word.x);
    bool hole = !(v >= 0.0);
    z = z > 0.0 ? z : 1.0;
    vec3 point = ray_of(vec2(p)) * z, n = vec3(bytes_of_normal(word.y)) * (1.0 / 127.0);
    float narrow = 1.0 / (constants.tolerance + constants.tolerance_per_z * z + 3.0 * 1.414 * sigma_of(z));
    float own = worth(point, n, vec2(p));
    float weights = own, sum = own * v, squares = own * v * v;
    int i = 0;
    do {
        NeighbourPlace place = constants.places[i];
        vec3 there = point_there(point, place), turned = turned_there(n, place);
        vec2 at;
        bool sees = seen_there(there, place, k.window, at);
        int index = index_there(i, at, k.window, sees);
        uvec2 other = imageLoad(surfaces, index).xy;
        vec3 met = ray_there(vec2(nearest(at.x), nearest(at.y)), place) * uintBitsToFloat(other.x);
        vec3 normal = vec3(bytes_of_normal(other.y)) * (1.0 / 127.0);
        float apart = dot(turned, met - there) * narrow;
        float then = imageLoad(visibilities, index).x;
        float closer = at_most_one(z * z / (there.z * there.z));
        float weight = positive(1.0 - apart * apart) * worth(there, turned, at) * closer;
        bool same = sees && met.z > 0.0 && dot(turned, normal) > 0.7 && then >= 0.0;
        weight = same ? weight : 0.0;
        then = same ? then : 0.0;
        weights += weight;
        sum += weight * then;
        squares += weight * then * then;
    } while (++i < constants.frames);
    float m = sum / weights, variance = positive(squares / weights - m * m);
    float none = uintBitsToFloat(not_a_number);
    mean[here] = hole ? none : m;
    spread[here] = hole ? vec2(none) : vec2(weights / own, sqrt(variance));
}
