// Mean of 1/z over each pixel's neighbours on its own surface, along x or y.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(constant_id = spec_down) const int down = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer surface;
layout(binding = 16, scalar) writeonly buffer Out { float mean[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

FinishConstants k;
#include "finish/clay.glsl"

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int at = p.y * k.size.x + p.x;
    float w = inverse_at(at);
    Line line = along(p, down == 0 ? ivec2(1, 0) : ivec2(0, 1), w, 4);
    // Beside an edge the neighbours lie on one side only, where a slanted surface has another mean: leave it be.
    float smoothed = line.moment == 0.0 ? w + line.sum / (line.count + 1.0) : w;
    mean[at] = w != 0.0 ? smoothed : 0.0;
}
