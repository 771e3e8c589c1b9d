// The nearest edge before and after each word of edges: one thread walks the words of a line. Each number is twice the pixel
// after the edge, plus 1 where the surface beyond the edge is farther away or missing; surfel_nowhere at the image's border.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"

layout(local_size_x = surfel_group) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer edges;
layout(binding = 16, scalar) writeonly buffer Runs { uint runs[]; }; // two a word: of before it, of after it
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

void main() {
    SurfelConstants s = constants;
    ScreenConstants k = s.screen;
    int line = int(gl_GlobalInvocationID.x);
    if (line >= k.size.x + k.size.y) return;
    bool row = line < k.size.y;
    int words = row ? s.words.x : s.words.y, stride = row ? k.size.y : k.size.x;
    int base = row ? line : s.words.x * k.size.y + line - k.size.y;
    // Both directions at once, each at its own end.
    uint before = surfel_nowhere, after = surfel_nowhere;
    for (int i = 0; i < words; ++i) {
        int up = base + i * stride, down = base + (words - 1 - i) * stride;
        uvec2 a = imageLoad(edges, up).xy, b = imageLoad(edges, down).xy;
        runs[2 * up] = before;
        runs[2 * down + 1] = after;
        int last = findMSB(a.x), first = findLSB(b.x);
        before = a.x == 0u ? before : uint(i * surfel_run + last) << 1 | (a.y >> (last & 31) & 1u);
        after = b.x == 0u ? after : uint((words - 1 - i) * surfel_run + first) << 1 | (~b.y >> (first & 31) & 1u);
    }
}
