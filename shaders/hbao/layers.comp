// Depth in 16 layers, each of every fourth pixel of every fourth row (Bavoil 2014). Texels beyond the image are holes.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/hbao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, scalar) writeonly buffer Layers { float layers[]; };
layout(binding = 32, scalar) uniform Constants { HbaoConstants constants; };

#include "lib/depth.glsl"

void main() {
    k = constants.screen;
    ivec2 cell = ivec2(gl_GlobalInvocationID.xy), plane = layer_size(k.size);
    int layer = int(gl_GlobalInvocationID.z);
    if (any(greaterThanEqual(cell, plane))) return;
    layers[(layer * plane.y + cell.y) * plane.x + cell.x] = depth_at(4 * cell + ivec2(layer & 3, layer >> 2));
}
