// What other views saw behind this one's surfaces: up to two layers a pixel, nearest first, each clearly behind the one before
// it. Outside the image, where nothing is, the first layer is the nearest surface there.
//
// One thread a pixel of each neighbour, three rounds: the first finds how deep the first layer lies, the next whose surface
// that is, and how deep the second one lies, the last whose that is. Depth is kept as the bits of 1/z, which order as numbers
// do: the nearest is the greatest, and an empty layer 0. The order of threads changes nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"

layout(constant_id = spec_round) const int round = 0;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer neighbours;
layout(binding = 1, r32f) readonly uniform imageBuffer poses;
layout(binding = 2, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32ui) uniform uimageBuffer behind; // the first layer of all pixels, then the second
layout(binding = 17, r32ui) uniform uimageBuffer shapes; // of these, as surfels have them
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

#include "lib/depth.glsl"
#include "lib/surfel.glsl"

float pose(int neighbour, int i) { return imageLoad(poses, neighbour * neighbour_floats + i).x; }
vec3 row(int neighbour, int i) { return vec3(pose(neighbour, i), pose(neighbour, i + 1), pose(neighbour, i + 2)); }

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec3 id = ivec3(gl_GlobalInvocationID);
    if (id.z >= k.neighbours || any(greaterThanEqual(id.xy, k.window))) return;
    uvec2 word = imageLoad(neighbours, (id.z * k.window.y + id.y) * k.window.x + id.x).xy;
    float there = uintBitsToFloat(word.x);
    vec3 point = vec3(vec2(id.xy) * vec2(pose(id.z, 12), pose(id.z, 13)) + vec2(pose(id.z, 14), pose(id.z, 15)), 1.0) * there;
    mat3 turn = transpose(mat3(row(id.z, 0), row(id.z, 3), row(id.z, 6)));
    point = turn * point + row(id.z, 9);
    float z = point.z;
    vec2 at = (point.xy / z - k.ray_base) / k.ray_step;
    bool sees = there > 0.0 && z > 0.01 * k.radius && all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(k.size) - 0.5));
    if (!sees) return;
    ivec2 p = ivec2(floor(at + 0.5));
    int here = index_of(p), pixels = k.size.x * k.size.y;
    float gap = max(max(s.apart, 0.01 * z), 3.0 * sigma_of(z));
    uint nearness = floatBitsToUint(1.0 / z);
    uint shape = rotated(word.y, turn) | uint(s.hidden_shape);

    if (round == 0) {
        float own = depth_at(p);
        if (z > own + (own > 0.0 ? gap : 0.0)) imageAtomicMax(behind, here, nearness);
    }
    if (round == 1) {
        uint first = imageLoad(behind, here).x;
        if (nearness == first) imageAtomicMax(shapes, here, shape);
        if (first != 0u && z > 1.0 / uintBitsToFloat(first) + gap) imageAtomicMax(behind, pixels + here, nearness);
    }
    if (round == 2 && nearness == imageLoad(behind, pixels + here).x) imageAtomicMax(shapes, pixels + here, shape);
}
