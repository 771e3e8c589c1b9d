// CACAO `scan` HIGHEST, on GPUs: the importance map, smoothed twice, and its sum, in one pass through shared memory.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU
#include "cacao/scan/scan.glsl"
#include "cacao/importance_smoothing.glsl"

const int tile = cacao_tile, inner = tile + 4, outer = tile + 8; // each smoothing reads two texels to every side
layout(local_size_x = tile, local_size_y = tile) in;
layout(binding = 0, r32ui) readonly uniform uimageBuffer base_result;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer importance;
layout(binding = 17, r32ui) uniform uimageBuffer load_counter;

#include "cacao/importance.glsl"

shared uint raw[outer * outer], once[inner * inner], load;

uint raw_at(ivec2 t, ivec2 first) {
    ivec2 l = clamp(t, ivec2(0), k.importance - 1) - first;
    return raw[l.y * outer + l.x];
}
uint once_at(ivec2 t, ivec2 first) {
    ivec2 l = clamp(t, ivec2(0), k.importance - 1) - first;
    return once[l.y * inner + l.x];
}

void main() {
    k = constants;
    int thread = int(gl_LocalInvocationIndex);
    ivec2 t = ivec2(gl_GlobalInvocationID.xy), corner = tile * ivec2(gl_WorkGroupID.xy);
    if (thread == 0) load = 0u;
    for (int i = thread; i < outer * outer; i += tile * tile) {
        ivec2 at = corner - 4 + ivec2(i % outer, i / outer);
        if (all(lessThan(uvec2(at), uvec2(k.importance)))) raw[i] = importance_of(at);
    }
    barrier();
#define READ(x, y) raw_at(ivec2(x, y), corner - 4)
    for (int i = thread; i < inner * inner; i += tile * tile) {
        ivec2 at = corner - 2 + ivec2(i % inner, i / inner);
        if (any(greaterThanEqual(uvec2(at), uvec2(k.importance)))) continue;
        precise float sum = FIRST_SMOOTHING(at);
        once[i] = quantised(sum * 0.25, 255.0);
    }
#undef READ
    barrier();
#define READ(x, y) once_at(ivec2(x, y), corner - 2)
    precise float sum = SECOND_SMOOTHING(t);
    precise float mean = sum * 0.25;
    if (counts(t)) atomicAdd(load, load_of(mean));
    if (all(lessThan(t, k.importance))) imageStore(importance, t.y * k.importance.x + t.x, uvec4(quantised(mean, 255.0)));
    barrier();
    if (thread == 0) imageAtomicAdd(load_counter, 0, load);
}
