// Last pass of depth preparation: which pixels have been filled, a bit each.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"

layout(local_size_x = mark_group) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth;
layout(binding = 1, r32f) readonly uniform imageBuffer filled;
layout(binding = 16, scalar) writeonly buffer Marks { uint marks[]; };
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

void main() {
    FitPlaneConstants k = constants;
    int word = int(gl_GlobalInvocationID.x), first = marks_a_word * word, pixels = k.size.x * k.size.y;
    if (first >= pixels) return;
    uint bits = 0u;
    for (int i = 0; i < marks_a_word; ++i) {
        int at = min(first + i, pixels - 1);
        bool is_filled = imageLoad(filled, at).x > 0.0 && !(imageLoad(depth, at).x > 0.0);
        bits |= is_filled ? 1u << i : 0u;
    }
    marks[word] = bits;
}
