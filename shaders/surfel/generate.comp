// Visibility of every pixel from the surfels around it. Each slice of the hemisphere has 31 sectors of equal cosine weight,
// and every surfel in the slice closes the sectors it covers (visibility bitmask, Therrien et al. 2023; slices and their
// cosine measure, Jimenez et al. 2016). A surfel is a piece of surface with a direction and a thickness, not a point: no light
// leaks between two samples, and light passes behind thin surfaces.
//
// All angles of a slice are measured from the eye vector V, outwards on either side. They are compared as turns, 1 - c of a
// vector (c, s) with |c| + s = 1, which need no arc function.
//
// The four components of a vector are four reads, two steps to either side: independent chains of arithmetic and loads keep
// a processor busy.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"

layout(constant_id = spec_slices) const int slices = 2;
layout(constant_id = spec_steps) const int steps = 8;
layout(constant_id = spec_spacing) const int spacing = 1;
layout(constant_id = spec_layers) const int layers = 1;
layout(constant_id = spec_packed) const int packed = 1;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rg32ui) readonly uniform uimageBuffer surfels;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 16, scalar) writeonly buffer Sampled { vec2 sampled[]; }; // open and whole measure
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

#include "lib/noise.glsl"
#include "lib/cheap.glsl"
#include "lib/surfel.glsl"

const float pi = 3.14159265358979, golden = 0.618034;
const vec4 sides = vec4(1.0, -1.0, 1.0, -1.0);
const float sector_count = 31.0; // so that a bit's index never reaches the width of a word

// Compare and select: min and max handle NaN, which costs time.
vec4 least(vec4 a, vec4 b) { return mix(b, a, lessThan(a, b)); }
vec4 most(vec4 a, float b) { return mix(vec4(b), a, greaterThan(a, vec4(b))); }
// To 0.07 %: lengths of directions, not positions.
vec4 inverse_length(vec4 squared) { return quick_scale * quick_inversesqrt(squared); }

// x^1.5 on [0, 1] within 0.01: the distribution of the steps.
vec4 spread(vec4 x) { return x * (x * (0.95 - 0.25 * x) + 0.3); }

// Of the angle t of (c, s) with s >= 0: 1 - c / (|c| + s), monotonic from 0 to 2.
vec4 turn(vec4 c, vec4 s) { return 1.0 - c / (abs(c) + s + 1e-20); }

// 2 t - sin 2t and 1 - cos 2t of a turn's angle t in [0, pi].
void measures(vec4 turns, out vec4 along_sine, out vec4 along_cosine) {
    vec4 c = 1.0 - turns;                 // |c| + |s| = 1
    vec4 y = 2.0 * abs(c) - 1.0;          // tangent of pi/4 - t, with t folded into [0, pi/2]
    vec4 y2 = y * y;
    // Arc tangent on [-1, 1] to 1e-5 (Abramowitz and Stegun 4.4.49), doubled.
    vec4 arc = y * (1.9997320 + y2 * (-0.6605990 + y2 * (0.3602820 + y2 * (-0.1702660 + y2 * 0.0416702))));
    vec4 r = 1.0 / (1.0 + y2);
    vec4 folded = 0.5 * pi - arc - (1.0 - y2) * r;
    along_sine = mix(folded, 2.0 * pi - folded, lessThan(c, vec4(0.0)));
    along_cosine = 1.0 - 2.0 * y * r;
}

// 1 where depth `other` is in front of a sample at z and of the sample's plane, which has depth z / plane there.
vec4 hides(vec4 other, vec4 z, vec4 plane, float jut) {
    vec4 near = other + jut;
    return vec4(greaterThan(other, vec4(0.0))) * vec4(lessThan(near, z)) * vec4(lessThan(near * plane, z));
}

// Pixels from p to the border of the image.
float to_border(vec2 p, vec2 direction) {
    vec2 room = mix(p + 0.49, vec2(k.size) - 0.51 - p, greaterThan(direction, vec2(0.0)));
    vec2 at = room / max(abs(direction), vec2(1e-6));
    return min(at.x, at.y);
}

// Four surfels: depth, normal of any length, half the thickness, and the last bits of the depth.
struct Four {
    vec4 z, nx, ny, nz, thickness;
    ivec4 marks;
};

Four packed_surfels(ivec4 x, ivec4 y, int layer, SurfelConstants s) {
    int behind = layers == 1 ? 0 : layer * 16 * s.plane.x * s.plane.y;
    uvec2 a = imageLoad(surfels, behind + surfel_index(ivec2(x.x, y.x), s.plane)).xy;
    uvec2 b = imageLoad(surfels, behind + surfel_index(ivec2(x.y, y.y), s.plane)).xy;
    uvec2 c = imageLoad(surfels, behind + surfel_index(ivec2(x.z, y.z), s.plane)).xy;
    uvec2 d = imageLoad(surfels, behind + surfel_index(ivec2(x.w, y.w), s.plane)).xy;
    uvec4 depths = uvec4(a.x, b.x, c.x, d.x);
    ivec4 shape = ivec4(a.y, b.y, c.y, d.y); // normals as bytes_of_normal()
    return Four(uintBitsToFloat(depths), vec4(shape >> 24), vec4(shape << 8 >> 24), vec4(shape << 16 >> 24),
                vec4(shape & 0xff) * (s.thickest * (1.0 / 255.0)), ivec4(depths));
}

Four surfaces_alike(ivec4 x, ivec4 y, SurfelConstants s) {
    vec4 a = imageLoad(surfaces, index_of(ivec2(x.x, y.x))), b = imageLoad(surfaces, index_of(ivec2(x.y, y.y)));
    vec4 c = imageLoad(surfaces, index_of(ivec2(x.z, y.z))), d = imageLoad(surfaces, index_of(ivec2(x.w, y.w)));
    return Four(vec4(a.w, b.w, c.w, d.w), vec4(a.x, b.x, c.x, d.x), vec4(a.y, b.y, c.y, d.y), vec4(a.z, b.z, c.z, d.z),
                vec4(s.alike), ivec4(0));
}

uvec4 bits_below(ivec4 n) { return (uvec4(1u) << n) - 1u; }

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 group = ivec2(gl_WorkGroupID.xy), phase = ivec2(group.x & 3, (group.x >> 2) & 3);
    ivec2 at = 4 * (screen_tile * ivec2(group.x >> 4, group.y) + ivec2(gl_LocalInvocationID.xy)) + phase, pixel = at * spacing + s.screen.origin;
    if (any(greaterThanEqual(at, s.samples))) return;
    vec4 surface = imageLoad(surfaces, index_of(pixel));
    float own = surface.w;
    float z = own > 0.0 ? own : 1.0; // any point in holes, where the result is discarded
    vec2 ray = ray_of(vec2(pixel)).xy;
    float ray_length = sqrt(dot(ray, ray) + 1.0), distance = z * ray_length;
    vec3 eye = vec3(ray, 1.0) * (-1.0 / ray_length);
    // A normal that faces away is undefined: bend it to the eye.
    vec3 n = normalize(surface.xyz + eye * max(0.01 - dot(surface.xyz, eye), 0.0));

    // Two axes across the eye vector, whose z is below 0 (Duff et al. 2017).
    float b = 1.0 / (eye.z - 1.0), xy = eye.x * eye.y * b;
    vec3 e1 = vec3(1.0 + eye.x * eye.x * b, xy, eye.x), e2 = vec3(xy, 1.0 + eye.y * eye.y * b, eye.y);

    vec2 noise = noise_at(phase);
    float radius2 = k.radius * k.radius;
    float reach = k.radius * inversesqrt(max(z * z - radius2, 1e-4 * z * z)); // in units of the image plane
    vec2 flat_eye = eye.xy * k.ray_step, flat_normal = n.xy * k.ray_step; // per pixel across
    float normal_per_z = dot(n, vec3(ray, 1.0));
    // Rounding of depth in single precision is noise, too.
    float least_rise = (k.tangent_sigmas * sigma_of(z) + 1e-6 * z) * abs(normal_per_z);
    float lowest2 = k.tangent_sine * k.tangent_sine;
    float open = 0.0, all = 0.0;

    // The loop tests at its end: lavapipe would run a `for` once more with all lanes off.
    int i = 0;
    do {
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
        vec4 scaled_cos = scale * n_cos * sides;
        float scaled_sin = scale * n_sin;
        float start = scale * (2.0 * n_cos + (2.0 * angle - pi) * n_sin) + fract(noise.x * 7.0 + golden * float(i));
        vec4 horizon = turn(-n_sin * sides, vec4(n_cos));

        vec2 along = vec2(k.camera.fx, k.camera.fy) * (tangent.xy - ray * tangent.z);
        along *= inversesqrt(dot(along, along));
        vec2 along_ray = along * k.ray_step;
        float per_pixel = length(along_ray); // metres at z = 1 m
        float half_pixel = 0.5 * s.lengthen * per_pixel;
        // Farther outside than half the image's size, the plane is too poor a guess to spend a step on.
        vec2 room = vec2(to_border(vec2(pixel), along), to_border(vec2(pixel), -along)) + 0.5 * float(max(k.size.x, k.size.y));
        float full_reach = reach / per_pixel;
        vec2 far = max(min(vec2(full_reach), room), 1.0) - 1.0;
        vec2 u = fract(noise.y + golden * vec2(2 * i, 2 * i + 1));
        vec2 flat_tangent = tangent.xy * k.ray_step;

        uint closed = 0u;
        vec2 last = vec2(0.0); // depths of the step before, on either side
        int j = 0, layer = 0;
        do {
            vec4 x = (float(j) + vec4(u, u + 1.0)) * (1.0 / float(steps));
            vec4 before = spread(x - 1.0 / float(steps)) * far.xyxy + 1.0;
            vec4 now = spread(x) * far.xyxy + 1.0, next = spread(x + 1.0 / float(steps)) * far.xyxy + 1.0;
            if (j == 0) before.xy = vec2(0.0);
            // Whole pixels away.
            vec4 signed_now = now * sides;
            ivec4 ix = nearest(along.x * signed_now), iy = nearest(along.y * signed_now);
            ivec4 jx = clamp(ix, -pixel.x, k.size.x - 1 - pixel.x), jy = clamp(iy, -pixel.y, k.size.y - 1 - pixel.y);
            Four four;
            if (packed != 0) four = packed_surfels(pixel.x + jx, pixel.y + jy, layer, s);
            else four = surfaces_alike(pixel.x + jx, pixel.y + jy, s);
            vec4 zq = four.z, nx = four.nx, ny = four.ny, nz = four.nz;
            if (steps % 2 == 1 && j == steps - 1) zq.zw = vec2(0.0);
            bvec4 inside_image = equal(abs(ix - jx) + abs(iy - jy), ivec4(0));

            // From the pixel's point to the sample's, towards V and towards T (outwards on either side): differences first,
            // far away coordinates cancel badly.
            vec4 mx = vec4(ix), my = vec4(iy);
            // Outside the image the surface at its border continues as a plane, but not towards its horizon.
            vec4 seen = nx * (ray.x + mx * k.ray_step.x) + ny * (ray.y + my * k.ray_step.y) + nz;
            vec4 go_on = (nx * (ray.x + vec4(jx) * k.ray_step.x) + ny * (ray.y + vec4(jy) * k.ray_step.y) + nz) / seen;
            go_on = mix(vec4(0.0), go_on, lessThan(abs(go_on - 1.5), vec4(layer == 0 ? 1.2 : 0.0)));
            zq = abs(zq) * mix(go_on, vec4(1.0), inside_image); // filled holes have a negative depth
            vec4 dz = zq - z;
            vec4 pv = zq * (mx * flat_eye.x + my * flat_eye.y) - ray_length * dz;
            vec4 pt = zq * (mx * flat_tangent.x + my * flat_tangent.y) * sides;
            vec4 rise = zq * (mx * flat_normal.x + my * flat_normal.y) + (dz * normal_per_z - least_rise);
            // Surfaces of other views have an alignment error; they must not occlude the surface that they continue.
            if (layers > 1) rise -= vec4((four.marks >> 4) & 1) * k.misfit;
            vec4 d2 = pv * pv + pt * pt;
            // The view direction of the sample; perpendicular to it, outwards: (gt, -gv).
            vec4 gv = pv - distance;
            vec4 g = inverse_length(gv * gv + (pt * pt + 1e-30));
            gv *= g;
            vec4 gt = pt * g;
            // The surfel's direction in the slice: its normal rotated by a right angle, outwards.
            vec4 lv = -sides * (nx * tangent.x + ny * tangent.y + nz * tangent.z);
            vec4 lt = nx * eye.x + ny * eye.y + nz * eye.z;
            vec4 l = inverse_length(lv * lv + (lt * lt + 1e-30));
            vec4 slope = (lv * gt - lt * gv) * l;
            l = mix(-l, l, greaterThan(slope, vec4(0.0)));
            lv *= l;
            lt *= l;
            vec4 size = zq * half_pixel / most(abs(slope), 0.1);
            // Clipped to the radius.
            vec4 middle = pv * lv + pt * lt;
            vec4 chord = positive(middle * middle + (radius2 - d2)) + 1e-30;
            chord *= inverse_length(chord);
            // Half way to its neighbours; farther where a neighbour is in front of it and of its plane and hides its continuation.
            vec4 back = (now - before) * size, ahead = (next - now) * size;
            vec4 bend = sides * (nx * along_ray.x + ny * along_ray.y) / seen;
            vec4 z_before = vec4(last, zq.xy), z_next = vec4(zq.zw, 0.0, 0.0); // the neighbour of the last step is not known yet
            last = layer == 0 ? zq.zw : last;
            float longest = layer == 0 ? s.longest : 0.0; // hidden layers have neither
            back += hides(z_before, zq, 1.0 - (now - before) * bend, s.jut) * least(2.0 * back, vec4(longest));
            ahead += hides(z_next, zq, 1.0 + (next - now) * bend, s.jut) * least(2.0 * ahead, vec4(longest));
            back = least(back, middle + chord);
            ahead = least(ahead, chord - middle);
            vec4 fv = pv - lv * back, ft = pt - lt * back, uv = pv + lv * ahead, ut = pt + lt * ahead;
            // Thickness extends away from the eye: seen from the pixel, farther outwards.
            vec4 deep = four.thickness;
            vec4 fdv = fv + gv * deep, fdt = ft + gt * deep, udv = uv + gv * deep, udt = ut + gt * deep;
            bvec4 turns = greaterThan(fv * ut, ft * uv), deep_turns = greaterThan(fdv * udt, fdt * udv);
            vec4 low = turn(mix(uv, fv, turns), abs(mix(ut, ft, turns)));
            vec4 high = turn(mix(fdv, udv, deep_turns), abs(mix(fdt, udt, deep_turns)));

            vec4 by_sine, by_cosine;
            measures(least(low, horizon), by_sine, by_cosine);
            ivec4 from = ivec4(by_cosine * scaled_cos + (by_sine * scaled_sin + start));
            measures(least(high, horizon), by_sine, by_cosine);
            ivec4 until = ivec4(by_cosine * scaled_cos + (by_sine * scaled_sin + start));
            // To the other side, angles are counted the other way.
            uvec4 below = bits_below(from), over = bits_below(until);
            uvec4 mask = uvec4(over.x & ~below.x, below.y & ~over.y, over.z & ~below.z, below.w & ~over.w);
            vec4 height = rise * abs(rise) - lowest2 * d2; // above the surface by the least sine
            // Above the plane, within the radius, known: otherwise one of these is negative.
            ivec4 misses = (floatBitsToInt(height) | floatBitsToInt(radius2 - d2) | (floatBitsToInt(zq) - 1)) >> 31;
            mask &= ~uvec4(misses);
            closed |= mask.x | mask.y | mask.z | mask.w;
            // The layers behind these samples come before the next samples.
            ivec4 next_layer = four.marks & 15; // quarters of a radius behind this one, rounded up
            vec4 beyond = dz * (4.0 / k.radius) + vec4(next_layer);
            // It may lie within the radius; 15 is that or farther.
            ivec4 near = ivec4(lessThan(beyond, vec4(5.0))) & (ivec4(greaterThan(beyond, vec4(-4.0))) | ivec4(equal(next_layer, ivec4(15))));
            bool deeper = layers > 1 && any(greaterThan(next_layer * near, ivec4(0)));
            layer = deeper ? layer + 1 : 0;
            j += deeper ? 0 : 2;
        } while (j < steps);
        float measure = weight * full;
        all += measure;
        open += measure * (1.0 - float(bitCount(closed)) * (1.0 / sector_count));
        ++i;
    } while (i < slices);
    // A radius below one pixel shows no occluders: open; up to three pixels the occlusion fades in.
    float shows = k.radius * sqrt(k.camera.fx * k.camera.fy) / z;
    open = mix(all, open, clamp(0.5 * shows - 0.5, 0.0, 1.0));
    int index = at.y * s.samples.x + at.x;
    sampled[index] = own > 0.0 ? vec2(open, all) : vec2(0.0);
}
