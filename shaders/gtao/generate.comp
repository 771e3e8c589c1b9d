// GTAO and visibility bitmask: visibility of each pixel from slices through the eye, marched to both sides.
//
// Jimenez, Wu, Pesce, Jarabo, "Practical Real-Time Strategies for Accurate Indirect Occlusion" (2016): the open arc between
// two horizons, cosine-weighted in closed form. Therrien, Levesque, Gilet, "Screen Space Indirect Lighting with Visibility
// Bitmask" (2023): 32 sectors in place of the horizons, so that light passes behind thin things.
// Departures: slices are uniform about the eye's ray and weighted by their own full measure, which makes a plane exactly
// open for any number of slices; samples on the tangent plane are left out; sectors are of equal measure, not angle.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/gtao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_bitmask) const int bitmask = 0;
layout(constant_id = spec_falloff) const int falloff = falloff_hard;
layout(constant_id = spec_square) const int square = 1;
layout(constant_id = spec_uniform) const int equal_angles = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, r32f) readonly uniform imageBuffer normals;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, r32f) uniform writeonly imageBuffer raw;
layout(binding = 17, r32f) uniform writeonly imageBuffer coverage;
layout(binding = 32, scalar) uniform Constants { GtaoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"

const float pi = 3.14159265;
const float golden = 0.6180339887;
const float nearest_px = 1.3; // so that no first step rounds to the pixel itself

GtaoConstants g;

// One half plane through the eye's ray.
struct Slice {
    float cosine, sine, angle; // gamma, the projected normal's angle from the eye, positive towards side +1
    float below, full;         // measure of the open slice on side -1, and of all of it
};

// Cosine-weighted measure of the arc from the eye's ray to the angle acos(c) on a side: F of eq. 4 in closed form.
float arc_measure(Slice slice, float c, float side) {
    float sine2 = positive(1.0 - c * c);
    return 0.5 * (slice.cosine * sine2 + side * slice.sine * (angle_of(c) - sqrt(sine2) * c));
}

// Share of the slice's measure that lies before the angle acos(c) on a side, counted from the end of side -1; directions
// behind the tangent plane are that end or the other.
float quantile(Slice slice, float c, float side) {
    float sine = side * sqrt(positive(1.0 - c * c));
    bool behind = c * slice.cosine + sine * slice.sine < 0.0;
    float share = equal_angles != 0 ? (side * angle_of(c) - slice.angle) / pi + 0.5
                                    : (slice.below + side * arc_measure(slice, c, side)) / slice.full;
    return behind ? 0.5 + 0.5 * side : clamp(share, 0.0, 1.0);
}

uint sectors_below(int i) { return i < 32 ? (1u << i) - 1u : ~0u; }

// The sectors between two cosines, rounded by the slice's own dither so that the expected length is exact.
uint sectors(Slice slice, float front, float back, float side, float dither) {
    int a = int(quantile(slice, front, side) * 32.0 + dither), b = int(quantile(slice, back, side) * 32.0 + dither);
    return sectors_below(max(a, b)) & ~sectors_below(min(a, b));
}

float falloff_weight(float away2, float away) {
    if (falloff == falloff_hard) return away2 <= k.radius * k.radius ? 1.0 : 0.0;
    return clamp(g.falloff_add + g.falloff_scale * (falloff == falloff_linear ? away : away2), 0.0, 1.0);
}

float clamped_cosine(float c) { return at_most_one(positive(c + 1.0) * 0.5) * 2.0 - 1.0; }

// What a side of a slice has met.
struct Side {
    float horizon; // cosine of the horizon, gtao
    uint occupied; // sectors, bitmask
    float known;   // samples on known depth
};

void look(Surface s, Slice slice, ivec2 q, float low, float side, float dither, inout Side met) {
    float z = imageLoad(depth_in, index_of(q)).x;
    vec3 sample_point = ray_of(vec2(q)) * z, apart = sample_point - s.point;
    float away2 = dot(apart, apart) + 1e-20;
    float inverse = inverse_root(away2), away = away2 * inverse;
    float weight = falloff_weight(away2, away);
    bool counts = z > 0.0 && weight > 0.0 && rises(s, apart, away);
    float front = dot(apart, s.eye) * inverse;
    met.known += z > 0.0 ? 1.0 : 0.0;
    if (bitmask == 0) {
        float horizon = falloff == falloff_hard ? front : low + (front - low) * weight;
        met.horizon = counts && horizon > met.horizon ? horizon : met.horizon;
    } else {
        float thickness = g.thickness + g.thickness_per_z * z;
        vec3 behind = apart + sample_point * (thickness * inverse_root(dot(sample_point, sample_point) + 1e-20));
        float back = dot(behind, s.eye) * inverse_root(dot(behind, behind) + 1e-20);
        met.occupied |= counts ? sectors(slice, clamped_cosine(front), clamped_cosine(back), side, dither) : 0u;
    }
}

void main() {
    g = constants;
    k = g.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);
    vec3 e1 = normalize(vec3(1.0, 0.0, 0.0) - s.eye * s.eye.x), e2 = cross(s.eye, e1);
    float phi = noise.x * pi / float(g.slices);
    vec2 turned = vec2(cos(phi), sin(phi));
    float inverse_steps = 1.0 / float(g.steps);

    float open = 0.0, full = 0.0, known = 0.0;
    int i = 0;
    do {
        vec3 d = e1 * turned.x + e2 * turned.y, axis = cross(d, s.eye);
        turned = vec2(turned.x * g.turn_cosine - turned.y * g.turn_sine, turned.y * g.turn_cosine + turned.x * g.turn_sine);
        vec3 projected = s.normal - axis * dot(s.normal, axis);
        float weight2 = max(dot(projected, projected), 1e-20), weight = sqrt(weight2);
        Slice slice;
        slice.cosine = clamp(dot(projected, s.eye) / weight, 0.0, 1.0);
        slice.sine = clamp(dot(projected, d) / weight, -1.0, 1.0);
        slice.angle = sign(slice.sine) * angle_of(slice.cosine);
        slice.full = slice.cosine + slice.angle * slice.sine;
        slice.below = 0.5 * slice.cosine + 0.25 * (2.0 * slice.angle - pi) * slice.sine;

        March ahead, behind;
        march_both_ways(s, vec2(p), d, ahead, behind);
        float dither = fract(noise.x * 7.0 + float(i) * golden);
        Side plus = Side(-slice.sine, 0u, 0.0), minus = Side(slice.sine, 0u, 0.0);
        float jitter = noise.y + float(i) * golden;
        int j = 0;
        do { // a loop that asks first runs once more on lavapipe, with every lane off
            float x = (float(j) + fract(jitter)) * inverse_steps;
            jitter += float(g.steps) * golden;
            x = square != 0 ? x * x : pow(x, g.distribution);
            look(s, slice, pixel_along(vec2(p), ahead, nearest_px + x * ahead.within), -slice.sine, 1.0, dither, plus);
            look(s, slice, pixel_along(vec2(p), behind, nearest_px + x * behind.within), slice.sine, -1.0, dither, minus);
        } while (++j < g.steps);
        float measure = bitmask != 0
            ? slice.full * (1.0 - float(bitCount(plus.occupied | minus.occupied)) / 32.0)
            : arc_measure(slice, clamped_cosine(plus.horizon), 1.0) + arc_measure(slice, clamped_cosine(minus.horizon), -1.0);
        weight = weight2 < 1e-10 ? 0.0 : weight;
        open += weight * measure;
        full += weight * slice.full;
        known += plus.known * (ahead.within / ahead.reach) + minus.known * (behind.within / behind.reach);
    } while (++i < g.slices);
    finish(s, !(z > 0.0), here, open / max(full, 1e-6), known * inverse_steps / float(2 * g.slices));
}
