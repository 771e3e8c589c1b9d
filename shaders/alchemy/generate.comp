// Alchemy ambient obscurance: taps in a disc of the image, each weighed by how steeply it stands above the surface and by its
// distance. Occluders are points: nothing behind a tap is taken to be solid.
//
// McGuire, Osman, Bukowski, Hennessy, "The Alchemy Screen-Space Ambient Obscurance Algorithm" (2011), eq. 10, and McGuire,
// Mara, Luebke, "Scalable Ambient Obscurance" (2012), section 2.2, with `sao`. Departures: intensity and contact distance are
// in radii, so that the estimate has no unit; a tap counts by its distance in space; rule (2) stands in place of a bias.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/alchemy.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_sao) const int sao = 0;
layout(constant_id = spec_pyramid) const int pyramid = 0;
layout(constant_id = spec_renormalise) const int renormalise = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 3, rg32ui) readonly uniform uimageBuffer levels; // depth and the pixel it is of
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { AlchemyConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "lib/taps.glsl"

// Beginnings of the levels, and their rows' lengths.
int starts[pyramid_levels + 1];
int widths[pyramid_levels + 1];

// The tap at a pixel, read from level floor(log2(distance)) - 3 of the pyramid (section 2.3 of the SAO paper). Where that is
// not 0, its place is the pixel whose depth the texel holds, not the texel's centre.
Tap tap_of_level(Surface s, ivec2 q, ivec2 p) {
    if (pyramid == 0) return tap_at(s, q);
    vec2 offset = vec2(q - p);
    int level = clamp(((floatBitsToInt(dot(offset, offset)) >> 23) - 127) / 2 - 3, 0, pyramid_levels); // half of log2
    bool seen = inside(q), coarse = seen && level > 0;
    uvec2 texel = imageLoad(levels, coarse ? starts[level] + (q.y >> level) * widths[level] + (q.x >> level) : 0).xy;
    float fine = imageLoad(depth_in, seen && !coarse ? index_of(q) : 0).x;
    float z = coarse ? uintBitsToFloat(texel.x) : fine;
    ivec2 at = coarse ? ivec2(texel.y & 0xffffu, texel.y >> 16) : q;
    return tap_of(s, seen && z > 0.0, ray_of(vec2(at)) * z);
}

void main() {
    AlchemyConstants a = constants;
    k = a.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p);
    vec2 radii = disc_px(s);
    bool wide = pyramid != 0 && s.radius_px > a.pyramid_px;
    for (int i = 1; pyramid != 0 && i <= pyramid_levels; ++i) {
        starts[i] = pyramid_start(k.size, i);
        widths[i] = pyramid_size(k.size, i).x;
    }
    float inverse_taps = 1.0 / float(a.taps), r2 = k.radius * k.radius;
    float angle = 6.2831853 * (0.5 * a.turns * inverse_taps + noise.x);
    vec2 direction = vec2(cos(angle), sin(angle));

    float sum = 0.0, known = 0.0;
    int i = 0;
    do { // the loop tests at its end: one that tests first runs once more on lavapipe, with all lanes off
        float share = (float(i) + noise.y) * inverse_taps; // of the disc's area; of its radius with SAO: denser close by
        ivec2 q = pixel_of_disc(p, radii, direction, sao != 0 ? share : sqrt(share));
        Tap t;
        if (wide) t = tap_of_level(s, q, p);
        else t = tap_at(s, q);
        float height = positive(dot(s.normal, t.apart) - a.bias);
        float weight = positive(r2 - t.away2) / r2; // SAO: eq. 3's (r^2 - v^2)^3, in radii
        float term = height / (t.away2 + a.contact2) * (sao != 0 ? weight * weight * weight : 1.0);
        sum += t.counts ? term : 0.0;
        known += t.known ? 1.0 : 0.0;
        direction = turned_by(direction, a.turn_cosine, a.turn_sine);
    } while (++i < a.taps);
    float wanted = renormalise != 0 ? max(known, 0.5 * float(a.taps)) : float(a.taps);
    // 2 R / N of (A1): eq. 10 with sigma = 1; 5 R / N with SAO.
    finish(s, !(z > 0.0), here, 1.0 - (sao != 0 ? 5.0 : 2.0) * k.radius * sum / wanted);
}
