// CACAO `scan`, generate (sections 8.4 and 8.5): obscurance of each slice texel from pairs of taps on opposite sides, on the slice's own
// depth. One kernel for every quality; HIGHEST runs it twice, first as the base pass that decides how many taps follow.
// The includer has main(), the buffer `depths`, and how taps find depth in it: struct Lookup and the functions declared below.
#include "cacao/scan/scan.glsl"
#include "cacao/scan/normal.glsl"
#include "cacao/pattern.glsl"

layout(constant_id = spec_base) const int base = 0;
layout(constant_id = spec_mips) const int mips = 0;
layout(binding = 1, r32ui) readonly uniform uimageBuffer normals;
layout(binding = 2, r32ui) readonly uniform uimageBuffer base_result;
layout(binding = 3, r32ui) readonly uniform uimageBuffer importance;
layout(binding = 4, r32ui) readonly uniform uimageBuffer load_counter;
layout(binding = 5, rgba32f) readonly uniform imageBuffer pattern;
layout(binding = 16, scalar) writeonly buffer Ao { uint ao[]; };
#include "cacao/adaptive.glsl"

// The features of a quality (section 8.4, first table). All have edges: scan never blurs across a depth edge.
const bool detailed = kernel >= 1 && base == 0; // edge fade-out, shadows of adjacent texels
const bool halo_weighted = kernel >= 1;
const bool turned_edges = kernel >= 2; // edges where normals turn away
const bool adaptive = kernel == 3 && base == 0;

struct Surface {
    int slice;
    ivec2 texel;
    vec3 point;    // P, moved a little towards the camera
    vec3 normal;
    vec2 step_m;   // s: metres from texel to texel
    float falloff; // F = -1 / R^2
    mat2 rotation; // M, scaled to texels
    float mip_base;    // lambda0: log2 of the disc's radius in texels, biased
    vec2 ray;          // view ray of the slice's texel (0, 0)
    vec2 ray_step;     // its change per slice texel
    vec3 quick_normal; // the normal as quick_inversesqrt() wants it
    float halo_step;   // halo_scale / R
    Lookup lookup;
};

struct Sum {
    float obscurance, weight; // O, Wt
};

// Depth of a texel. Outside the slice: 0, or the depth of another texel.
float depth_of(int slice, ivec2 t);
// The values that lookups of this texel's taps need.
Lookup lookup_of(Surface s);
// Calls look() for the texels at `offset` and at -`offset`, in the mip that the bias asks for.
void look_both_ways(Surface s, vec2 offset, float mip_bias, inout Sum sum);
// Row i of the sampling pattern.
vec4 adaptive_tap(int i);

// --- The texel itself.

Surface surface_at(int slice, ivec2 t, float z) {
    Surface s;
    s.slice = slice;
    s.texel = t;
    s.ray_step = k.ray_step * float(2 * spacing);
    s.ray = k.ray_base + vec2(spacing * parity_of(slice)) * k.ray_step;
    s.halo_step = halo_scale * -k.neg_rec_radius;
    s.step_m = z * s.ray_step;
    s.point = vec3(s.ray + vec2(t) * s.ray_step, 1.0) * z;
    s.normal = unpack_normal(imageLoad(normals, slice_index(slice, t)).x);
    s.quick_normal = s.normal * quick_scale;

    // The radius is the same at any depth; AMD's shrinks close to the camera.
    float disc = (0.85 * k.radius) / s.step_m.x;
    s.falloff = -1.0 / (k.radius * k.radius);
    s.mip_base = log2(disc) - 4.3;
    vec2 turn = imageLoad(pattern, cacao_taps + slice * 5 + int(uint(t.x + 2 * t.y) % 5u)).xy * disc;
    float aspect = s.step_m.x / -s.step_m.y; // pixels need not be square
    s.rotation = mat2(turn.x, turn.y * aspect, turn.y, -turn.x * aspect);
    s.point *= k.depth_offset;
    s.lookup = lookup_of(s);
    return s;
}

// --- Taps.

// Adds a tap with depth z along a ray. The ray passes through the centre of the texel that the tap reads, so slopes stay planes.
// Holes and texels outside the image are unknown: they count neither as open nor as closed.
void look(Surface s, vec2 ray, float z, inout Sum sum) {
    vec3 d = vec3(ray * z, z) - s.point;
    float d2 = dot(d, d);
    float facing = share(dot(s.quick_normal, d) * quick_inversesqrt(d2) - k.horizon);
    float near = share(d2 * s.falloff + 1.0);
    float weight = if_depth(z, halo_weighted ? halo_weight(d.z * s.halo_step) : 1.0);
    sum.obscurance += facing * near * weight;
    sum.weight += weight;
}

void tap(Surface s, vec4 row, float weight, inout Sum sum) {
    Sum pair = Sum(0.0, 0.0);
    look_both_ways(s, s.rotation * row.xy, row.w, pair);
    sum.obscurance += weight * pair.obscurance;
    sum.weight += weight * pair.weight;
}

void add_taps(Surface s, inout Sum sum) {
#define TAP(i, x, y, weight, mip_bias) tap(s, vec4(x, y, weight, mip_bias), weight, sum);
    CACAO_PATTERN_0_3(TAP)
    if (kernel >= 1) { CACAO_PATTERN_3_5(TAP) }
    if (kernel == 2) { CACAO_PATTERN_5_12(TAP) }
}

// The taps of the base pass, then as many as the image needs.
void add_adaptive_taps(Surface s, inout Sum sum) {
    float wanted = importance_at((vec2(s.texel) + 0.5) * k.slice_inv + vec2(parity_of(s.slice)) * k.slice_inv);
    sum.obscurance *= detail_share(wanted);
    uint b = imageLoad(base_result, slice_index(s.slice, s.texel)).x;
    sum.weight = weight_range * float(b >> 16) * (1.0 / weight_levels);
    sum.obscurance += ao_value(b) * sum.weight;
    int i = base_taps, end = taps_end(wanted);
    if (pairs_in_twos)
        for (; i + 1 < end; i += 2) {
            tap(s, adaptive_tap(i), 1.0, sum);
            tap(s, adaptive_tap(i + 1), 1.0, sum);
        }
    for (; i < end; ++i) tap(s, adaptive_tap(i), 1.0, sum);
}

// --- Adjacent texels: left, right, above, below; beyond the slice the depth is 0, and so is the normal.

bvec4 adjacent_in_slice(ivec2 t) { return bvec4(t.x > 0, t.x + 1 < k.slice.x, t.y > 0, t.y + 1 < k.slice.y); }

vec4 adjacent_depths(int slice, ivec2 t) {
    ivec2 low = max(t - 1, ivec2(0)), high = min(t + 1, k.slice - 1);
    vec4 z = vec4(depth_of(slice, ivec2(low.x, t.y)), depth_of(slice, ivec2(high.x, t.y)),
                  depth_of(slice, ivec2(t.x, low.y)), depth_of(slice, ivec2(t.x, high.y)));
    return z * vec4(adjacent_in_slice(t));
}

vec3 coded_normal_at(int slice, ivec2 t) { return coded_normal(imageLoad(normals, slice_index(slice, t)).x); }

// 1 where the normal there is within 60 degrees of n, 0 from 120 on.
vec4 edges_of_normals(vec3 n, int slice, ivec2 t) {
    ivec2 low = max(t - 1, ivec2(0)), high = min(t + 1, k.slice - 1);
    n *= 1.0 / normal_levels;
    vec4 c = vec4(dot(n, coded_normal_at(slice, ivec2(low.x, t.y))), dot(n, coded_normal_at(slice, ivec2(high.x, t.y))),
                  dot(n, coded_normal_at(slice, ivec2(t.x, low.y))), dot(n, coded_normal_at(slice, ivec2(t.x, high.y))));
    return clamp(mix(vec4(0.0), c, adjacent_in_slice(t)) + 0.5, 0.0, 1.0);
}

// Obscurance (section 8.1) with a falloff four times as tight.
float tight_obscurance(Surface s, vec3 d) {
    float d2 = dot(d, d);
    float facing = dot(s.normal, d) * (quick_scale * quick_inversesqrt(d2));
    return share(facing - k.horizon) * share(d2 * (4.0 * s.falloff) + 1.0);
}

// The shadows of the four adjacent texels.
float detail(Surface s, vec4 z, vec4 edges) {
    vec3 r = vec3(s.point.xy / s.point.z, 1.0);
    vec4 o = vec4(tight_obscurance(s, vec3(-s.step_m.x, 0.0, 0.0) + r * (z.x - s.point.z)),
                  tight_obscurance(s, vec3(+s.step_m.x, 0.0, 0.0) + r * (z.y - s.point.z)),
                  tight_obscurance(s, vec3(0.0, -s.step_m.y, 0.0) + r * (z.z - s.point.z)),
                  tight_obscurance(s, vec3(0.0, +s.step_m.y, 0.0) + r * (z.w - s.point.z)));
    return k.detail_strength * dot(o, edges);
}

// --- The pass.

// AO is reduced where it fades out with distance, and on surfaces that stand out on two sides. A hole is no sign that a surface ends.
float fade_of(Surface s, vec4 edges, vec4 z) {
    float fade = clamp(s.point.z * k.fade_mul + k.fade_add, 0.0, 1.0);
    if (!detailed) return fade;
    vec4 on = edges + vec4(equal(z, vec4(0.0)));
    vec2 cut = clamp(0.35 * (1.0 - on.xz - on.yw), 0.0, 1.0);
    return fade * clamp(1.0 - cut.x - cut.y, 0.0, 1.0);
}

float visibility_of(float obscurance, float fade) {
    return pow(clamp(1.0 - fade * min(k.shadow_strength * obscurance, k.shadow_clamp), 0.0, 1.0), k.shadow_power);
}

float obscurance_of(Sum sum) { return sum.obscurance / max(sum.weight, 1e-6); }

// The texel that the base pass stores.
uint base_texel(Surface s) {
    Sum sum = Sum(0.0, 0.0);
    add_taps(s, sum);
    return quantised(obscurance_of(sum), 65535.0) | quantised(sum.weight / weight_range, weight_levels) << 16;
}

// The AO texel of t, or the texel of the base pass.
uint generated(int slice, ivec2 t) {
    float zc = depth_of(slice, t);
    if (!(zc > 0.0)) return hole_texel;
    Surface s = surface_at(slice, t, zc);
    if (base != 0) return base_texel(s);

    vec4 z = adjacent_depths(slice, t);
    vec4 edges = edges_from_inverse(1.0 / zc, inverse_or_hole(z));
    Sum sum = Sum(detailed ? detail(s, z, edges) : 0.0, 0.0);
    if (turned_edges) edges *= edges_of_normals(s.normal, slice, t);
    if (adaptive)
        add_adaptive_taps(s, sum);
    else
        add_taps(s, sum);
    float visibility = visibility_of(obscurance_of(sum), fade_of(s, edges, z));
    uint filled = imageLoad(normals, slice_index(slice, t)).x & filled_texel;
    return ao_texel(visibility, pack_edges(edges)) | filled;
}
