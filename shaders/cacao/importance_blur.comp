// CACAO HIGHEST: smooths the importance map; the second pass also sums every ninth texel into the load counter.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"
#include "lib/cacao_filter.glsl"

layout(local_size_x_id = spec_tile_x, local_size_y_id = spec_tile_y) in;
layout(constant_id = spec_last) const int second = 0;
layout(binding = 0, r32ui) readonly uniform uimageBuffer from;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer to;
layout(binding = 17, r32ui) uniform uimageBuffer load_counter;

uint read(int x, int y) {
    ivec2 t = clamp(ivec2(x, y), ivec2(0), k.importance - 1);
    return imageLoad(from, t.y * k.importance.x + t.x).x;
}

// Mean of the 2x2 texels whose upper left is (x, y), in the filter's own 8-bit steps.
float box(int x, int y) {
    return filtered(Footprint(ivec2(0), ivec2(0), ivec2(128)), read(x, y), read(x + 1, y), read(x, y + 1), read(x + 1, y + 1));
}

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    // Exact quarters of 8-bit steps tie often; the order of these sums decides them, so no compiler may change it.
    precise float sum = second == 0 ? box(t.x - 2, t.y - 1) + box(t.x, t.y - 2) + box(t.x + 1, t.y) + box(t.x - 1, t.y + 1)
                            : box(t.x - 1, t.y - 2) + box(t.x + 1, t.y - 1) + box(t.x, t.y + 1) + box(t.x - 2, t.y);
    precise float mean = sum * 0.25;
    // Threads beyond the map count too, as AMD's do: the whole dispatch, not only the map, is summed.
    if (second != 0 && t.x % 3 == 0 && t.y % 3 == 0) imageAtomicAdd(load_counter, 0, uint(255.0 * clamp(mean, 0.0, 1.0) + 0.5));
    if (any(greaterThanEqual(t, k.importance))) return;
    imageStore(to, t.y * k.importance.x + t.x, uvec4(whole(quantised(mean, 255.0))));
}
