// Adds the surfaces of this view to the voxels that they lie in.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 1, rg32ui) readonly uniform uimageBuffer table;
layout(binding = 2, r32ui) readonly uniform uimageBuffer counters;
layout(binding = 16, scalar) buffer Sums { uint sums[]; };
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "vxao/grid.glsl"
#include "vxao/numbers.glsl"
#include "vxao/patch.glsl"
#include "vxao/add.glsl"

void main() {
    VxaoConstants c = constants;
    k = c.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.window))) return;
    number_levels(c);
    p += k.origin;
    vec4 surface = imageLoad(surfaces, index_of(p));
    if (!(surface.w > 0.0)) return;
    vec3 ray = ray_of(vec2(p)), point = ray * surface.w;
    add_patches(patches_of(point, surface.xyz, vec3(0.0), ray, surface.w, abs(dot(surface.xyz, ray)), k.ray_step, c), c);
}
