// CACAO `scan`, prepare: depth into a buffer.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/scan/prepare.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 16, scalar) writeonly buffer DepthsOut { float depths[]; };

void store_depth(int slice, ivec2 t, float z) { depths[depth_index(slice, 0, t)] = whole(z); }

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(t, k.slice))) prepared(t);
}
