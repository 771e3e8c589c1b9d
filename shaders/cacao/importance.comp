// CACAO HIGHEST: how much a 4x4 block of the AO grid needs more taps, from the contrast of the base pass.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"

layout(local_size_x_id = spec_tile_x, local_size_y_id = spec_tile_y) in;
layout(binding = 0, r32ui) readonly uniform uimageBuffer base_result;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer importance;

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.importance))) return;
    float lowest = 1.0, highest = 0.0;
    for (int slice = 0; slice < 4; ++slice)
        for (int i = 0; i < 4; ++i) {
            uint b = imageLoad(base_result, slice_index(slice, min(2 * t + ivec2(i & 1, i >> 1), k.slice - 1))).x;
            if (is_hole(b)) continue;
            float v = pow(clamp(1.0 - k.shadow_strength * ao_value(b), 0.0, 1.0), k.shadow_power);
            lowest = min(lowest, v);
            highest = max(highest, v);
        }
    float contrast = clamp(2.0 * (highest - lowest), 0.0, 1.0);
    imageStore(importance, t.y * k.importance.x + t.x, uvec4(whole(quantised(pow(contrast, 0.8), 255.0))));
}
