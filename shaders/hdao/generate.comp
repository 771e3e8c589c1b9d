// HDAO: pairs of mirrored taps, counted where they stand out from the surface: nearer taps on both sides make a valley.
// Occluders are points.
//
// AMD's HDAO sample of the Radeon SDK (2009-2010): its test of z is `z`, that of later variants by the angle between both
// taps `angle`. The default, `plane`, measures from the tangent plane, and each side by itself: tilted surfaces and corners
// of one side count, too. Departures: the radius is metric and round; a spiral of pairs in place of fixed rings, denser close
// by as the rings' weights 1 / distance ask; rule (2).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/hdao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_test) const int test = test_plane;
layout(constant_id = spec_normal_rejection) const int normal_rejection = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { HdaoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "lib/taps.glsl"

const float straight = -0.98;  // cosine of the angle between both taps, beyond which they are a plane
const float opposite = 0.04;   // least height of their mean direction above it
const float same_plane = 0.98; // cosine between two normals, beyond which they are of one plane

float accept; // a, metres

// Whether a tap stands nearer to the camera than the centre, within `accept` and the radius.
bool nearer(Tap t) { return t.known && -t.apart.z > accept && -t.apart.z < k.radius; }

bool stands_out(Surface s, Tap t) { return t.counts && dot(s.normal, t.apart) > accept; }

float value_of(Surface s, Tap plus, Tap minus) {
    if (test == test_plane) return 0.5 * (float(stands_out(s, plus)) + float(stands_out(s, minus)));
    if (test == test_z) return float(nearer(plus) && nearer(minus));
    float r2 = k.radius * k.radius;
    vec3 a = plus.apart * plus.inverse, b = minus.apart * minus.inverse;
    bool valley = plus.known && minus.known && plus.away2 < r2 && minus.away2 < r2 && dot(a, b) > straight;
    return float(valley && dot(a + b, s.normal) > opposite);
}

vec3 normal_near(ivec2 q) {
    bool seen = inside(q);
    vec3 n = normal_at(seen ? index_of(q) : 0);
    return seen ? n : vec3(0.0);
}

// The gain of the published normal rejection: four mirrored pairs of normals at a quarter of the radius (eight pixels in the
// sample). Pairs of one plane add nothing; where all are, nothing occludes.
float gain_of(ivec2 p, vec2 radii) {
    float gain = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 direction = vec2(i < 3 ? i - 1 : 1, i < 3 ? 1 : 0);
        direction *= inversesqrt(dot(direction, direction));
        vec3 a = normal_near(pixel_of_disc(p, radii, direction, 0.25)), b = normal_near(pixel_of_disc(p, radii, -direction, 0.25));
        bool known = dot(a, a) > 0.0 && dot(b, b) > 0.0;
        gain += known && dot(a, b) <= same_plane ? 0.25 * (1.0 - 0.25 * abs(dot(a, b))) : 0.0;
    }
    return gain > 0.0 ? 0.5 + gain : 0.0;
}

void main() {
    HdaoConstants h = constants;
    k = h.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);
    vec2 radii = disc_px(s);
    accept = h.accept + h.sigmas * sigma_of(s.point.z);
    float phi = 3.14159265 * noise.x, inverse_pairs = 1.0 / float(h.pairs);
    vec2 direction = vec2(cos(phi), sin(phi));

    float occluded = 0.0;
    int i = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        float share = (float(i) + noise.y) * inverse_pairs;
        ivec2 q = pixel_of_disc(p, radii, direction, share);
        occluded += value_of(s, tap_at(s, q), tap_at(s, 2 * p - q));
        direction = turned_by(direction, h.turn_cosine, h.turn_sine);
    } while (++i < h.pairs);
    occluded *= inverse_pairs * (normal_rejection != 0 ? gain_of(p, radii) : 1.0);
    finish(s, !(z > 0.0), here, 1.0 - occluded);
}
