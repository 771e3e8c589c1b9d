// Where one surface ends and another begins, along every row and every column: bit i of a word says that an edge lies
// before pixel i of its run of 32; the second word, that what lies before the edge is farther away, or nothing.
//
// Surfaces go on where 1/z, linear on any plane, changes little or as it did on either side (inverse-depth continuity).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"

layout(local_size_x = surfel_group) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth;
layout(binding = 16, rg32ui) writeonly uniform uimageBuffer edges;
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

const int across = 24;

float inverse(float z) { return z > 0.0 ? 1.0 / z : 0.0; }

void main() {
    SurfelConstants s = constants;
    ScreenConstants k = s.screen;
    int id = int(gl_GlobalInvocationID.x), rows = s.words.x * k.size.y;
    bool along_row = id < rows;
    int column_id = id - rows;
    // Neighbouring threads take neighbouring lines.
    int run = along_row ? id / k.size.y : column_id / k.size.x;
    int line = along_row ? id - run * k.size.y : column_id - run * k.size.x;
    if (id >= rows + s.words.y * k.size.x) return;

    int length = along_row ? k.size.x : k.size.y;
    int stride = along_row ? 1 : k.size.x;
    int start = along_row ? line * k.size.x : line;
    int first = run * surfel_run;
    // w of the pixels at i - 2, i - 1, i, i + 1 of the line.
    float a = inverse(first >= 2 ? imageLoad(depth, start + (first - 2) * stride).x : 0.0);
    float b = inverse(first >= 1 ? imageLoad(depth, start + (first - 1) * stride).x : 0.0);
    float c = inverse(imageLoad(depth, start + first * stride).x);
    uint edge = 0u, farther = 0u;
    float last = 0.0; // w of the last pixel with depth
    for (int i = first - 1; i >= max(first - across, 0) && last == 0.0; --i) last = inverse(imageLoad(depth, start + i * stride).x);
    for (int i = 0; i < surfel_run; ++i) {
        int next = first + i + 1;
        float d = inverse(next < length ? imageLoad(depth, start + min(next, length - 1) * stride).x : 0.0);
        // 3 sigma(z) / z^2, or 2 % of the depth.
        float w = min(b, c);
        float tolerance = max(3.0 * (k.noise_floor * w * w + k.noise_per_z2), 0.02 * w);
        bool on = abs(c - b) <= tolerance || abs(c - (2.0 * b - a)) <= tolerance || abs(b - (2.0 * c - d)) <= tolerance;
        on = on && b > 0.0 && c > 0.0;
        uint bit = 1u << i;
        edge |= on || first + i == 0 ? 0u : bit;
        // Beyond a narrow hole is what lies behind it.
        if (b > 0.0 && c == 0.0) {
            float beyond = 0.0;
            for (int j = first + i + 1; j < min(first + i + across, length) && beyond == 0.0; ++j) beyond = inverse(imageLoad(depth, start + j * stride).x);
            farther |= b < beyond ? bit : 0u;
        } else {
            farther |= (c > 0.0 && b == 0.0 ? last : b) < c ? bit : 0u;
        }
        last = c > 0.0 ? c : last;
        a = b;
        b = c;
        c = d;
    }
    // Words of one run of all lines lie side by side.
    imageStore(edges, id, uvec4(edge, farther, 0u, 0u));
}
