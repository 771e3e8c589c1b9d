// The surfaces that other views saw behind this view's: up to two layers for each block of 2x2 pixels, nearest first. Each is
// clearly behind the one before it, the first behind the nearest pixel of the block. Outside the image and in holes the first
// layer is the nearest surface there.
//
// One thread for one pixel each of four 2x2 of a neighbour, which share what its place costs to load; a round for each layer. The
// order of threads changes nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"
#include "lib/neighbour.glsl"

layout(constant_id = spec_round) const int round = 0;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer neighbours;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, scalar) buffer Behind { uint behind[]; }; // the first layer of all blocks, then the second
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

#include "lib/depth.glsl"
#include "lib/surfel.glsl"
#include "surfel/layer.glsl"

// Of the block's pixels the nearest, 0 where one is a hole.
float nearest_of(ivec2 block) {
    ivec2 p = 2 * block;
    vec2 above = vec2(depth_at(p), depth_at(p + ivec2(1, 0))), below = vec2(depth_at(p + ivec2(0, 1)), depth_at(p + ivec2(1, 1)));
    vec2 least = mix(below, above, lessThan(above, below));
    return least.x < least.y ? least.x : least.y;
}

void reproject(ivec2 q, int neighbour, NeighbourPlace place, SurfelConstants s) {
    if (any(greaterThanEqual(q, k.window))) return;
    uvec2 word = imageLoad(neighbours, (neighbour * k.window.y + q.y) * k.window.x + q.x).xy;
    vec3 there = ray_there(vec2(q), place) * uintBitsToFloat(word.x), point = point_here(there, place);
    vec3 n = turned_here(vec3(bytes_of_normal(word.y)), place);
    vec2 at = (point.xy * (1.0 / point.z) - k.ray_base) * vec2(k.camera.fx, k.camera.fy);
    bool sees = there.z > 0.0 && point.z > 0.0625 * k.radius && all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(k.size) - 0.5));
    if (!sees) return;
    ivec2 block = ivec2(nearest(at.x), nearest(at.y)) >> 1;
    float z = plane_depth(point, n, ray_of(middle_of(block)));
    float before = round == 0 ? nearest_of(block) : layer_depth(behind[layer_index(block)], k.radius);
    if (z > before + (before > 0.0 ? layer_gap(z, s) : 0.0))
        atomicMax(behind[round * layers_size() + layer_index(block)], layer_word(z, n, k.radius));
}

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec3 id = ivec3(gl_GlobalInvocationID);
    NeighbourPlace place = constants.screen.places[id.z];
    if (id.z >= k.neighbours) return;
    // Each neighbour shows other pixels of its blocks.
    ivec2 q = 2 * id.xy * ivec2(1, reprojected_rows) + ivec2(id.z & 1, (id.z >> 1) & 1);
    reproject(q, id.z, place, s);
    reproject(q + ivec2(0, 2), id.z, place, s);
    reproject(q + ivec2(0, 4), id.z, place, s);
    reproject(q + ivec2(0, 6), id.z, place, s);
}
