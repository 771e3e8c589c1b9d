// HBAO: the horizon above the tangent plane along directions in the image, each rise of it attenuated by the distance of
// the sample that caused it.
//
// Bavoil, Sainz, Dimitrov, "Image-space horizon-based ambient occlusion" (2008) and NVIDIA's public samples. Elevations are
// measured from the plane parallel to the image. Departures: samples on the tangent plane are left out, whatever the bias.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/hbao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { HbaoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"

HbaoConstants h;

// Sine of the tangent plane's elevation along an image offset, and with the bias added; 1 where that is overhead.
float biased_tangent(Surface s, vec2 direction) {
    vec3 ray = s.point / s.point.z;
    vec3 step = vec3(direction / vec2(k.camera.fx, k.camera.fy), 0.0); // what one pixel adds to the ray
    // The point where the plane meets the ray one pixel on, less this one; only its direction counts.
    vec3 tangent = step * dot(s.normal, ray) - ray * dot(s.normal, step);
    tangent *= dot(s.normal, ray) < 0.0 ? -1.0 : 1.0;
    float inverse = inversesqrt(max(dot(tangent, tangent), 1e-30));
    float sine = -tangent.z * inverse, cosine = sqrt(positive(1.0 - sine * sine));
    bool overhead = cosine * h.bias_cosine - sine * h.bias_sine <= 0.0; // at 90 degrees and beyond
    return overhead ? 1.0 : sine * h.bias_cosine + cosine * h.bias_sine;
}

void main() {
    h = constants;
    k = h.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);
    float phi = noise.x * 6.2831853 / float(h.directions);
    vec2 turned = vec2(cos(phi), sin(phi));
    float inverse_r2 = h.attenuation / (k.radius * k.radius), inverse_steps = 1.0 / float(h.steps + 1);

    float occlusion = 0.0;
    int i = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        // The circle of radius R parallel to the image; pixels need not be square.
        vec2 line = turned * vec2(k.camera.fx, k.camera.fy) * (k.radius / s.point.z);
        turned = vec2(turned.x * h.turn_cosine - turned.y * h.turn_sine, turned.y * h.turn_cosine + turned.x * h.turn_sine);
        float reach = length(line);
        March march = cut_at_border(vec2(p), line / reach, reach);
        float horizon = biased_tangent(s, march.direction);
        float jitter = fract(noise.y + float(i) * 0.6180339887);
        int j = 0;
        do {
            ivec2 q = pixel_along(vec2(p), march, 1.0 + (float(j) + jitter) * inverse_steps * march.within);
            float zq = imageLoad(depth_in, index_of(q)).x;
            vec3 apart = ray_of(vec2(q)) * zq - s.point;
            float away2 = dot(apart, apart) + 1e-20, inverse = quick_scale * quick_inversesqrt(away2); // to 7e-4
            bool counts = zq > 0.0 && away2 < k.radius * k.radius && rises(s, apart, away2 * inverse);
            float sine = -apart.z * inverse;
            bool higher = counts && sine > horizon;
            occlusion += higher ? (1.0 - away2 * inverse_r2) * (sine - horizon) : 0.0;
            horizon = higher ? sine : horizon;
        } while (++j < h.steps);
    } while (++i < h.directions);
    float share = 1.0 / float(h.directions);
    finish(s, !(z > 0.0), here, 1.0 - h.contrast * occlusion * share);
}
