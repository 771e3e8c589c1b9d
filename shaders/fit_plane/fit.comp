// Third pass of depth preparation: a robust plane through each pixel's surroundings in 1/z. Writes the plane's depth and
// normal at the pixel. The window grows with the sensor's sigma at that depth and weights keep other surfaces out, so edges
// stay where they are.
//
// Two rounds of weighted least squares: the first weighs samples by their depth difference to the pixel, the second by their
// distance from the plane. 25 and 49 averages spread over the window stand for all its pixels. On disparity a third round tries
// a wider window.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer samples; // averages of 1/z, `nowhere` where there is none
layout(binding = 1, r32f) readonly uniform imageBuffer relief;
layout(binding = 16, scalar) writeonly buffer Depth { float depth_out[]; };
layout(binding = 17, scalar) writeonly buffer Normals { vec3 normals_out[]; };
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

layout(constant_id = spec_waves) const int in_waves = 0;

FitPlaneConstants k;
#include "fit_plane/fit_plane.glsl"

// Two columns as far to the left of the pixel as to the right, and what is expected there, relative to the pixel's column.
struct Columns {
    float x;
    int left, right;
    float expected_left, expected_right;
};

// Where samples are taken, and what is expected of them.
struct Window {
    ivec2 p;
    float expected, b; // at the pixel, and by how much more a row below
    float narrow;
    Columns one, two, three;
};

Columns columns_at(int u, float away, float a) {
    int o = nearest(away), left = u - o, right = u + o;
    float x = float(o);
    return Columns(x, max(left, 0), min(right, k.size.x - 1), left < 0 ? -nowhere : -x * a, right >= k.size.x ? -nowhere : x * a);
}

void add_columns(inout Row row, int line, float expected, Columns at, float narrow) {
    float left = imageLoad(samples, line + at.left).x, right = imageLoad(samples, line + at.right).x;
    add_pair(row, at.x, left - expected - at.expected_left, right - expected - at.expected_right, narrow);
}

void add_row_at(inout Sums sums, Window at, float away, bool wide) {
    int o = nearest(away), v = at.p.y + o, line = clamp(v, 0, k.size.y - 1) * k.size.x;
    float y = float(o), expected = uint(v) < uint(k.size.y) ? at.expected + y * at.b : -nowhere;
    Row row = row_from(imageLoad(samples, line + at.p.x).x - expected, at.narrow);
    add_columns(row, line, expected, at.one, at.narrow);
    add_columns(row, line, expected, at.two, at.narrow);
    if (wide) add_columns(row, line, expected, at.three, at.narrow);
    add_row(sums, y, row);
}

// 5x5 samples, or 7x7, `spread` pixels apart.
Sums square(ivec2 p, bool wide, float spread, float w_here, Plane plane, float narrow) {
    Window at = Window(p, w_here + plane.c, plane.b, narrow, columns_at(p.x, spread, plane.a),
                       columns_at(p.x, 2.0 * spread, plane.a), columns_at(p.x, 3.0 * spread, plane.a));
    Sums sums = nothing;
    if (wide) add_row_at(sums, at, -3.0 * spread, wide);
    add_row_at(sums, at, -2.0 * spread, wide);
    add_row_at(sums, at, -spread, wide);
    add_row_at(sums, at, 0.0, wide);
    add_row_at(sums, at, spread, wide);
    add_row_at(sums, at, 2.0 * spread, wide);
    if (wide) add_row_at(sums, at, 3.0 * spread, wide);
    return sums;
}

vec3 three_at(ivec3 indices) {
    return vec3(imageLoad(samples, indices.x).x, imageLoad(samples, indices.y).x, imageLoad(samples, indices.z).x);
}

// What the first samples are compared with: level, but for even slopes.
Plane slope_at(ivec2 p, int reach, float w_here) {
    ivec2 last = k.size - 1, low = max(p - reach, 0), high = min(p + reach, last);
    ivec3 across = ivec3(max(p.x - 1, 0), p.x, min(p.x + 1, last.x));
    ivec3 down = ivec3(max(p.y - 1, 0), p.y, min(p.y + 1, last.y)) * k.size.x;
    float a = slope_between(three_at(down + low.x), three_at(down + high.x), w_here, float(2 * reach));
    float b = slope_between(three_at(low.y * k.size.x + across), three_at(high.y * k.size.x + across), w_here, float(2 * reach));
    bool inner = all(greaterThan(p, ivec2(0))) && all(lessThan(p, last));
    return Plane(inner && high.x - low.x == 2 * reach ? a : 0.0, inner && high.y - low.y == 2 * reach ? b : 0.0, 0.0);
}

// Of the greatest sum of weights, what a wider window must have to count at all, and to count alone.
const float no_plane = 0.6, one_plane = 0.85;

float window_of(float z, float sigma) { return clamp(sqrt(k.window * sigma * k.camera.fx / z), 1.5, k.largest_radius); }

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float w = imageLoad(samples, here).x;
    bool hole = !(w > 0.0);
    float wc = hole ? 1.0 : w, zc = 1.0 / wc;
    float relief_here = relief_at(here), sigma = sigma_of(zc) * wc * wc; // of 1/z, of a single frame
    float radius = window_of(zc, sigma_of(zc) * relief_here);
    float half_way = max(radius * 0.5, 1.0);

    Plane expected = slope_at(p, int(half_way), wc), first, plane;
    // A slope up to 45 degrees more is still the pixel's own surface in the first round.
    float narrow = 1.0 / (3.0 * sigma_on(expected, sigma) + 0.7 * radius * wc / k.camera.fx);
    bool good = solve(square(p, false, half_way, wc, expected, narrow), expected, first);
    float tolerance = 3.0 * sigma_on(first, sigma);
    narrow = 1.0 / (tolerance * relief_here);
    good = solve(square(p, true, max(radius * (1.0 / 3.0), 1.0), wc, first, narrow), first, plane) && good;

    // Disparity comes from windows of pixels, so it errs in waves longer than this window. A window twice as wide levels
    // them. Its plane counts by the share of samples that lie about it, so that edges, relief and curves keep theirs.
    if (in_waves == 1) {
        float wide_narrow = 1.0 / (k.wide_sigmas * sigma_on(plane, sigma) * relief_here);
        Sums wide = square(p, true, radius * (2.0 / 3.0), wc, plane, wide_narrow);
        Plane wider;
        bool fits = solve(wide, plane, wider);
        float share = fits ? clamp((wide.g * (1.0 / 49.0) - no_plane) * (1.0 / (one_plane - no_plane)), 0.0, 1.0) : 0.0;
        plane = Plane(mix(plane.a, wider.a, share), mix(plane.b, wider.b, share), mix(plane.c, wider.c, share));
    }

    // Plane w = W + a u + b v  =>  n ~ (fx a, fy b, w at the principal point), turned to the camera.
    float w_here = wc + plane.c;
    float w_principal = w_here - plane.a * (float(p.x) - k.camera.cx) - plane.b * (float(p.y) - k.camera.cy);
    vec3 n = -vec3(k.camera.fx * plane.a, k.camera.fy * plane.b, w_principal);
    n *= inversesqrt(max(dot(n, n), 1e-30));
    good = good && abs(plane.c) < tolerance && w_here > 1e-6 && !hole; // a kilometre of kilometres
    depth_out[here] = hole ? 0.0 : good ? 1.0 / w_here : zc;
    normals_out[here] = good ? n : vec3(0.0);
}
