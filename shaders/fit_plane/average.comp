// Second pass of depth preparation: each pixel takes the value of a plane through its 5x5 surroundings. The few samples of the
// next pass then represent all pixels of a large window. Where windows are small anyway, 3x3 keep smaller shapes: in fused
// frames, and where each pixel errs by itself.
//
// A thread walks down a few pixels of a column, and of each one's surroundings loads only the row that is new.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer samples; // 1/z, `nowhere` where there is none
layout(binding = 1, r32f) readonly uniform imageBuffer relief;
layout(binding = 16, scalar) writeonly buffer Averages { float averages[]; };
layout(constant_id = spec_small) const int is_small = 0;
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

FitPlaneConstants k;
#include "fit_plane/fit_plane.glsl"

struct Five {
    float a, b, c, d, e; // from left to right
};

float sample_at(int line, int u, bool row_inside) {
    bool inside = row_inside && uint(u) < uint(k.size.x);
    float w = imageLoad(samples, inside ? line + u : 0).x;
    return inside ? w : nowhere;
}

Five five_at(ivec2 p) {
    bool inside = uint(p.y) < uint(k.size.y);
    int line = p.y * k.size.x;
    return Five(sample_at(line, p.x - 2, inside), sample_at(line, p.x - 1, inside), sample_at(line, p.x, inside),
                sample_at(line, p.x + 1, inside), sample_at(line, p.x + 2, inside));
}

void add_line(inout Sums sums, float y, Five w, float w_here, Plane plane, float narrow) {
    float there = w_here + y * plane.b;
    Row row = row_from(w.c - there, narrow);
    add_pair(row, 1.0, w.b - there + plane.a, w.d - there - plane.a, narrow);
    if (is_small == 0) add_pair(row, 2.0, w.a - there + 2.0 * plane.a, w.e - there - 2.0 * plane.a, narrow);
    add_row(sums, y, row);
}

// A slope up to 45 degrees more is still the pixel's own surface; the farthest sample is 2.8 pixels away. Of 3x3 it is 1.4 pixels
// away, and a slope may be 55 degrees more: less would tilt floors that noise across the image has bent.
const float own = is_small == 0 ? 0.7 * 2.8 : 1.0 * 1.4;

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy) * ivec2(1, average_rows);
    if (any(greaterThanEqual(p, k.size))) return;
    int end = min(p.y + average_rows, k.size.y);
    Five above2 = five_at(p - ivec2(0, 2)), above = five_at(p - ivec2(0, 1)), middle = five_at(p), below = five_at(p + ivec2(0, 1));
    do {
        Five below2 = five_at(p + ivec2(0, 2));
        int here = p.y * k.size.x + p.x;
        bool hole = !(middle.c > 0.0);
        float wc = hole ? 1.0 : middle.c, zc = 1.0 / wc;
        float a = slope_between(vec3(above.a, middle.a, below.a), vec3(above.e, middle.e, below.e), wc, 4.0);
        float b = slope_between(vec3(above2.b, above2.c, above2.d), vec3(below2.b, below2.c, below2.d), wc, 4.0);
        Plane expected = Plane(a, b, 0.0), plane;
        float sigma = sigma_on(expected, sigma_of(zc) * wc * wc) * relief_at(here);
        float narrow = 1.0 / (3.0 * sigma + own * wc / k.camera.fx);
        Sums sums = nothing;
        if (is_small == 0) add_line(sums, -2.0, above2, wc, expected, narrow);
        add_line(sums, -1.0, above, wc, expected, narrow);
        add_line(sums, 0.0, middle, wc, expected, narrow);
        add_line(sums, 1.0, below, wc, expected, narrow);
        if (is_small == 0) add_line(sums, 2.0, below2, wc, expected, narrow);
        solve(sums, expected, plane); // where none fits the plane is level, the pixel keeps its value
        averages[here] = hole ? nowhere : wc + plane.c;
        above2 = above;
        above = middle;
        middle = below;
        below = below2;
    } while (++p.y < end);
}
