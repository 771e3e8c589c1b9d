// Visibility of every pixel from the surfels around it. Each slice of the hemisphere has 31 sectors of equal cosine weight.
// Every surfel in the slice closes the sectors it covers (visibility bitmask, Therrien et al. 2023; slices and their
// cosine measure, Jimenez et al. 2016). A surfel is a piece of surface with a direction and a thickness, not a point: no light
// leaks between two samples, and light passes behind thin surfaces.
//
// All angles of a slice are measured from the eye vector V, outwards on either side, and known by their cosine: sectors need
// no arc function.
//
// A sample is taken to lie in the slice, at the depth of the nearest pixel: geometry is then plane geometry. Only whether it
// rises above the surface is asked of that pixel's middle, or planes would close themselves.
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
vec4 most(vec4 a, vec4 b) { return mix(b, a, greaterThan(a, b)); }
// To 0.07 %, finite for 0: lengths of directions, not positions.
vec4 inverse_length(vec4 squared) { return quick_scale * quick_inversesqrt(squared); }

// Cosine and sine of an angle in [0, pi] to 0.0001: a direction to march in.
vec2 direction_at(float angle) {
    float t = angle - 0.5 * pi, t2 = t * t;
    return vec2(-t * (1.0 + t2 * (-0.16666 + t2 * (0.0083143 - t2 * 0.00018542))), 1.0 + t2 * (-0.4999987 + t2 * (0.0416555 + t2 * (-0.0013858 + t2 * 0.00002315))));
}

// The angle of a unit vector (c, s), c >= 0, to 7e-5 (Abramowitz and Stegun 4.4.45).
float angle_of(float c, float s) {
    float angle = sqrt(positive(1.0 - c)) * (((-0.0187293 * c + 0.0742610) * c - 0.2121144) * c + 1.5707288);
    return s < 0.0 ? -angle : angle;
}

// x^1.5 on [0, 1] within 0.01: the distribution of the steps.
vec4 spread(vec4 x) { return x * (x * (0.95 - 0.25 * x) + 0.3); }
vec2 spread(vec2 x) { return x * (x * (0.95 - 0.25 * x) + 0.3); }

// The cosine of a vector's angle from V, with the scale of quick_inversesqrt().
vec4 quick_cosine(vec4 v, vec4 t) { return v * quick_inversesqrt(v * v + t * t); }

// Sectors before an angle: base + squared cos^2 + curved G(cos), with G(cos t) = pi - 2t + sin 2t to 0.002 on [-1, 1].
struct Sectors {
    vec4 base, squared;
    float curved;
};
ivec4 sectors_before(vec4 quick_cosine, Sectors sectors) {
    const float c = quick_scale, c2 = c * c;
    vec4 q2 = quick_cosine * quick_cosine;
    vec4 g = quick_cosine * (c * 4.0165217 + q2 * (c * c2 * -0.8318334 + q2 * (c * c2 * c2 * 0.3203379 + q2 * (c * c2 * c2 * c2 * -0.3613204))));
    return ivec4(sectors.base + (sectors.squared * q2 + sectors.curved * g));
}

// What a surfel grows by where a neighbour at depth `near` is in front of its sample at z and of its plane; 0 elsewhere.
// The plane has depth z / plane there.
vec4 hidden_length(vec4 near, vec4 z, vec4 plane, vec4 length_) {
    return mix(vec4(0.0), mix(vec4(0.0), length_, lessThan(near * plane, z)), lessThan(near, z));
}

// A positive number, with the sign of the first.
vec4 with_sign_of(vec4 sign_, vec4 x) { return intBitsToFloat(floatBitsToInt(x) ^ (floatBitsToInt(sign_) & 0x80000000)); }

// Pixels from p to the border of the image, along a direction and the other way.
vec2 to_border(vec2 p, vec2 direction) {
    vec2 before = p + 0.49, after = vec2(k.size) - 0.51 - p, inverse = 1.0 / max(abs(direction), vec2(1e-6));
    bvec2 up = greaterThan(direction, vec2(0.0));
    vec2 ahead = mix(before, after, up) * inverse, back = mix(after, before, up) * inverse;
    return vec2(min(ahead.x, ahead.y), min(back.x, back.y));
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
    float normal_per_z = dot(n, vec3(ray, 1.0));
    // Rounding of depth in single precision is noise, too.
    float least_rise = (k.tangent_sigmas * sigma_of(z) + 1e-6 * z) * abs(normal_per_z);
    float lowest2 = k.tangent_sine * k.tangent_sine;
    float open = 0.0, all = 0.0;

    // The loop tests at its end: lavapipe would run a `for` once more with all lanes off.
    int i = 0;
    do {
        vec2 towards = direction_at((float(i) + noise.x) * (pi / float(slices)));
        vec3 tangent = e1 * towards.x + e2 * towards.y;
        vec2 in_slice = vec2(dot(n, eye), dot(n, tangent)); // projected normal, towards V and T
        float squared = dot(in_slice, in_slice) + 1e-12, inverse_weight = inversesqrt(squared), weight = squared * inverse_weight;
        float n_cos = in_slice.x * inverse_weight, n_sin = in_slice.y * inverse_weight;
        float angle = angle_of(n_cos, n_sin);
        float full = n_cos + angle * n_sin;
        // Sectors before an angle t to the side of T: start + scale ((1 - cos 2t) cos n + (2t - sin 2t) sin n); to the
        // other side, with t counted that way, start - scale (... - ... sin n). Their fractions leave room for rounding.
        float scale = 0.25 * sector_count / full;
        float start = scale * (2.0 * n_cos + (2.0 * angle - pi) * n_sin) + (0.04 + 0.92 * fract(noise.x * 7.0 + golden * float(i)));
        Sectors sectors = Sectors(start + scale * pi * n_sin + 2.0 * scale * n_cos * sides,
                                  -2.0 * quick_scale * quick_scale * scale * n_cos * sides, -scale * n_sin);
        vec4 horizon = (-1.0 / quick_scale) * n_sin * sides;

        vec2 along = vec2(k.camera.fx, k.camera.fy) * (tangent.xy - ray * tangent.z);
        along *= inversesqrt(dot(along, along));
        vec2 along_ray = along * k.ray_step;
        float per_pixel = length(along_ray); // metres at z = 1 m
        float half_pixel = 0.5 * s.lengthen * per_pixel;
        // Farther outside than half the image's size, the plane is too poor a guess to spend a step on.
        vec2 room = to_border(vec2(pixel), along) + 0.5 * float(max(k.size.x, k.size.y));
        float full_reach = reach / per_pixel;
        vec2 far = max(min(vec2(full_reach), room), 1.0) - 1.0;
        vec2 u = fract(noise.y + golden * vec2(2 * i, 2 * i + 1)) * (1.0 / float(steps));
        // Of a pixel's step along the slice, at z = 1 m, on either side: towards V and outwards; and x, y.
        vec4 to_eye = dot(along_ray, eye.xy) * sides;
        float outwards = dot(along_ray, tangent.xy);
        vec4 along_x = along.x * sides, along_y = along.y * sides, ray_x = along_ray.x * sides, ray_y = along_ray.y * sides;
        // The direction of a surfel in the slice is (its normal on T, on V), and the ray and `along` span the slice: what the
        // normal is on those two gives the direction, ray_length long.
        vec4 t_per_ray = tangent.z * ray_length * sides;
        float t_per_step = ray_length / outwards;

        uint closed = 0u;
        vec2 last = vec2(1e30);                               // depths of the step before, on either side
        vec4 reached = vec4(0.0, 0.0, spread(u) * far + 1.0); // pixels to the step before and to this one
        int j = 0, layer = 0;
        do {
            vec4 x = float(j) * (1.0 / float(steps)) + vec4(u + 1.0 / float(steps), u + 2.0 / float(steps));
            vec4 next = spread(x) * far.xyxy + 1.0, now = vec4(reached.zw, next.xy);
            vec4 passed = now - reached, coming = next - now;
            ivec4 ix = nearest(along_x * now), iy = nearest(along_y * now); // whole pixels away
            ivec4 jx = clamp(ix, -pixel.x, k.size.x - 1 - pixel.x), jy = clamp(iy, -pixel.y, k.size.y - 1 - pixel.y);
            Four four;
            if (packed != 0) four = packed_surfels(pixel.x + jx, pixel.y + jy, layer, s);
            else four = surfaces_alike(pixel.x + jx, pixel.y + jy, s);
            vec4 zq = four.z, nx = four.nx, ny = four.ny;
            if (steps % 2 == 1 && j == steps - 1) zq.zw = vec2(0.0);

            // Outside the image the surface at its border continues as a plane, but not towards its horizon. What other views
            // saw behind it does not continue. Filled holes have a negative depth.
            ivec4 out_x = ix - jx, out_y = iy - jy;
            vec4 mx = vec4(ix) * k.ray_step.x, my = vec4(iy) * k.ray_step.y;
            vec4 by_ray = nx * ray.x + ny * ray.y + four.nz, by_step = nx * ray_x + ny * ray_y;
            vec4 inverse_seen = 1.0 / (by_ray + (nx * mx + ny * my));
            vec4 go_on = 1.0 - (nx * (vec4(out_x) * k.ray_step.x) + ny * (vec4(out_y) * k.ray_step.y)) * inverse_seen;
            bvec4 goes_on = lessThan(abs(go_on - 1.5), vec4(1.2));
            if (layers > 1) goes_on = mix(equal(out_x | out_y, ivec4(0)), goes_on, bvec4(layer == 0));
            zq = abs(zq) * mix(vec4(0.0), go_on, goes_on);
            // From the pixel's point to the sample's, towards V and towards T (outwards on either side): differences first,
            // far away coordinates cancel badly.
            vec4 dz = zq - z, off = zq * now;
            vec4 pv = off * to_eye - ray_length * dz;
            vec4 pt = off * outwards;
            vec4 rise = zq * (mx * n.x + my * n.y) + (dz * normal_per_z - least_rise);
            // Surfaces of other views have an alignment error; they must not occlude the surface that they continue.
            if (layers > 1) rise -= vec4((four.marks >> 4) & 1) * k.alignment_error;
            vec4 d2 = pv * pv + pt * pt;
            // The view direction of the sample; perpendicular to it, outwards: (gt, -gv).
            vec4 gv = pv - distance;
            vec4 g = inverse_length(gv * gv + pt * pt);
            gv *= g;
            vec4 gt = pt * g;
            // The surfel's direction in the slice, outwards.
            vec4 lv = by_step * t_per_step + by_ray * t_per_ray, lt = by_ray;
            vec4 l = inverse_length(lv * lv + lt * lt);
            vec4 slope = (lv * gt - lt * gv) * l;
            l = with_sign_of(slope, l);
            lv *= l;
            lt *= l;
            slope = abs(slope);
            vec4 size = zq * half_pixel / most(slope, vec4(0.1));
            // Clipped to the radius.
            vec4 middle = pv * lv + pt * lt;
            vec4 chord = positive(middle * middle + (radius2 - d2));
            chord *= inverse_length(chord);
            // Half way to its neighbours; farther where a neighbour is in front of it and of its plane and hides its continuation.
            vec4 back = passed * size, ahead = coming * size;
            vec4 bend = by_step * inverse_seen;
            vec4 fore = mix(vec4(1e30), zq + s.jut, greaterThan(zq, vec4(0.0)));
            vec4 fore_before = vec4(last, fore.xy), fore_next = vec4(fore.zw, 1e30, 1e30); // that of the last step is not known yet
            last = layer == 0 ? fore.zw : last;
            vec4 longest = vec4(layer == 0 ? s.longest : 0.0); // hidden layers have neither
            back += hidden_length(fore_before, zq, 1.0 - passed * bend, least(2.0 * back, longest));
            ahead += hidden_length(fore_next, zq, 1.0 + coming * bend, least(2.0 * ahead, longest));
            back = least(back, middle + chord);
            ahead = least(ahead, chord - middle);
            // The end of least angle; and, since thickness extends away from the eye, the end of the greatest angle behind. The
            // line through the sample turns about the pixel's point with the sign of their cross product.
            vec4 deep = four.thickness, cross_ = pv * lt - pt * lv;
            vec4 front = mix(ahead, -back, greaterThan(cross_, vec4(0.0))), behind = mix(-back, ahead, greaterThan(cross_, deep * slope));
            vec4 low = quick_cosine(pv + lv * front, pt + lt * front);
            vec4 high = quick_cosine(pv + gv * deep + lv * behind, pt + gt * deep + lt * behind);
            ivec4 from = sectors_before(most(low, horizon), sectors), until = sectors_before(most(high, horizon), sectors);
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
            reached = deeper ? reached : vec4(now.zw, next.zw);
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
