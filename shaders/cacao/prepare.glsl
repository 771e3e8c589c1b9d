// CACAO, first pass, for both ways to keep depth (FOR_GPU): one slice texel per thread, that is 2x2 pixels.
// De-interleaves depth into four slices and writes four normals, derived from the full-precision depth or taken from the
// supplied image. In images the mips are made here as well.
#include "lib/cacao.glsl"
#include "lib/cacao_normal.glsl"

#ifdef FOR_GPU
layout(local_size_x = 8, local_size_y = 8) in; // one texel of mip 3
#else
layout(local_size_x = cacao_row) in;
#endif
layout(constant_id = spec_normals) const int supplied = 0;
layout(constant_id = spec_device_depth) const int device_depth = 0;

layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, r32f) readonly uniform imageBuffer normals_in;
#ifdef FOR_GPU
layout(binding = 16, r32f) uniform writeonly image2DArray depths[4];
layout(binding = 18, r32ui) uniform writeonly uimageBuffer load_counter;
#else
layout(binding = 16, r32f) uniform writeonly imageBuffer depths;
#endif
layout(binding = 17, r32ui) uniform writeonly uimageBuffer normals;

float depth_of(int pixel) {
    float d = imageLoad(depth_in, pixel).x;
    return device_depth != 0 ? linear_depth(d) : d;
}
float depth_at(ivec2 p) { return depth_of(p.y * k.image.x + p.x); }
bool inside(ivec2 p) { return all(lessThan(uvec2(p), uvec2(k.image))); }

// Depth next to a pixel. Scan knows nothing outside the image: a hole. AMD's native shader replicates, its downsampled
// one loads zero.
float neighbour(ivec2 p) {
    float z = depth_at(clamp(p, ivec2(0), k.image - 1));
    if (scan != 0) return inside(p) ? z : 0.0;
    return spacing == 1 || inside(p) ? z : k.outside_depth;
}

// Scan: zero where none was given.
vec3 supplied_normal(ivec2 p) {
    ivec2 q = clamp(p, ivec2(0), k.image - 1);
    int at = 3 * (q.y * k.image.x + q.x);
    vec3 given = vec3(imageLoad(normals_in, at).x, imageLoad(normals_in, at + 1).x, imageLoad(normals_in, at + 2).x);
    vec3 n = (inside(p) ? given : vec3(0.0)) * k.normals_mul + k.normals_add;
    n *= vec3(1.0, -1.0, 1.0); // camera space has y down, this room y up
    return scan == 0 || dot(n, n) < 1e6 ? n : vec3(0.0); // false for NaN
}

// What the slice holds. AMD's LOWEST loads zero outside the image, the others replicate.
float stored_depth(ivec2 p, float z) {
    if (scan != 0) return z;
    if (!inside(p)) z = two_slices != 0 ? k.outside_depth : depth_at(clamp(p, ivec2(0), k.image - 1));
    return half_toward_zero(z);
}

vec2 ray_of(ivec2 p0, ivec2 step) {
    if (scan != 0) return k.ray_base + vec2(p0 + spacing * step) * k.ray_step;
    return k.view_mul * ((vec2(p0) + 0.5) * k.image_inv + vec2(step) * float(spacing) * k.image_inv) + k.view_add;
}

// What a pixel shows: its point, and 1/z. The point's z is the depth.
vec4 shown(float x, float y, float z, float w) { return vec4(vec3(x, y, 1.0) * z, w); }

// Scan: across a hole of one pixel, what lies beyond it: the direction is the same, and on any plane 1/z half way is the mean.
vec4 bridged(vec4 next, vec4 beyond, float wc) {
    bool bridge = scan != 0 && next.w == 0.0 && beyond.w > 0.0;
    return bridge ? vec4(beyond.xyz, 0.5 * (wc + beyond.w)) : next;
}

// Normal of pixel p from what it and those left, right, above and below show.
vec3 normal_of(ivec2 p, bool holes, vec4 c, vec4 left, vec4 right, vec4 top, vec4 bottom) {
    if (supplied != 0) return supplied_normal(p);
    vec4 w = vec4(left.w, right.w, top.w, bottom.w);
    vec4 edges = scan == 0 ? edges_from_depth(c.z, vec4(left.z, right.z, top.z, bottom.z))
                 : holes   ? edges_from_inverse(c.w, w)
                           : edges_without_holes(c.w, w);
    return normal_from_neighbours(edges, c.xyz, left.xyz, right.xyz, top.xyz, bottom.xyz);
}

// Scan: a hole of one pixel between two of the same surface, as its neighbours need it: they find what occludes them, and what to
// blur with. It gets no visibility itself.
vec4 filled(vec4 own, vec4 w, vec2 ray) {
    vec2 sum = vec2(w.x + w.y, w.z + w.w);
    vec2 same = vec2(lessThan(abs(w.xz - w.yw), 0.025 * sum)); // no other hole is
    float mean = 0.5 * dot(same, sum) / max(same.x + same.y, 1.0);
    return scan != 0 && own.w == 0.0 && mean > 0.0 ? shown(ray.x, ray.y, 1.0 / mean, mean) : own;
}

// Scan: where holes leave a pixel no whole quadrant, the other three pixels lend theirs if they lie as deep.
vec3 completed(vec3 n, float c, vec3 z, vec3 a, vec3 b, vec3 d) {
    vec3 near = vec3(lessThan(abs(z - c), vec3(0.05 * c)));
    return scan == 0 || dot(n, n) > 1e-8 ? n : near.x * a + near.y * b + near.z * d;
}

#ifdef FOR_GPU
void store_depth(int slice, ivec2 t, float z) { imageStore(depths[0], ivec3(t, slice), vec4(z)); }
#else
void store_depth(int slice, ivec2 t, float z) { imageStore(depths, depth_index(slice, 0, t), vec4(whole(z))); }
#endif

// `seen` is the recorded depth, c the filled one: without a normal it would only brighten.
void put(int slice, ivec2 t, ivec2 p, float seen, float c, vec3 n) {
    bool used = two_slices == 0 || slice == 0 || slice == 3;
    if (scan != 0) {
        c = dot(n, n) > 1e-8 ? c : seen;
        n = unit(n);
    } else if (supplied == 0) {
        n = unit(n);
    }
    if (used) store_depth(slice, t, stored_depth(p, c));
    uint filled = scan != 0 && c > 0.0 && seen == 0.0 ? filled_texel : 0u;
    if (used || scan == 0) // AMD's LOWEST writes all four normals
        imageStore(normals, slice_index(slice, t), uvec4(whole(pack_normal(n) | filled)));
}

// Depths in rows and columns -1 .. 2 around four pixels: of the first row and the last (the corners are not needed), and of those between.
void read_block(ivec2 p, out vec4 ad, out vec4 b, out vec4 c) {
#ifdef FOR_GPU
    if (all(greaterThanEqual(p, ivec2(spacing))) && all(lessThan(p + 2 * spacing, k.image))) { // nothing to clamp
        int at = p.y * k.image.x + p.x, row = spacing * k.image.x;
        ad = vec4(depth_of(at - row), depth_of(at - row + spacing), depth_of(at + 2 * row), depth_of(at + 2 * row + spacing));
        b = vec4(depth_of(at - spacing), depth_of(at), depth_of(at + spacing), depth_of(at + 2 * spacing));
        c = vec4(depth_of(at + row - spacing), depth_of(at + row), depth_of(at + row + spacing), depth_of(at + row + 2 * spacing));
        return;
    }
#endif
    ivec2 x = ivec2(spacing, 0), y = ivec2(0, spacing);
    ad = vec4(neighbour(p - y), neighbour(p + x - y), neighbour(p + 2 * y), neighbour(p + x + 2 * y));
    b = vec4(neighbour(p - x), neighbour(p), neighbour(p + x), neighbour(p + 2 * x));
    c = vec4(neighbour(p - x + y), neighbour(p + y), neighbour(p + x + y), neighbour(p + 2 * x + y));
}

// What few pixels need: branches save it on GPUs, and cost on lavapipe, which runs both sides.
#ifdef FOR_GPU
#define IF_ANY(needed) if (needed)
#define ELSE else
#else
#define IF_ANY(needed)
#define ELSE if (false)
#endif
float smallest(vec4 v) { return min(min(v.x, v.y), min(v.z, v.w)); }

// The four pixels of slice texel t; returns their depths.
vec4 prepared(ivec2 t) {
    ivec2 p0 = 2 * spacing * t, p1 = p0 + spacing * ivec2(1, 0), p2 = p0 + spacing * ivec2(0, 1), p3 = p0 + spacing * ivec2(1, 1);

    vec4 ad, b, c;
    read_block(p0, ad, b, c);
    float a1 = ad.x, a2 = ad.y, b0 = b.x, b1 = b.y, b2 = b.z, b3 = b.w, c0 = c.x, c1 = c.y, c2 = c.z, c3 = c.w, d1 = ad.z, d2 = ad.w;
    vec4 wad = inverse_or_hole(ad), wb = inverse_or_hole(b), wc = inverse_or_hole(c);

    vec2 r0 = ray_of(p0, ivec2(-1)), r1 = ray_of(p0, ivec2(0)), r2 = ray_of(p0, ivec2(1)), r3 = ray_of(p0, ivec2(2));
    vec4 A1 = shown(r1.x, r0.y, a1, wad.x), A2 = shown(r2.x, r0.y, a2, wad.y);
    vec4 B0 = shown(r0.x, r1.y, b0, wb.x), B1 = shown(r1.x, r1.y, b1, wb.y), B2 = shown(r2.x, r1.y, b2, wb.z), B3 = shown(r3.x, r1.y, b3, wb.w);
    vec4 C0 = shown(r0.x, r2.y, c0, wc.x), C1 = shown(r1.x, r2.y, c1, wc.y), C2 = shown(r2.x, r2.y, c2, wc.z), C3 = shown(r3.x, r2.y, c3, wc.w);
    vec4 D1 = shown(r1.x, r3.y, d1, wad.z), D2 = shown(r2.x, r3.y, d2, wad.w);
    vec4 s0 = B1, s1 = B2, s2 = C1, s3 = C2;
    vec3 n0, n1, n2, n3;
    IF_ANY(smallest(min(wad, min(wb, wc))) == 0.0) {
        s0 = filled(B1, vec4(B0.w, B2.w, A1.w, C1.w), vec2(r1.x, r1.y)), s1 = filled(B2, vec4(B1.w, B3.w, A2.w, C2.w), vec2(r2.x, r1.y));
        s2 = filled(C1, vec4(C0.w, C2.w, B1.w, D1.w), vec2(r1.x, r2.y)), s3 = filled(C2, vec4(C1.w, C3.w, B2.w, D2.w), vec2(r2.x, r2.y));
        n0 = normal_of(p0, true, s0, B0, bridged(B2, B3, s0.w), A1, bridged(C1, D1, s0.w));
        n1 = normal_of(p1, true, s1, bridged(B1, B0, s1.w), B3, A2, bridged(C2, D2, s1.w));
        n2 = normal_of(p2, true, s2, C0, bridged(C2, C3, s2.w), bridged(B1, A1, s2.w), D1);
        n3 = normal_of(p3, true, s3, bridged(C1, C0, s3.w), C3, bridged(B2, A2, s3.w), D2);
    }
    ELSE {
        n0 = normal_of(p0, false, B1, B0, B2, A1, C1), n1 = normal_of(p1, false, B2, B1, B3, A2, C2);
        n2 = normal_of(p2, false, C1, C0, C2, B1, D1), n3 = normal_of(p3, false, C2, C1, C3, B2, D2);
    }
    vec3 whole0 = n0, whole1 = n1, whole2 = n2, whole3 = n3;
    IF_ANY(smallest(vec4(dot(n0, n0), dot(n1, n1), dot(n2, n2), dot(n3, n3))) <= 1e-8) {
        whole0 = completed(n0, s0.z, vec3(s1.z, s2.z, s3.z), n1, n2, n3), whole1 = completed(n1, s1.z, vec3(s0.z, s2.z, s3.z), n0, n2, n3);
        whole2 = completed(n2, s2.z, vec3(s0.z, s1.z, s3.z), n0, n1, n3), whole3 = completed(n3, s3.z, vec3(s0.z, s1.z, s2.z), n0, n1, n2);
    }
    put(0, t, p0, b1, s0.z, whole0);
    put(1, t, p1, b2, s1.z, whole1);
    put(2, t, p2, c1, s2.z, whole2);
    put(3, t, p3, c2, s3.z, whole3);
    return vec4(b1, b2, c1, c2);
}

#ifdef FOR_GPU
#include "lib/cacao_mip.glsl"
layout(constant_id = spec_mips) const int mips = 0;
const int tile = 8;
shared float mip0[4][tile][tile], mip1[4][tile / 2][tile / 2], mip2[4][tile / 4][tile / 4];

#define FOUR(from, s, x, y) nearest_surface(from[s][2 * y][2 * x], from[s][2 * y + 1][2 * x], from[s][2 * y][2 * x + 1], from[s][2 * y + 1][2 * x + 1])
void store_mip(int mip, int slice, ivec2 t, float z) { imageStore(depths[mip], ivec3(t, slice), vec4(z)); }

// All mips of the tile at once, of all slices: thread i makes texel i of each.
void make_mips(ivec2 l, vec4 z) {
    for (int slice = 0; slice < 4; ++slice) mip0[slice][l.y][l.x] = z[slice];
    barrier();
    int i = int(gl_LocalInvocationIndex);
    ivec2 group = ivec2(gl_WorkGroupID.xy);
    {
        int slice = i >> 4, x = i & 3, y = i >> 2 & 3;
        float made = FOUR(mip0, slice, x, y);
        mip1[slice][y][x] = made;
        store_mip(1, slice, 4 * group + ivec2(x, y), made);
    }
    barrier();
    if (i < 16) {
        int slice = i >> 2, x = i & 1, y = i >> 1 & 1;
        float made = FOUR(mip1, slice, x, y);
        mip2[slice][y][x] = made;
        store_mip(2, slice, 2 * group + ivec2(x, y), made);
    }
    barrier();
    if (i < 4) store_mip(3, i, group, FOUR(mip2, i, 0, 0));
}

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    vec4 z = vec4(0.0);
    if (t == ivec2(0)) imageStore(load_counter, 0, uvec4(0));
    if (all(lessThan(t, k.slice))) z = prepared(t);
    if (mips != 0) make_mips(ivec2(gl_LocalInvocationID.xy), z);
}
#else
void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(t, k.slice))) prepared(t);
}
#endif
