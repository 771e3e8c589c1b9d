// CACAO HIGHEST (section 8.6, IA and IB), both profiles: smooths the importance map; the second pass also sums every ninth texel into
// the load counter.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/cacao.glsl"
#include "cacao/importance_smoothing.glsl"

layout(local_size_x = cacao_row) in;
layout(constant_id = spec_last) const int second = 0;
layout(binding = 0, r32ui) readonly uniform uimageBuffer from;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer to;
layout(binding = 17, r32ui) uniform uimageBuffer load_counter;

uint read(int x, int y) {
    ivec2 t = clamp(ivec2(x, y), ivec2(0), k.importance - 1);
    return imageLoad(from, t.y * k.importance.x + t.x).x;
}
#define READ(x, y) read(x, y)

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    precise float sum = second == 0 ? FIRST_SMOOTHING(t) : SECOND_SMOOTHING(t);
    precise float mean = sum * 0.25;
    if (second != 0 && counts(t)) imageAtomicAdd(load_counter, 0, load_of(mean));
    if (any(greaterThanEqual(t, k.importance))) return;
    imageStore(to, t.y * k.importance.x + t.x, uvec4(whole(quantised(mean, 255.0))));
}
