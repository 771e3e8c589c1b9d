// Tap rate of a device: a plain 32-tap gather over an image, to relate timings of machines to each other.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/pattern.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer from;
layout(binding = 16, scalar) writeonly buffer To { float to[]; };
layout(binding = 32, scalar) uniform Constants { ivec2 size; };

void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, size))) return;
    float sum = 0.0;
#define TAP(i, dx, dy, w, l) { ivec2 t = clamp(p + ivec2(dx * 30.0, dy * 30.0), ivec2(0), size - 1); sum += imageLoad(from, t.y * size.x + t.x).x; }
    CACAO_PATTERN_0_3(TAP) CACAO_PATTERN_3_5(TAP) CACAO_PATTERN_5_12(TAP) CACAO_PATTERN_12_31(TAP) CACAO_PATTERN_31(TAP)
    to[p.y * size.x + p.x] = sum;
}
