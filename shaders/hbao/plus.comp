// HBAO+: taps along directions in the image, each weighed by its sine above the tangent plane and by its distance. There is no
// horizon, so their order does not matter. Occluders are points.
//
// Bavoil, "Deinterleaved Texturing for Cache-Efficient Interleaved Sampling" (2014) and NVIDIA's HBAO+ (2014). Departures:
// the radius is metric and taps count by their distance in space; rule (2) besides the bias; no exponent, for which the tone
// curve stands; one set of taps in place of separate fine and coarse ones; the blur is the one all methods share.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/hbao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_interleaved) const int interleaved = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in; // with `interleaved` the 16 layers of hbao/layers
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { HbaoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "lib/taps.glsl"

// Threads of a layer, every fourth pixel of every fourth row, share their noise and read that layer only: neighbouring threads
// then read neighbouring texels. Taps come to lie on the layer's pixels.
int layer_index(ivec2 q) {
    ivec2 plane = layer_size(k.size), cell = q >> 2;
    return (((q.y & 3) << 2 | (q.x & 3)) * plane.y + cell.y) * plane.x + cell.x;
}

Tap tap_of_layer(Surface s, ivec2 p, ivec2 q) {
    q = p + ivec2(nearest(0.25 * float(q.x - p.x)), nearest(0.25 * float(q.y - p.y))) * 4;
    bool seen = inside(q);
    float z = imageLoad(depth_in, seen ? layer_index(q) : 0).x;
    return tap_of(s, seen && z > 0.0, ray_of(vec2(q)) * z);
}

// Sixteen pairs of numbers, one for each layer: the first in the order of Bayer's matrix, the second by the golden ratio.
vec2 noise_of_layer(ivec2 p) {
    int x = p.x ^ p.y;
    int order = (x & 1) << 3 | (p.y & 1) << 2 | (x & 2) | (p.y & 2) >> 1;
    return fract(vec2((float(order) + 0.5) / 16.0, fract(float(order) * 0.6180339887 + 0.5)) + k.turn);
}

void main() {
    HbaoConstants h = constants;
    k = h.screen;
    int layer = int(gl_GlobalInvocationID.z);
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (interleaved != 0) p = 4 * p + ivec2(layer & 3, layer >> 2);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, interleaved != 0 ? layer_index(p) : here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = interleaved != 0 ? noise_of_layer(p) : noise_at(p);
    vec2 radii = disc_px(s);
    float nearest_share = 1.0 / max(min(radii.x, radii.y), 1e-6); // one pixel
    float phi = noise.x * 6.2831853 / float(h.directions);
    vec2 direction = vec2(cos(phi), sin(phi));
    float inverse_r2 = h.attenuation / (k.radius * k.radius), inverse_steps = 1.0 / float(h.steps + 1);

    float sum = 0.0;
    int i = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        int j = 0;
        do {
            ivec2 q = pixel_of_disc(p, radii, direction, nearest_share + (float(j) + noise.y) * inverse_steps);
            Tap t;
            if (interleaved != 0) t = tap_of_layer(s, p, q);
            else t = tap_at(s, q);
            float sine = dot(s.normal, t.apart) * t.inverse;
            sum += t.counts ? positive(sine - h.bias_sine) * positive(1.0 - t.away2 * inverse_r2) : 0.0;
        } while (++j < h.steps);
        direction = turned_by(direction, h.turn_cosine, h.turn_sine);
    } while (++i < h.directions);
    sum *= h.contrast / ((1.0 - h.bias_sine) * float(h.directions * h.steps));
    finish(s, !(z > 0.0), here, 1.0 - sum);
}
