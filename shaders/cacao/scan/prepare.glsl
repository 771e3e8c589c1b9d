// CACAO `scan`, prepare (sections 8.2 and 8.3): one slice texel per thread, that is 2x2 pixels of the AO grid.
// De-interleaves depth into four slices and writes four normals, derived from depth or taken from the supplied image.
// The includer has main() and store_depth().
#include "cacao/scan/scan.glsl"
#include "cacao/scan/normal.glsl"

layout(constant_id = spec_normals) const int supplied = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, r32f) readonly uniform imageBuffer normals_in;
layout(binding = 17, scalar) writeonly buffer Normals { uint normals[]; };

void store_depth(int slice, ivec2 t, float z);

bool inside(ivec2 p) { return all(lessThan(uvec2(p), uvec2(k.image))); }
float smallest(vec4 v) { return min(min(v.x, v.y), min(v.z, v.w)); }

// --- Depths and points.

float depth_of(int pixel) { return depth_from(imageLoad(depth_in, pixel).x); }

// Outside the image depth is unknown, as in a hole. (AMD repeats the rim, or reads zero.)
float depth_or_hole(ivec2 p) {
    ivec2 q = clamp(p, ivec2(0), k.image - 1);
    float z = depth_of(q.y * k.image.x + q.x);
    return inside(p) ? z : 0.0;
}

// Depths of 2x2 pixels of the grid and of their neighbours:
//          a1 a2
//       b0 b1 b2 b3
//       c0 c1 c2 c3
//          d1 d2
struct Depths {
    vec4 ad, b, c; // a1 a2 d1 d2
};

Depths depths_around(ivec2 p) {
    if (branches_pay && all(greaterThanEqual(p, ivec2(spacing))) && all(lessThan(p + 2 * spacing, k.image))) { // nothing to clamp
        int at = p.y * k.image.x + p.x, row = spacing * k.image.x;
        return Depths(vec4(depth_of(at - row), depth_of(at - row + spacing), depth_of(at + 2 * row), depth_of(at + 2 * row + spacing)),
                      vec4(depth_of(at - spacing), depth_of(at), depth_of(at + spacing), depth_of(at + 2 * spacing)),
                      vec4(depth_of(at + row - spacing), depth_of(at + row), depth_of(at + row + spacing), depth_of(at + row + 2 * spacing)));
    }
    ivec2 x = ivec2(spacing, 0), y = ivec2(0, spacing);
    return Depths(vec4(depth_or_hole(p - y), depth_or_hole(p + x - y), depth_or_hole(p + 2 * y), depth_or_hole(p + x + 2 * y)),
                  vec4(depth_or_hole(p - x), depth_or_hole(p), depth_or_hole(p + x), depth_or_hole(p + 2 * x)),
                  vec4(depth_or_hole(p - x + y), depth_or_hole(p + y), depth_or_hole(p + x + y), depth_or_hole(p + 2 * x + y)));
}

// The point that a pixel shows, and 1/z, which is 0 in a hole. The point's z is the depth.
vec4 shown(float x, float y, float z, float w) { return vec4(vec3(x, y, 1.0) * z, w); }

struct Shown {
    vec4 a1, a2, b0, b1, b2, b3, c0, c1, c2, c3, d1, d2;
    vec2 ray1, ray2; // rays of b1 and of c2
    float least;     // of all 1/z: 0 where there is a hole
};

vec2 ray_of(ivec2 p, int steps) { return k.ray_base + vec2(p + spacing * steps) * k.ray_step; }

Shown shown_around(ivec2 p, Depths z) {
    vec4 wad = inverse_or_hole(z.ad), wb = inverse_or_hole(z.b), wc = inverse_or_hole(z.c);
    vec2 r0 = ray_of(p, -1), r1 = ray_of(p, 0), r2 = ray_of(p, 1), r3 = ray_of(p, 2);
    return Shown(shown(r1.x, r0.y, z.ad.x, wad.x), shown(r2.x, r0.y, z.ad.y, wad.y), //
                 shown(r0.x, r1.y, z.b.x, wb.x), shown(r1.x, r1.y, z.b.y, wb.y), shown(r2.x, r1.y, z.b.z, wb.z), shown(r3.x, r1.y, z.b.w, wb.w),
                 shown(r0.x, r2.y, z.c.x, wc.x), shown(r1.x, r2.y, z.c.y, wc.y), shown(r2.x, r2.y, z.c.z, wc.z), shown(r3.x, r2.y, z.c.w, wc.w),
                 shown(r1.x, r3.y, z.ad.z, wad.z), shown(r2.x, r3.y, z.ad.w, wad.w), //
                 r1, r2, smallest(min(wad, min(wb, wc))));
}

// --- Holes.

// Fills a hole of one pixel between two pixels of one surface. Its neighbours need its depth as an occluder and for the blur; the
// hole itself gets no visibility. w: 1/z left, right, above and below.
vec4 filled(vec4 own, vec4 w, vec2 ray) {
    vec2 sum = vec2(w.x + w.y, w.z + w.w);
    vec2 same = vec2(lessThan(abs(w.xz - w.yw), 0.025 * sum)); // no other hole is
    float mean = 0.5 * dot(same, sum) / max(same.x + same.y, 1.0);
    return own.w == 0.0 && mean > 0.0 ? shown(ray.x, ray.y, 1.0 / mean, mean) : own;
}

// Across a hole of one pixel, uses the pixel beyond it: the direction is the same, and on any plane 1/z half way is the mean.
vec4 bridged(vec4 next, vec4 beyond, float wc) {
    return next.w == 0.0 && beyond.w > 0.0 ? vec4(beyond.xyz, 0.5 * (wc + beyond.w)) : next;
}

// Where holes leave a pixel no complete quadrant, it takes the normals of the other three pixels at about its depth.
vec3 completed(vec3 n, float c, vec3 z, vec3 a, vec3 b, vec3 d) {
    vec3 near = vec3(lessThan(abs(z - c), vec3(0.05 * c)));
    return is_normal(n) ? n : near.x * a + near.y * b + near.z * d;
}

// --- Normals, zero where there is none.

vec3 supplied_normal(ivec2 p) {
    ivec2 q = clamp(p, ivec2(0), k.image - 1);
    int at = 3 * (q.y * k.image.x + q.x);
    vec3 given = vec3(imageLoad(normals_in, at).x, imageLoad(normals_in, at + 1).x, imageLoad(normals_in, at + 2).x);
    vec3 n = (inside(p) ? given : vec3(0.0)) * k.normals_mul + k.normals_add;
    n *= vec3(1.0, -1.0, 1.0);              // camera space has y down, this room y up
    return dot(n, n) < 1e6 ? n : vec3(0.0); // false for NaN
}

// Normal of pixel p from its point and those left, right, above and below.
vec3 normal_of(ivec2 p, bool holes, vec4 c, vec4 left, vec4 right, vec4 top, vec4 bottom) {
    if (supplied != 0) return supplied_normal(p);
    vec4 w = vec4(left.w, right.w, top.w, bottom.w);
    vec4 edges = holes ? edges_from_inverse(c.w, w) : edges_without_holes(c.w, w);
    return normal_from_neighbours(edges, c.xyz, left.xyz, right.xyz, top.xyz, bottom.xyz);
}

// --- The pass.

// `seen` is the recorded depth, c the filled one. A filled depth without a normal is left out, because it would only brighten.
void put(int slice, ivec2 t, float seen, float c, vec3 n) {
    if (two_slices != 0 && slice != 0 && slice != 3) return;
    c = is_normal(n) ? c : seen;
    store_depth(slice, t, c);
    uint filled = c > 0.0 && seen == 0.0 ? filled_texel : 0u;
    normals[slice_index(slice, t)] = whole(pack_normal(unit(n)) | filled);
}

// The four pixels of slice texel t; returns their depths as recorded.
vec4 prepared(ivec2 t) {
    ivec2 p0 = 2 * spacing * t, p1 = p0 + spacing * ivec2(1, 0), p2 = p0 + spacing * ivec2(0, 1), p3 = p0 + spacing * ivec2(1, 1);
    Depths z = depths_around(p0);
    Shown s = shown_around(p0, z);

    vec4 s0 = s.b1, s1 = s.b2, s2 = s.c1, s3 = s.c2; // the four, filled
    vec3 n0, n1, n2, n3;
    if (!branches_pay || s.least == 0.0) {
        s0 = filled(s.b1, vec4(s.b0.w, s.b2.w, s.a1.w, s.c1.w), s.ray1);
        s1 = filled(s.b2, vec4(s.b1.w, s.b3.w, s.a2.w, s.c2.w), vec2(s.ray2.x, s.ray1.y));
        s2 = filled(s.c1, vec4(s.c0.w, s.c2.w, s.b1.w, s.d1.w), vec2(s.ray1.x, s.ray2.y));
        s3 = filled(s.c2, vec4(s.c1.w, s.c3.w, s.b2.w, s.d2.w), s.ray2);
        n0 = normal_of(p0, true, s0, s.b0, bridged(s.b2, s.b3, s0.w), s.a1, bridged(s.c1, s.d1, s0.w));
        n1 = normal_of(p1, true, s1, bridged(s.b1, s.b0, s1.w), s.b3, s.a2, bridged(s.c2, s.d2, s1.w));
        n2 = normal_of(p2, true, s2, s.c0, bridged(s.c2, s.c3, s2.w), bridged(s.b1, s.a1, s2.w), s.d1);
        n3 = normal_of(p3, true, s3, bridged(s.c1, s.c0, s3.w), s.c3, bridged(s.b2, s.a2, s3.w), s.d2);
    } else {
        n0 = normal_of(p0, false, s.b1, s.b0, s.b2, s.a1, s.c1);
        n1 = normal_of(p1, false, s.b2, s.b1, s.b3, s.a2, s.c2);
        n2 = normal_of(p2, false, s.c1, s.c0, s.c2, s.b1, s.d1);
        n3 = normal_of(p3, false, s.c2, s.c1, s.c3, s.b2, s.d2);
    }
    vec3 complete0 = n0, complete1 = n1, complete2 = n2, complete3 = n3;
    if (!branches_pay || smallest(vec4(dot(n0, n0), dot(n1, n1), dot(n2, n2), dot(n3, n3))) <= 1e-8) {
        complete0 = completed(n0, s0.z, vec3(s1.z, s2.z, s3.z), n1, n2, n3);
        complete1 = completed(n1, s1.z, vec3(s0.z, s2.z, s3.z), n0, n2, n3);
        complete2 = completed(n2, s2.z, vec3(s0.z, s1.z, s3.z), n0, n1, n3);
        complete3 = completed(n3, s3.z, vec3(s0.z, s1.z, s2.z), n0, n1, n2);
    }
    vec4 seen = vec4(z.b.yz, z.c.yz);
    put(0, t, seen.x, s0.z, complete0);
    put(1, t, seen.y, s1.z, complete1);
    put(2, t, seen.z, s2.z, complete2);
    put(3, t, seen.w, s3.z, complete3);
    return seen;
}
