// Adds the surfaces of one other view to the voxels that they lie in, where those have bricks. The view is counted on the device.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer neighbours; // one view after the other
layout(binding = 1, rg32ui) readonly uniform uimageBuffer table;
layout(binding = 2, r32ui) readonly uniform uimageBuffer counters;
layout(binding = 16, scalar) buffer Sums { uint sums[]; };
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "vxao/grid.glsl"
#include "vxao/numbers.glsl"
#include "vxao/patch.glsl"
#include "vxao/add.glsl"
#include "vxao/neighbour.glsl"

void main() {
    VxaoConstants c = constants;
    k = c.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.window))) return;
    number_levels(c);
    int view = int(imageLoad(counters, vxao_view).x);
    Patches patches;
    if (view < k.neighbours && patches_of_neighbour(p, view, c, patches)) add_patches(patches, c);
}
