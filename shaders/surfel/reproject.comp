// What other views saw behind this one's surfaces: up to two layers a pixel, nearest first, each clearly behind the one before
// it. Outside the image and in holes, where nothing is, the first layer is the nearest surface there.
//
// One thread a pixel of each neighbour, a round for each layer. The order of threads changes nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"

layout(constant_id = spec_round) const int round = 0;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer neighbours;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32ui) uniform uimageBuffer behind; // the first layer of all pixels, then the second
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

#include "lib/depth.glsl"
#include "lib/surfel.glsl"
#include "lib/layer.glsl"

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    NeighbourPlace place = constants.screen.places[gl_WorkGroupID.z];
    ivec3 id = ivec3(gl_GlobalInvocationID);
    if (id.z >= k.neighbours || any(greaterThanEqual(id.xy, k.window))) return;
    uvec2 word = imageLoad(neighbours, (id.z * k.window.y + id.y) * k.window.x + id.x).xy;
    vec3 there = vec3(vec2(id.xy) * place.ray_step + place.ray_base, 1.0) * uintBitsToFloat(word.x);
    vec3 point = vec3(dot(place.x, there), dot(place.y, there), dot(place.z, there)) + place.shift;
    float z = point.z;
    vec2 at = (point.xy * (1.0 / z) - k.ray_base) * vec2(k.camera.fx, k.camera.fy);
    bool sees = there.z > 0.0 && z > 0.0625 * k.radius && all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(k.size) - 0.5));
    if (!sees) return;
    ivec2 p = ivec2(nearest(at.x), nearest(at.y));
    int here = index_of(p);
    float before = round == 0 ? depth_at(p) : layer_depth(imageLoad(behind, here).x, k.radius);
    float gap = max(max(s.apart, 0.01 * z), 3.0 * sigma_of(z));
    vec3 n = vec3(bytes_of_normal(word.y));
    n = vec3(dot(place.x, n), dot(place.y, n), dot(place.z, n));
    if (z > before + (before > 0.0 ? gap : 0.0)) imageAtomicMax(behind, round * k.size.x * k.size.y + here, layer_word(z, n, k.radius));
}
