// Second pass of depth preparation: each pixel takes the value of a plane through its 5x5 surroundings. The few samples of the
// next pass then represent all pixels of a large window.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer samples; // 1/z, 0 where there is none
layout(binding = 1, r32f) readonly uniform imageBuffer relief;
layout(binding = 16, r32f) uniform writeonly imageBuffer averages;
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants k; };

#include "fit_plane/fit_plane.glsl"

void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float w = imageLoad(samples, here).x;
    bool hole = !(w > 0.0);
    float wc = hole ? 1.0 : w, zc = 1.0 / wc;
    Plane expected = slope_at(p, wc, 2), plane;
    // A slope up to 45 degrees more is still the pixel's own surface.
    float sigma = sigma_on(expected, sigma_of(zc) * wc * wc) * relief_at(here);
    float narrow = 1.0 / (3.0 * sigma + 0.7 * 2.8 * wc / k.camera.fx);
    bool good = solve(square5(p, wc, 1.0, expected, narrow), plane); // not good: the plane is level, the pixel keeps its value
    imageStore(averages, here, vec4(hole ? 0.0 : wc + plane.c));
}
