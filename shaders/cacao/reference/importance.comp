// CACAO `reference` HIGHEST (I0, section 8.6): the importance map.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 0, r32ui) readonly uniform uimageBuffer base_result;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer importance;

bool is_hole(uint texel) { return false; }
#include "cacao/importance.glsl"

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.importance))) return;
    imageStore(importance, t.y * k.importance.x + t.x, uvec4(whole(importance_of(t))));
}
