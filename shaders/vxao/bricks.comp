// Bricks for the surfaces of this view, and the cells that surfaces of other views must lie in to be within its reach.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 16, scalar) coherent buffer Table { uint table[]; };
layout(binding = 17, scalar) coherent buffer Counters { uint counters[]; };
layout(binding = 18, scalar) writeonly buffer Keys { uint keys[]; }; // of the bricks of each level
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "vxao/grid.glsl"
#include "vxao/patch.glsl"
#include "vxao/insert.glsl"

void main() {
    VxaoConstants c = constants;
    k = c.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.window))) return;
    p += k.origin;
    vec4 surface = imageLoad(surfaces, index_of(p));
    if (!(surface.w > 0.0)) return;
    vec3 ray = ray_of(vec2(p)), point = ray * surface.w;
    insert_patches(patches_of(point, surface.xyz, vec3(0.0), ray, surface.w, abs(dot(surface.xyz, ray)), k.ray_step, c), c);
    if (k.neighbours == 0) return;
    vec3 at = in_grid(point, c);
    float reach = k.radius * c.per_voxel;
    ivec3 low = ivec3(floor(clamp(at - reach, -1e6, 1e6))) >> cell_log2(c), high = ivec3(floor(clamp(at + reach, -1e6, 1e6))) >> cell_log2(c);
    for (int i = 0; i < 8; ++i)
        insert(vxao_reach, mix(low, high, notEqual(i & ivec3(1, 2, 4), ivec3(0))), false, c);
}
