// ABAO: angle-based ambient occlusion. Lines through the pixel; the angle left open between the highest elevations on both
// sides of a line, as a share of a half turn. Occluders are a height field: all behind a tap is solid.
//
// Mittring, "The Technology Behind the Unreal Engine 4 Elemental Demo" (2012), and Yeung, "Angle Based SSAO" (2012): pairs of
// opposite taps, uniform weight in angle, no cosine. Departures: several steps a side, whose highest elevation counts;
// elevations are measured from the tangent plane and fade with distance; exact arc sines; rule (2).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/abao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_published) const int published = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { AbaoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "lib/taps.glsl"

const float half_pi = 1.57079633;

AbaoConstants a;

// One side of a line.
struct Side {
    float elevation; // theta: the highest above the tangent plane, faded
    float known;     // 1: a tap of known depth
};

void look(Surface s, ivec2 q, inout Side side) {
    Tap t = tap_at(s, q);
    float elevation = half_pi - angle_of(clamp(dot(s.normal, t.apart) * t.inverse, -1.0, 1.0));
    elevation *= 1.0 - a.fade * t.away2 / (k.radius * k.radius);
    side.elevation = max(side.elevation, t.counts ? elevation : 0.0);
    side.known = t.known ? 1.0 : side.known;
}

void main() {
    a = constants;
    k = a.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);
    vec2 radii = disc_px(s);
    float nearest_share = 1.0 / max(min(radii.x, radii.y), 1e-6); // one pixel
    float phi = noise.x * 2.0 * half_pi / float(a.lines);
    vec2 direction = vec2(cos(phi), sin(phi));
    float inverse_steps = 1.0 / float(a.steps);

    float open = 0.0, weights = 0.0;
    int i = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        Side plus = Side(0.0, 0.0), minus = plus;
        int j = 0;
        do {
            float x = (float(j) + noise.y) * inverse_steps;
            float share = nearest_share + x * sqrt(x); // x^1.5: denser close by
            if (published != 0) share = sqrt((float(i) + 0.5) / float(a.lines));
            look(s, pixel_of_disc(p, radii, direction, share), plus);
            look(s, pixel_of_disc(p, radii, -direction, share), minus);
        } while (++j < a.steps);
        float weight = published != 0 ? 0.5 * (plus.known + minus.known) : 1.0;
        open += weight * (1.0 - min(1.0, (plus.elevation + minus.elevation) / (2.0 * half_pi)));
        weights += weight;
        direction = turned_by(direction, a.turn_cosine, a.turn_sine);
    } while (++i < a.lines);
    finish(s, !(z > 0.0), here, weights > 0.0 ? open / weights : 1.0);
}
