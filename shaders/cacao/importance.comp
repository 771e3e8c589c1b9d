// CACAO HIGHEST: the importance map, how much a 4x4 block of the AO grid needs more taps.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 0, r32ui) readonly uniform uimageBuffer base_result;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer importance;

#include "lib/cacao_importance.glsl"

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.importance))) return;
    imageStore(importance, t.y * k.importance.x + t.x, uvec4(whole(importance_of(t))));
}
