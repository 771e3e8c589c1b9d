// Edges between surfaces along every row and column. Bit i of a word: an edge is before pixel i of its run of 32. Bit i of the
// second word: the surface before that edge is farther away, or missing.
//
// A surface continues where 1/z, linear on any plane, changes little or with the slope of either side (inverse-depth continuity).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"

layout(local_size_x = surfel_group) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 16, scalar) writeonly buffer Edges { uvec2 edges[]; };
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

const int narrow = 4;  // a surface may continue behind a hole of fewer pixels
const int across = 24; // holes of fewer pixels have a known far end

int start, stride, length_px;
float noise_floor, noise_per_z2;

// 1/z, 0 in holes and outside.
float inverse(int i) {
    float z = imageLoad(surfaces, start + clamp(i, 0, length_px - 1) * stride).w;
    return uint(i) < uint(length_px) && z != 0.0 ? 1.0 / abs(z) : 0.0; // filled holes have a negative depth
}

// 3 sigma(z) / z^2, or 1 % of the depth.
float tolerance(float b, float c) {
    float w = min(b, c);
    return max(3.0 * (noise_floor * w * w + noise_per_z2), 0.01 * w);
}

// Whether c, `gap` pixels on from b and its slope, is of the same surface.
bool goes_on(float b, float slope, float c, int gap) {
    float most = tolerance(b, c);
    return gap <= narrow && b > 0.0 && c > 0.0 && (abs(c - b) <= most || abs(c - (b + slope * float(gap))) <= most);
}

void main() {
    SurfelConstants s = constants;
    ScreenConstants k = s.screen;
    noise_floor = k.noise_floor;
    noise_per_z2 = k.noise_per_z2;
    int id = int(gl_GlobalInvocationID.x), rows = s.words.x * k.size.y;
    bool along_row = id < rows;
    int column_id = id - rows;
    // Neighbouring threads take neighbouring lines.
    int run = along_row ? id / k.size.y : column_id / k.size.x;
    int line = along_row ? id - run * k.size.y : column_id - run * k.size.x;
    if (id >= rows + s.words.y * k.size.x) return;

    length_px = along_row ? k.size.x : k.size.y;
    stride = along_row ? 1 : k.size.x;
    start = along_row ? line * k.size.x : line;
    int first = run * surfel_run;
    // Of the last pixel with depth before the run: 1/z, its slope, and how far back it lies.
    float last = inverse(first - 1);
    int gap = 1;
    while (last == 0.0 && gap < across && first - gap > 0) last = inverse(first - ++gap);
    float before = inverse(first - gap - 1);
    float slope = before > 0.0 && last > 0.0 ? last - before : 0.0;
    float b = gap == 1 ? last : 0.0, c = inverse(first);
    uint edge = 0u, farther = 0u;
    for (int i = 0; i < surfel_run; ++i) {
        float d = inverse(first + i + 1);
        uint bit = 1u << i;
        bool on, beyond_is_nearer;
        if (b > 0.0 && c == 0.0) { // a hole begins: does the same surface continue behind it?
            float beyond = d;
            int width = 2;
            while (beyond == 0.0 && width < across && first + i + width < length_px) beyond = inverse(first + i - 1 + ++width);
            on = goes_on(b, slope, beyond, width);
            beyond_is_nearer = b < beyond;
        } else { // c may continue b, or the surface before the hole that ends here; d gives a slope that begins
            on = goes_on(last, slope, c, gap) || (b > 0.0 && d > 0.0 && c > 0.0 && abs(b - (2.0 * c - d)) <= tolerance(b, c));
            beyond_is_nearer = last < c;
        }
        edge |= on || first + i == 0 || first + i >= length_px || (b == 0.0 && c == 0.0) ? 0u : bit;
        farther |= beyond_is_nearer ? bit : 0u;
        slope = c > 0.0 ? (b > 0.0 ? c - b : 0.0) : slope;
        last = c > 0.0 ? c : gap < across ? last : 0.0;
        gap = c > 0.0 ? 1 : gap + 1;
        b = c;
        c = d;
    }
    // Words of one run of all lines are contiguous.
    edges[id] = uvec2(edge, farther);
}
