// Third pass of depth preparation: a robust plane through each pixel's surroundings in 1/z. Writes the plane's depth and
// normal at the pixel. The window grows with the sensor's sigma at that depth and weights keep other surfaces out, so edges
// stay where they are.
//
// Two rounds of weighted least squares: the first weighs samples by their depth difference to the pixel, the second by their
// distance from the plane.
// 25 and 49 averages spread over the window stand for all its pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer samples; // averages of 1/z, 0 where there is none
layout(binding = 1, r32f) readonly uniform imageBuffer relief;
layout(binding = 16, r32f) uniform writeonly imageBuffer depth_out;
layout(binding = 17, r32f) uniform writeonly imageBuffer normals_out;
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants k; };

#include "fit_plane/fit_plane.glsl"

void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float w = imageLoad(samples, here).x;
    bool hole = !(w > 0.0);
    float wc = hole ? 1.0 : w, zc = 1.0 / wc;
    float relief_here = relief_at(here), sigma = sigma_of(zc) * wc * wc; // of 1/z, of a single frame
    float radius = window_of(zc, sigma_of(zc) * relief_here);

    Plane expected = slope_at(p, wc, int(max(radius * 0.5, 1.0))), first, plane;
    // A slope up to 45 degrees more is still the pixel's own surface in the first round.
    float sigma_sloped = sigma_on(expected, sigma);
    bool good = solve(square5(p, wc, max(radius * 0.5, 1.0), expected, 1.0 / (3.0 * sigma_sloped + 0.7 * radius * wc / k.camera.fx)),
                      first);
    float narrow = 1.0 / (3.0 * sigma_on(first, sigma) * relief_here);
    good = solve(square7(p, wc, max(radius * (1.0 / 3.0), 1.0), first, narrow), plane) && good;

    // Plane w = W + a u + b v  =>  n ~ (fx a, fy b, w at the principal point), turned to the camera.
    float w_here = wc + plane.c;
    float w_principal = w_here - plane.a * (float(p.x) - k.camera.cx) - plane.b * (float(p.y) - k.camera.cy);
    vec3 n = -vec3(k.camera.fx * plane.a, k.camera.fy * plane.b, w_principal);
    n *= inversesqrt(max(dot(n, n), 1e-30));
    bool near = abs(plane.c) < 3.0 * sigma_on(first, sigma); // within the tolerance of the depth there
    good = good && near && w_here > 1e-6 && !hole; // a kilometre of kilometres
    imageStore(depth_out, here, vec4(hole ? 0.0 : good ? 1.0 / w_here : zc));
    n = good ? n : vec3(0.0);
    imageStore(normals_out, 3 * here, vec4(n.x));
    imageStore(normals_out, 3 * here + 1, vec4(n.y));
    imageStore(normals_out, 3 * here + 2, vec4(n.z));
}
