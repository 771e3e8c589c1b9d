// Depth preparation for noisy sensors: a robust plane through each pixel's surroundings in 1/z, which is linear in the image
// on any plane. Writes the plane's depth and normal at the pixel. The window grows with the sensor's sigma at that depth
// and weights keep other surfaces out, so edges stay where they are.
//
// Two rounds of weighted least squares: the first trusts what lies as deep as the pixel, the second what lies on the plane.
// 25 and 49 samples spread over the window stand for all its pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, r32f) uniform writeonly imageBuffer depth_out;
layout(binding = 17, r32f) uniform writeonly imageBuffer normals_out;
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants k; };

// w = c + x a + y b, relative to the pixel's own 1/z.
struct Plane {
    float a, b, c;
};

struct Sums {
    float g, gx, gy, gxx, gxy, gyy, gw, gxw, gyw;
};

struct Here {
    ivec2 p;
    float w;      // 1/z
    float narrow; // 1 / (4.5 sigma) in units of 1/z: disparity steps and matching windows reach beyond 3
    float widen;  // first round: tolerance grows with distance, 1/z per pixel
};

void add(inout Sums s, Here h, bool ok, int at, float x, float y, Plane plane, float tolerance) {
    float z = imageLoad(depth_in, ok ? at : 0).x;
    float w = 1.0 / z - h.w;
    float e = (w - (plane.c + x * plane.a + y * plane.b)) * tolerance;
    float g = positive(1.0 - e * e);
    g = ok && z > 0.0 ? g * g : 0.0;
    w = g > 0.0 ? w : 0.0;
    float gx = g * x, gy = g * y;
    s.g += g;
    s.gx += gx;
    s.gy += gy;
    s.gxx += gx * x;
    s.gxy += gx * y;
    s.gyy += gy * y;
    s.gw += g * w;
    s.gxw += gx * w;
    s.gyw += gy * w;
}

// Least squares; false where the samples lie on a line or are too few to tell a plane.
bool solve(Sums s, out Plane plane) {
    float n = 1.0 / max(s.g, 1e-6);
    float mx = s.gx * n, my = s.gy * n, mw = s.gw * n;
    float xx = s.gxx - mx * s.gx, xy = s.gxy - mx * s.gy, yy = s.gyy - my * s.gy;
    float xw = s.gxw - mx * s.gw, yw = s.gyw - my * s.gw;
    float determinant = xx * yy - xy * xy;
    bool good = s.g > 3.0 && determinant > 0.02 * xx * yy;
    float d = 1.0 / max(determinant, 1e-12);
    plane.a = good ? (xw * yy - yw * xy) * d : 0.0;
    plane.b = good ? (yw * xx - xw * xy) * d : 0.0;
    plane.c = good ? mw - mx * plane.a - my * plane.b : 0.0;
    return good;
}

#define COLUMN(i) { int o = nearest(float(i) * spread); int u = h.p.x + o; \
    add(sums, h, row_ok && uint(u) < uint(k.size.x), line + u, float(o), y, plane, tolerance); }

void row5(inout Sums sums, Here h, int j, float spread, Plane plane, float tolerance) {
    int o = nearest(float(j) * spread);
    int v = h.p.y + o;
    bool row_ok = uint(v) < uint(k.size.y);
    int line = v * k.size.x;
    float y = float(o);
    COLUMN(-2) COLUMN(-1) COLUMN(0) COLUMN(1) COLUMN(2)
}

void row7(inout Sums sums, Here h, int j, float spread, Plane plane, float tolerance) {
    int o = nearest(float(j) * spread);
    int v = h.p.y + o;
    bool row_ok = uint(v) < uint(k.size.y);
    int line = v * k.size.x;
    float y = float(o);
    COLUMN(-3) COLUMN(-2) COLUMN(-1) COLUMN(0) COLUMN(1) COLUMN(2) COLUMN(3)
}

void main() {
    Here h;
    h.p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(h.p, k.size))) return;
    int here = h.p.y * k.size.x + h.p.x;
    float z = imageLoad(depth_in, here).x;
    bool hole = !(z > 0.0);
    float zc = hole ? 1.0 : z;
    h.w = 1.0 / zc;
    float sigma = k.noise_floor + k.noise_per_z2 * zc * zc;
    h.narrow = zc * zc / (4.5 * sigma);
    // The window at which a slope's error from noise equals that from a curvature of 5 % of the depth.
    float radius = clamp(sqrt(28.0 * sigma * k.fx / zc), 1.5, k.largest_radius);

    const Plane flat_one = Plane(0.0, 0.0, 0.0);
    Plane plane;
    Sums sums = Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    // A slope up to 45 degrees is still the pixel's own surface in the first round.
    float tolerance = 1.0 / (3.0 * sigma * h.w * h.w + 0.7 * radius * h.w / k.fx);
    float spread = max(radius * 0.5, 1.0);
    row5(sums, h, -2, spread, flat_one, tolerance);
    row5(sums, h, -1, spread, flat_one, tolerance);
    row5(sums, h, 0, spread, flat_one, tolerance);
    row5(sums, h, 1, spread, flat_one, tolerance);
    row5(sums, h, 2, spread, flat_one, tolerance);
    bool good = solve(sums, plane);

    Plane first = plane;
    sums = Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    spread = max(radius * (1.0 / 3.0), 1.0);
    row7(sums, h, -3, spread, first, h.narrow);
    row7(sums, h, -2, spread, first, h.narrow);
    row7(sums, h, -1, spread, first, h.narrow);
    row7(sums, h, 0, spread, first, h.narrow);
    row7(sums, h, 1, spread, first, h.narrow);
    row7(sums, h, 2, spread, first, h.narrow);
    row7(sums, h, 3, spread, first, h.narrow);
    good = solve(sums, plane) && good;

    // Plane w = W + a u + b v  =>  n ~ (fx a, fy b, w at the principal point), turned to the camera.
    float w_here = h.w + plane.c;
    float w_principal = w_here - plane.a * (float(h.p.x) - k.cx) - plane.b * (float(h.p.y) - k.cy);
    vec3 n = -vec3(k.fx * plane.a, k.fy * plane.b, w_principal);
    n *= inversesqrt(max(dot(n, n), 1e-30));
    bool near = abs(plane.c) * h.narrow < 1.0; // within the tolerance of what was recorded
    float fitted = good && near && w_here > 0.0 ? 1.0 / w_here : z;
    n = good && !hole ? n : vec3(0.0);
    imageStore(depth_out, here, vec4(hole ? 0.0 : fitted));
    imageStore(normals_out, 3 * here, vec4(n.x));
    imageStore(normals_out, 3 * here + 1, vec4(n.y));
    imageStore(normals_out, 3 * here + 2, vec4(n.z));
}
