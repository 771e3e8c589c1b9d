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
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfels;
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
const float sector_count = 31.0; // so that a bit's place never reaches the width of a word

// Compare and select: min and max mind NaN, which costs.
vec2 least(vec2 a, vec2 b) { return mix(b, a, lessThan(a, b)); }
vec2 most(vec2 a, float b) { return mix(vec2(b), a, greaterThan(a, vec2(b))); }
vec4 least(vec4 a, vec4 b) { return mix(b, a, lessThan(a, b)); }
vec2 positive(vec2 x) { return vec2(positive(x.x), positive(x.y)); }
// To 0.07 %: lengths of directions, not positions.
vec2 inverse_length(vec2 squared) { return vec2(quick_inversesqrt(squared.x), quick_inversesqrt(squared.y)) * quick_scale; }

// x^1.5 on [0, 1] within 0.01: where the steps lie.
vec2 spread(vec2 x) { return x * fma(x, fma(x, vec2(-0.25), vec2(0.95)), vec2(0.3)); }

// Of the angle t of (c, s) with s >= 0: 1 - c / (|c| + s), monotonic from 0 to 2.
vec4 turn(vec4 c, vec4 s) { return 1.0 - c / (abs(c) + s + 1e-20); }

// 2 t - sin 2t and 1 - cos 2t of a turn's angle t in [0, pi].
void measures(vec4 turns, out vec4 along_sine, out vec4 along_cosine) {
    vec4 c = 1.0 - turns;                 // |c| + |s| = 1
    vec4 y = fma(abs(c), vec4(2.0), vec4(-1.0)); // tangent of pi/4 - t, with t folded into [0, pi/2]
    vec4 y2 = y * y;
    // Arc tangent on [-1, 1] to 1e-5 (Abramowitz and Stegun 4.4.49), doubled.
    vec4 arc = y * fma(y2, fma(y2, fma(y2, fma(y2, vec4(0.0416702), vec4(-0.1702660)), vec4(0.3602820)), vec4(-0.6605990)), vec4(1.9997320));
    vec4 r = 1.0 / (1.0 + y2);
    vec4 folded = 0.5 * pi - arc - (1.0 - y2) * r;
    along_sine = mix(folded, 2.0 * pi - folded, lessThan(c, vec4(0.0)));
    along_cosine = fma(-2.0 * y, r, vec4(1.0));
}

// Pixels from p to the border of the image.
float to_border(vec2 p, vec2 direction) {
    vec2 room = mix(p + 0.49, vec2(k.size) - 0.51 - p, greaterThan(direction, vec2(0.0)));
    vec2 at = room / max(abs(direction), vec2(1e-6));
    return min(at.x, at.y);
}

uint bits_below(int n) { return (1u << n) - 1u; }

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, k.size))) return;
    int here = index_of(pixel);
    float own = imageLoad(surfels, here).x;
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
    vec2 flat_eye = eye.xy * per_px, flat_normal = n.xy * per_px;
    float eye_per_z = distance / z, normal_per_z = dot(n, vec3(ray, 1.0));
    float lowest2 = k.tangent_sine * k.tangent_sine;
    float open = 0.0, all = 0.0;
    vec2 known = vec2(0.0);

    for (int i = 0; i < slices; ++i) {
        float phi = pi * (float(i) + noise.x) / float(slices);
        vec3 tangent = e1 * cos(phi) + e2 * sin(phi);
        vec2 in_slice = vec2(dot(n, eye), dot(n, tangent)); // projected normal, towards V and T
        float weight = sqrt(dot(in_slice, in_slice));
        float n_cos = in_slice.x / max(weight, 1e-6), n_sin = in_slice.y / max(weight, 1e-6);
        float angle = atan(n_sin, n_cos);
        float full = n_cos + angle * n_sin;
        // Sectors before an angle t to the side of T: start + scale ((1 - cos 2t) cos n + (2t - sin 2t) sin n); to the
        // other side, with t counted that way, start - scale (... - ... sin n).
        float scale = 0.25 * sector_count / full;
        vec2 side_scale = vec2(scale, -scale), scaled_cos = side_scale * n_cos, scaled_sin = vec2(scale * n_sin);
        float start = scale * (2.0 * n_cos + (2.0 * angle - pi) * n_sin) + fract(noise.x * 7.0 + golden * float(i));
        vec4 horizon = turn(vec4(-n_sin, n_sin, -n_sin, n_sin), vec4(n_cos));

        vec2 along = vec2(k.camera.fx, k.camera.fy) * (tangent.xy - ray * tangent.z);
        along *= inversesqrt(dot(along, along));
        float per_pixel = length(along * per_px); // metres at z = 1 m
        float half_pixel = 0.5 * s.lengthen * per_pixel;
        vec2 room = vec2(to_border(vec2(pixel), along), to_border(vec2(pixel), -along));
        float full_reach = reach / per_pixel;
        vec2 nearest_step = min(room, 1.0), far = max(min(vec2(full_reach), room), nearest_step) - nearest_step;
        vec2 u = fract(noise.y + golden * vec2(2 * i, 2 * i + 1));
        vec2 flat_tangent = tangent.xy * per_px;

        uint closed = 0u;
        vec2 inside_share = vec2(0.0), before = vec2(0.0);
        vec2 x = u * (1.0 / float(steps));
        vec2 now = fma(spread(x), far, nearest_step);
        for (int j = 0; j < steps; ++j) {
            x = (float(j + 1) + u) * (1.0 / float(steps));
            vec2 next = fma(spread(x), far, nearest_step);
            // Whole pixels away; the second component looks to the other side.
            vec2 qx = along.x * now, qy = along.y * now;
            ivec2 ix = ivec2(nearest(qx.x), nearest(-qx.y)), iy = ivec2(nearest(qy.x), nearest(-qy.y));
            ivec2 at = here + iy * k.size.x + ix;
            vec4 a = imageLoad(surfels, at.x), b = imageLoad(surfels, at.y);
            vec2 zq = vec2(a.x, b.x);
            inside_share += mix(vec2(0.0), vec2(1.0), greaterThan(zq, vec2(0.0)));

            // From the pixel's point to the sample's, towards V and towards T (outwards on either side): differences first,
            // far away coordinates cancel badly.
            vec2 mx = vec2(ix), my = vec2(iy), dz = zq - z;
            vec2 pv = fma(zq, fma(mx, vec2(flat_eye.x), my * flat_eye.y), -eye_per_z * dz);
            vec2 pt = zq * fma(mx, vec2(flat_tangent.x), my * flat_tangent.y);
            pt.y = -pt.y;
            vec2 rise = fma(zq, fma(mx, vec2(flat_normal.x), my * flat_normal.y), fma(dz, vec2(normal_per_z), vec2(-surface.rise)));
            vec2 d2 = fma(pv, pv, pt * pt);
            // The gaze at the sample; across it, outwards: (gt, -gv).
            vec2 gv = pv - distance;
            vec2 g = inverse_length(fma(gv, gv, fma(pt, pt, vec2(1e-30))));
            gv *= g;
            vec2 gt = pt * g;
            // Where the surfel lies in the slice: its normal turned by a right angle, outwards.
            vec2 nx = vec2(a.y, b.y), ny = vec2(a.z, b.z), nz = vec2(a.w, b.w) - surfel_bias;
            vec2 lv = -fma(nx, vec2(tangent.x), fma(ny, vec2(tangent.y), nz * tangent.z));
            vec2 lt = fma(nx, vec2(eye.x), fma(ny, vec2(eye.y), nz * eye.z));
            lv.y = -lv.y;
            vec2 l = inverse_length(fma(lv, lv, fma(lt, lt, vec2(1e-30))));
            vec2 slope = (lv * gt - lt * gv) * l;
            l = mix(-l, l, greaterThan(slope, vec2(0.0)));
            lv *= l;
            lt *= l;
            vec2 size = zq * half_pixel / most(abs(slope), 0.1);
            // Clipped to the radius.
            vec2 middle = fma(pv, lv, pt * lt);
            vec2 chord = positive(fma(middle, middle, radius2 - d2)) + 1e-30;
            chord *= inverse_length(chord);
            vec2 back = least((now - before) * size, middle + chord), ahead = least((next - now) * size, chord - middle);
            vec2 fv = fma(-lv, back, pv), ft = fma(-lt, back, pt), uv = fma(lv, ahead, pv), ut = fma(lt, ahead, pt);
            // Thickness lies behind, as the eye sees it: seen from the pixel, farther outwards.
            vec2 deep = vec2(thickness_of(a.w), thickness_of(b.w)) * s.thickest;
            vec2 fdv = fma(gv, deep, fv), fdt = fma(gt, deep, ft), udv = fma(gv, deep, uv), udt = fma(gt, deep, ut);
            bvec2 turns = greaterThan(fv * ut, ft * uv), deep_turns = greaterThan(fdv * udt, fdt * udv);
            vec2 low_v = mix(uv, fv, turns), low_t = mix(ut, ft, turns);
            vec2 high_v = mix(fdv, udv, deep_turns), high_t = mix(fdt, udt, deep_turns);

            vec4 edge = least(turn(vec4(low_v, high_v), abs(vec4(low_t, high_t))), horizon);
            vec4 along_sine, along_cosine;
            measures(edge, along_sine, along_cosine);
            ivec4 bits = ivec4(fma(along_cosine, vec4(scaled_cos, scaled_cos), fma(along_sine, vec4(scaled_sin, scaled_sin), vec4(start))));
            bool hit_a = rise.x > 0.0 && rise.x * rise.x > lowest2 * d2.x && d2.x <= radius2 && zq.x > 0.0;
            bool hit_b = rise.y > 0.0 && rise.y * rise.y > lowest2 * d2.y && d2.y <= radius2 && zq.y > 0.0;
            uint mask_a = bits_below(bits.z) & ~bits_below(bits.x), mask_b = bits_below(bits.y) & ~bits_below(bits.w);
            closed |= (hit_a ? mask_a : 0u) | (hit_b ? mask_b : 0u);

            before = now;
            now = next;
        }
        float measure = weight * full;
        all += measure;
        open += measure * (1.0 - float(bitCount(closed)) * (1.0 / sector_count));
        known += inside_share * (far + nearest_step) / max(full_reach, 1.0);
    }
    finish(surface, !(own > 0.0), here, open / max(all, 1e-6), (known.x + known.y) / float(2 * slices * steps));
}
