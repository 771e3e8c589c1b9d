// CACAO `scan`, second half of upsampling, from a buffer.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/scan/upsample.glsl"

layout(local_size_x = cacao_row) in;

vec2 staged_at(int at) { return imageLoad(staged, at).xy; }

void main() {
    k = constants;
    ivec2 h = ivec2(gl_GlobalInvocationID.xy);
    upsample_pixels(h, (h.y + 2) * k.grid.x + h.x + 2, k.grid.x);
}
