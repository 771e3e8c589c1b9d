// GTAO and visibility bitmask: visibility of each pixel from slices through the eye, marched to both sides.
//
// Jimenez, Wu, Pesce, Jarabo, "Practical Real-Time Strategies for Accurate Indirect Occlusion" (2016): the open arc between
// two horizons, cosine-weighted in closed form. Therrien, Levesque, Gilet, "Screen Space Indirect Lighting with Visibility
// Bitmask" (2023): 32 sectors in place of the horizons, so that light passes behind thin things.
// Departures: slices are uniform about the eye's ray and weighted by their own full measure, which makes a plane exactly
// open for any number of slices; samples on the tangent plane are left out. Sectors are of equal measure, not angle, and
// samples count up to the radius.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/gtao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_bitmask) const int bitmask = 0;
layout(constant_id = spec_falloff) const int falloff = falloff_hard;
layout(constant_id = spec_square) const int square = 1;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { GtaoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"

const float pi = 3.14159265;
const float golden = 0.6180339887;
const float nearest_px = 1.3; // so that no first step rounds to the pixel itself

GtaoConstants g;

// A plane through the eye's ray. Angles in it are measured from the eye, positive towards side +1; the cosine-weighted
// measure of the arc from the eye to an angle t is a(t) = (cos n + 2 t sin n - cos(2 t - n)) / 4 (F of Jimenez et al. 2016).
struct Slice {
    float cosine, sine, angle; // of n, the projected normal's angle
    float full;                // measure of the open slice
    vec3 sectors;              // of 32: the dither and side -1's share of them, then per sin^2 t and per segment(cos t)
};

// Area that a chord at distance c from the centre cuts off the unit circle, acos(c) - c sqrt(1 - c^2), to 6e-6: then
// a(t) = (cos n sin^2 t + sin n segment(cos t)) / 2 needs no arc function. Sectors can do with 7e-4.
float segment(float c) {
    float t = positive(1.0 - abs(c));
    float root = bitmask != 0 ? t * quick_scale * quick_inversesqrt(t) : sqrt(t);
    float area = t * root * (((-0.0112172 * t - 0.0182299) * t - 0.2857573) * t + 1.8860061);
    return c < 0.0 ? pi - area : area;
}

// Measure of the arc from the eye to the angle with cosine c on a side.
float arc_measure(Slice slice, float c, float side) {
    return 0.5 * (slice.cosine * positive(1.0 - c * c) + side * slice.sine * segment(c));
}

// Sectors of the slice that lie before the angle with cosine c on a side, counted from the end of side -1; a direction
// behind the tangent plane is that end or the other.
int sectors_before(Slice slice, float c, float side) {
    float n = slice.sectors.x + side * slice.sectors.y * positive(1.0 - c * c) + slice.sectors.z * segment(c);
    bool behind = c < -side * slice.sine;
    return min(max(nearest(behind ? 16.0 + 17.0 * side : n), 0), 32);
}

uint bits_below(int i) { return i < 32 ? (1u << i) - 1u : ~0u; }

// The sectors between two cosines.
uint sectors(Slice slice, float front, float back, float side) {
    int a = sectors_before(slice, front, side), b = sectors_before(slice, back, side);
    return bits_below(max(a, b)) & ~bits_below(min(a, b));
}

float falloff_weight(float away2, float away) {
    if (falloff == falloff_hard) return away2 <= k.radius * k.radius ? 1.0 : 0.0;
    return clamp(g.falloff_add + g.falloff_scale * (falloff == falloff_linear ? away : away2), 0.0, 1.0);
}

// The occluders found on one side of a slice.
struct Side {
    float horizon; // cosine of the horizon, gtao
    uint occupied; // sectors, bitmask
};

void look(Surface s, Slice slice, ivec2 q, float side, inout Side met) {
    float z = imageLoad(depth_in, index_of(q)).x;
    vec3 sample_point = ray_of(vec2(q)) * z, apart = sample_point - s.point;
    float away2 = dot(apart, apart) + 1e-20; // lengths to 7e-4 suffice: the error of the angles is smaller
    float inverse = quick_scale * quick_inversesqrt(away2), away = away2 * inverse;
    float weight = falloff_weight(away2, away);
    bool counts = z > 0.0 && weight > 0.0 && rises(s, apart, away);
    float front = dot(apart, s.eye) * inverse;
    if (bitmask == 0) {
        float low = -side * slice.sine;
        float horizon = falloff == falloff_hard ? front : low + (front - low) * weight;
        met.horizon = counts && horizon > met.horizon ? horizon : met.horizon;
    } else {
        vec3 behind = apart + sample_point * (g.thickness * quick_scale * quick_inversesqrt(dot(sample_point, sample_point) + 1e-20));
        float back = dot(behind, s.eye) * (quick_scale * quick_inversesqrt(dot(behind, behind) + 1e-20));
        met.occupied |= counts ? sectors(slice, front, back, side) : 0u;
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

    float open = 0.0, full = 0.0;
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
        float below = 0.5 * slice.cosine + 0.25 * (2.0 * slice.angle - pi) * slice.sine; // measure of side -1
        float dither = fract(noise.x * 7.0 + float(i) * golden) - 0.5; // so that the expected number of sectors is exact
        slice.sectors = vec3(32.0 * below, 16.0 * slice.cosine, 16.0 * slice.sine) / slice.full;
        slice.sectors.x += dither;

        March ahead, behind;
        march_both_ways(s, vec2(p), d, ahead, behind);
        Side plus = Side(-slice.sine, 0u), minus = Side(slice.sine, 0u);
        float jitter = noise.y + float(i) * golden;
        int j = 0;
        do { // a loop that tests first runs once more on lavapipe, with all lanes off
            float x = (float(j) + fract(jitter)) * inverse_steps;
            jitter += float(g.steps) * golden;
            x = square != 0 ? x * x : pow(x, g.distribution);
            look(s, slice, pixel_along(vec2(p), ahead, nearest_px + x * ahead.within), 1.0, plus);
            look(s, slice, pixel_along(vec2(p), behind, nearest_px + x * behind.within), -1.0, minus);
        } while (++j < g.steps);
        float measure = bitmask != 0
            ? slice.full * (1.0 - float(bitCount(plus.occupied | minus.occupied)) / 32.0)
            : arc_measure(slice, plus.horizon, 1.0) + arc_measure(slice, minus.horizon, -1.0);
        weight = weight2 < 1e-10 ? 0.0 : weight;
        open += weight * measure;
        full += weight * slice.full;
    } while (++i < g.slices);
    finish(s, !(z > 0.0), here, open / max(full, 1e-6));
}
