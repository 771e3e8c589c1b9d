// Limits of thickness where another view saw through the space behind a surface: one pixel of 2x2, two depths.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"
#include "lib/neighbour.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer neighbours;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 16, scalar) writeonly buffer Limits { float limits[]; }; // metres
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

// Whether neighbour i saw through a point of this view.
bool is_free(int i, NeighbourPlace place, vec3 point, float margin) {
    vec3 there = point_there(point, place);
    vec2 at;
    bool sees = seen_there(there, place, k.window, at);
    return sees && uintBitsToFloat(imageLoad(neighbours, index_there(i, at, k.window, sees)).x) > there.z + margin;
}

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 p = 2 * ivec2(gl_GlobalInvocationID.xy), block = (p + k.origin) >> 1;
    if (any(greaterThanEqual(p, k.window))) return;
    p = 2 * block;
    float z = abs(imageLoad(surfaces, index_of(p)).w);
    vec3 point = ray_of(vec2(p)) * z, away = normalize(ray_of(vec2(p))) * s.thickest;
    float margin = max(max(0.02 * k.radius, 0.01 * z), 3.0 * sigma_of(z)), limit = 1.0;
    int i = 0;
    do {
        NeighbourPlace place = constants.screen.places[i];
        limit = limit > 0.4 && is_free(i, place, point + 0.5 * away, margin) ? 0.37 : limit;
        limit = is_free(i, place, point + 0.125 * away, margin) ? 0.09 : limit;
    } while (++i < k.neighbours);
    limits[block.y * ((k.size.x + 1) >> 1) + block.x] = limit * s.thickest;
}
