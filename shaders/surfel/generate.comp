// Visibility of every pixel from the surfels around it: each slice of the hemisphere is 32 sectors of equal cosine weight,
// and every surfel that a slice meets closes those it covers (visibility bitmask, Therrien et al. 2023; slices and their
// cosine measure, Jimenez et al. 2016). A surfel is a piece of surface with a direction and a thickness, not a point: between
// two samples nothing leaks, and light passes behind what is thin.
//
// All angles of a slice are measured from the eye vector V, positive towards T. They are compared as turns,
// s < 0 ? c - 1 : 1 - c of a vector with |c| + |s| = 1, which need no arc function.
//
// Both sides of a slice are marched at once, as the two components of a vector: two independent chains of arithmetic keep
// a processor twice as busy as one.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"

layout(constant_id = spec_slices) const int slices = 2;
layout(constant_id = spec_steps) const int steps = 8;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer surfels;
layout(binding = 1, r32f) readonly uniform imageBuffer normals;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, r32f) writeonly uniform imageBuffer raw;
layout(binding = 17, r32f) writeonly uniform imageBuffer coverage;
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

#include "lib/noise.glsl"
#include "lib/normal.glsl"
#include "lib/surface.glsl"
#include "lib/surfel.glsl"

const float pi = 3.14159265358979, golden = 0.618034;
const vec2 sides = vec2(1.0, -1.0);

// Compare and select: min and max mind NaN, which costs.
vec2 least(vec2 a, vec2 b) { return mix(b, a, lessThan(a, b)); }
vec2 most(vec2 a, vec2 b) { return mix(b, a, greaterThan(a, b)); }
vec4 between(vec4 x, float low, float high) {
    x = mix(x, vec4(low), lessThan(x, vec4(low)));
    return mix(x, vec4(high), greaterThan(x, vec4(high)));
}
// To 0.07 %: lengths of directions, not positions.
vec2 inverse_length(vec2 squared) { return vec2(quick_inversesqrt(squared.x), quick_inversesqrt(squared.y)) * quick_scale; }
vec2 length_of(vec2 squared) { return squared * inverse_length(squared + 1e-30); }

// Monotonic in the angle of (c, s), from -2 at -pi to 2 at pi.
vec4 turn(vec4 c, vec4 s) {
    vec4 t = 1.0 - c / (abs(c) + abs(s) + 1e-20);
    return mix(t, -t, lessThan(s, vec4(0.0)));
}

// arc tangent on [-1, 1] to 1e-5 (Abramowitz and Stegun 4.4.49).
vec4 arc(vec4 x) {
    vec4 x2 = x * x;
    return x * (0.9998660 + x2 * (-0.3302995 + x2 * (0.1801410 + x2 * (-0.0851330 + x2 * 0.0208351))));
}

struct Slice {
    float n_cos, n_sin; // of the projected normal's angle n from the eye vector
    float first, last;  // turns of n -+ pi/2
    float start, scale; // sectors before angle t = start + scale (M(t) of the cosine measure), dither included
};

// 32 (A(n - pi/2) + M(t)) / F + dither, with A(t) = (cos n + 2 t sin n - cos(2t - n)) / 4 and M(t) = sign(t) A(t).
vec4 sectors(Slice slice, vec4 turns) {
    vec4 c = 1.0 - abs(turns);   // |c| + |s| = 1
    vec4 y = 2.0 * abs(c) - 1.0; // tangent of pi/4 - t, with t folded into [0, pi/2]
    vec4 angle = 0.25 * pi - arc(y);
    vec4 r = 1.0 / (1.0 + y * y);
    vec4 cos_2t = 2.0 * y * r, sin_2t = (1.0 - y * y) * r;
    bvec4 wide = lessThan(c, vec4(0.0));
    angle = mix(angle, pi - angle, wide);
    sin_2t = mix(sin_2t, -sin_2t, wide);
    bvec4 negative = lessThan(turns, vec4(0.0));
    vec4 sine = mix(vec4(slice.n_sin), vec4(-slice.n_sin), negative);
    vec4 measure = slice.n_cos + (2.0 * angle - sin_2t) * sine - cos_2t * slice.n_cos;
    return slice.start + mix(vec4(slice.scale), vec4(-slice.scale), negative) * measure;
}

// Pixels from p to the border of the image.
float to_border(vec2 p, vec2 direction) {
    vec2 room = mix(p + 0.49, vec2(k.size) - 0.51 - p, greaterThan(direction, vec2(0.0)));
    vec2 at = room / max(abs(direction), vec2(1e-6));
    return min(at.x, at.y);
}

uint bits_below(int n) { return n > 31 ? 0xffffffffu : ~(0xffffffffu << n); }

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, k.size))) return;
    int here = index_of(pixel);
    float own = uintBitsToFloat(imageLoad(surfels, here).x);
    Surface surface = surface_at(pixel, own, here);
    float z = surface.point.z;
    vec2 ray = ray_of(vec2(pixel)).xy;
    vec3 eye = surface.eye;
    float distance = -dot(surface.point, eye);
    vec3 n = surface.normal;
    // Seen from behind its own plane nothing is defined: bend to the eye.
    n = normalize(n + eye * max(0.01 - dot(n, eye), 0.0));

    // Two axes across the eye vector, whose z is below 0 (Duff et al. 2017).
    float b = 1.0 / (eye.z - 1.0), xy = eye.x * eye.y * b;
    vec3 e1 = vec3(1.0 + eye.x * eye.x * b, xy, eye.x), e2 = vec3(xy, 1.0 + eye.y * eye.y * b, eye.y);

    vec2 noise = noise_at(pixel);
    float radius2 = k.radius * k.radius;
    float reach = k.radius * inversesqrt(max(z * z - radius2, 1e-4 * z * z)); // in units of the image plane
    vec2 per_px = 1.0 / vec2(k.camera.fx, k.camera.fy);
    float lowest2 = k.tangent_sine * k.tangent_sine;
    float open = 0.0, all = 0.0;
    vec2 known = vec2(0.0);

    for (int i = 0; i < slices; ++i) {
        float phi = pi * (float(i) + noise.x) / float(slices);
        vec3 tangent = e1 * cos(phi) + e2 * sin(phi);
        vec2 in_slice = vec2(dot(n, eye), dot(n, tangent)); // projected normal, towards V and T
        float weight = sqrt(dot(in_slice, in_slice));
        Slice slice;
        slice.n_cos = in_slice.x / max(weight, 1e-6);
        slice.n_sin = in_slice.y / max(weight, 1e-6);
        float angle = atan(slice.n_sin, slice.n_cos);
        float full = slice.n_cos + angle * slice.n_sin;
        slice.scale = 8.0 / full;
        slice.start = slice.scale * (2.0 * slice.n_cos + (2.0 * angle - pi) * slice.n_sin) + fract(noise.x * 7.0 + golden * float(i));
        vec4 ends = turn(vec4(slice.n_sin, -slice.n_sin, 0.0, 0.0), vec4(-slice.n_cos, slice.n_cos, 1.0, 1.0));
        slice.first = ends.x;
        slice.last = ends.y;

        vec2 along = vec2(k.camera.fx, k.camera.fy) * (tangent.xy - ray * tangent.z);
        along *= inversesqrt(dot(along, along));
        float per_pixel = length(along * per_px); // metres at z = 1 m
        float half_pixel = 0.5 * s.lengthen * per_pixel;
        float full_reach = reach / per_pixel;
        vec2 far = max(min(vec2(full_reach), vec2(to_border(vec2(pixel), along), to_border(vec2(pixel), -along))), 1.0) - 1.0;
        vec2 u = fract(noise.y + golden * vec2(2 * i, 2 * i + 1));

        uint closed = 0u;
        vec2 before = vec2(0.0);
        vec2 x = u * (1.0 / float(steps));
        vec2 now = 1.0 + x * length_of(x) * far;
        for (int j = 0; j < steps; ++j) {
            x = (float(j + 1) + u) * (1.0 / float(steps));
            vec2 next = 1.0 + x * length_of(x) * far;
            vec2 qx = float(pixel.x) + along.x * sides * now, qy = float(pixel.y) + along.y * sides * now;
            ivec2 ix = ivec2(nearest(qx.x), nearest(qx.y)), iy = ivec2(nearest(qy.x), nearest(qy.y));
            bool within_a = inside(ivec2(ix.x, iy.x)), within_b = inside(ivec2(ix.y, iy.y));
            uvec2 a = imageLoad(surfels, within_a ? iy.x * k.size.x + ix.x : here).xy;
            uvec2 b = imageLoad(surfels, within_b ? iy.y * k.size.x + ix.y : here).xy;
            vec2 zq = uintBitsToFloat(uvec2(a.x, b.x));
            bvec2 seen = bvec2(within_a && zq.x > 0.0, within_b && zq.y > 0.0);
            known += mix(vec2(0.0), vec2(1.0), seen);

            // From the pixel's point to the sample's; differences first: far away coordinates cancel badly.
            vec2 dz = zq - z;
            vec2 dx = vec2(ix - pixel.x) * per_px.x * zq + ray.x * dz, dy = vec2(iy - pixel.y) * per_px.y * zq + ray.y * dz;
            vec2 d2 = dx * dx + dy * dy + dz * dz;
            vec2 rise = n.x * dx + n.y * dy + n.z * dz - surface.rise;
            bvec2 above = bvec2(rise.x > 0.0 && rise.x * rise.x > lowest2 * d2.x, rise.y > 0.0 && rise.y * rise.y > lowest2 * d2.y);

            // In the slice, towards V and towards T: the point, the gaze at it, and across the gaze, outwards.
            vec2 pv = eye.x * dx + eye.y * dy + eye.z * dz, pt = tangent.x * dx + tangent.y * dy + tangent.z * dz;
            vec2 gv = pv - distance, gt = pt;
            vec2 g = inverse_length(gv * gv + gt * gt + 1e-30);
            gv *= g;
            gt *= g;
            vec2 ov = gt * sides, ot = -gv * sides;
            // Where the surfel lies in the slice: N_q x (T x V).
            vec3 na = normal_of(a.y), nb = normal_of(b.y);
            vec2 nx = vec2(na.x, nb.x), ny = vec2(na.y, nb.y), nz = vec2(na.z, nb.z);
            vec2 lv = -(tangent.x * nx + tangent.y * ny + tangent.z * nz), lt = eye.x * nx + eye.y * ny + eye.z * nz;
            vec2 l = inverse_length(lv * lv + lt * lt + 1e-30);
            l *= sign(lv * ov + lt * ot);
            lv *= l;
            lt *= l;
            vec2 size = zq * half_pixel / most(lv * ov + lt * ot, vec2(0.1));
            // Clipped to the radius.
            vec2 middle = pv * lv + pt * lt;
            vec2 chord = middle * middle - d2 + radius2;
            chord = length_of(vec2(positive(chord.x), positive(chord.y)));
            vec2 back = least((now - before) * size, middle + chord), ahead = least((next - now) * size, chord - middle);
            vec2 fv = pv - lv * back, ft = pt - lt * back, uv = pv + lv * ahead, ut = pt + lt * ahead;
            vec2 deep = vec2(thickness_of(a.y), thickness_of(b.y)) * s.thickest;
            vec2 deep_v = gv * deep, deep_t = gt * deep;

            // The two of the four corners that are farthest apart in angle.
            vec2 fdv = fv + deep_v, fdt = ft + deep_t, udv = uv + deep_v, udt = ut + deep_t;
            bvec2 turns = greaterThan(fv * ut, ft * uv), deep_turns = greaterThan(fdv * udt, fdt * udv);
            vec2 low_v = mix(uv, fv, turns), low_t = mix(ut, ft, turns), high_v = mix(fv, uv, turns), high_t = mix(ft, ut, turns);
            vec2 dlow_v = mix(udv, fdv, deep_turns), dlow_t = mix(udt, fdt, deep_turns);
            vec2 dhigh_v = mix(fdv, udv, deep_turns), dhigh_t = mix(fdt, udt, deep_turns);
            bvec2 lower = greaterThan(dlow_v * low_t, dlow_t * low_v), higher = greaterThan(high_v * dhigh_t, high_t * dhigh_v);
            low_v = mix(low_v, dlow_v, lower);
            low_t = mix(low_t, dlow_t, lower);
            high_v = mix(high_v, dhigh_v, higher);
            high_t = mix(high_t, dhigh_t, higher);

            vec4 edge = between(turn(vec4(low_v, high_v), vec4(low_t, high_t)), slice.first, slice.last);
            ivec4 bits = ivec4(sectors(slice, edge));
            uint mask_a = bits_below(bits.z) & ~bits_below(bits.x), mask_b = bits_below(bits.w) & ~bits_below(bits.y);
            closed |= seen.x && above.x && d2.x <= radius2 ? mask_a : 0u;
            closed |= seen.y && above.y && d2.y <= radius2 ? mask_b : 0u;

            before = now;
            now = next;
        }
        float measure = weight * full;
        all += measure;
        open += measure * (1.0 - float(bitCount(closed)) * (1.0 / 32.0));
    }
    finish(surface, !(own > 0.0), here, open / max(all, 1e-6), (known.x + known.y) / float(2 * slices * steps));
}
