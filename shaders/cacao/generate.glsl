// CACAO generation, for both ways to keep depth (FOR_GPU): obscurance of each slice texel from pairs of taps on opposite
// sides, on the slice's own depth. One kernel for every quality; HIGHEST runs it twice, first as the base pass that decides how
// many taps follow. `reference` keeps depth in buffers only.
#include "lib/cacao.glsl"
#include "lib/cacao_normal.glsl"
#include "lib/cacao_pattern.glsl"
#include "lib/cacao_filter.glsl"
#include "lib/cheap.glsl"

#ifdef FOR_GPU
layout(local_size_x = 32, local_size_y = 5) in;
#else
layout(local_size_x = cacao_row) in;
#endif
layout(constant_id = spec_base) const int base = 0;
layout(constant_id = spec_mips) const int mips = 0;

#ifdef FOR_GPU
layout(binding = 0) uniform sampler2DArray depths;
#else
layout(binding = 0, r32f) readonly uniform imageBuffer depths;
#endif
layout(binding = 1, r32ui) readonly uniform uimageBuffer normals;
layout(binding = 2, r32ui) readonly uniform uimageBuffer base_result;
layout(binding = 3, r32ui) readonly uniform uimageBuffer importance;
layout(binding = 4, r32ui) readonly uniform uimageBuffer load_counter;
layout(binding = 5, rgba32f) readonly uniform imageBuffer pattern;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer ao;

const bool detailed = kernel >= 1 && base == 0; // depth edges, edge fade-out, detail shadows
const bool halo_weighted = kernel >= 1;
const float weight_range = 20.0;                // the base pass stores its weight sum divided by this

struct Surface {
    int slice;
    vec2 uv;           // reference: of the texel in its slice
    vec2 ray;          // scan: view ray of the slice's texel (0, 0)
    vec2 ray_step;     // scan: its change per slice texel
    vec2 ray_range;    // scan, images: and from uv = 0 to 1; `ray` is that of uv = 0
    vec2 at;           // scan: the texel as a coordinate of taps
    ivec2 beyond;      // scan, buffers: bits of the first coordinate beyond the slice
    int depth_base;    // scan, buffers: end of the slice's depths
    vec3 quick_normal; // scan: as quick_inversesqrt() wants it
    float halo_step;   // scan: halo_scale / R
    vec3 point;        // moved a little towards the camera
    vec3 normal;
    mat2 rotation;  // pattern rotation, scaled to texels
    float falloff;  // F = -1 / R'^2
    float mip_base; // log2 of the disc radius, biased; scan, images: a third of it
};

struct Sum {
    float obscurance, weight;
};

float obscurance(vec3 normal, vec3 d, float falloff) {
    float d2 = dot(d, d);
    float facing = scan != 0 ? dot(normal, d) * (quick_scale * quick_inversesqrt(d2)) : dot(normal, d) / sqrt(d2);
#ifdef FOR_GPU // both are below 1, and this clamp costs nothing
    return clamp(facing - k.horizon, 0.0, 1.0) * clamp(d2 * falloff + 1.0, 0.0, 1.0);
#else
    return max(0.0, facing - k.horizon) * max(0.0, d2 * falloff + 1.0);
#endif
}

#ifdef FOR_GPU
const float halo_scale = 1.0;
#else
const float halo_scale = 0.6;
#endif

// --- scan. The tap looks from the centre of the texel it reads, along `ray`, so that slopes stay planes. Holes and what lies
// outside the image are unknown: they count neither as open nor as closed.
void add_scan(Surface s, vec2 ray, float z, inout Sum sum) {
    vec3 d = vec3(ray * z, z) - s.point;
    float d2 = dot(d, d);
    float facing = dot(s.quick_normal, d) * quick_inversesqrt(d2) - k.horizon;
#ifdef FOR_GPU // clamping to [0, 1] costs nothing, and comparisons run at half the rate of everything else
    facing = clamp(facing, 0.0, 1.0);
    float near = clamp(d2 * s.falloff + 1.0, 0.0, 1.0);
    float halo = halo_weighted ? 0.6 * clamp(d.z * s.halo_step + 2.0, 0.0, 1.0) + 0.4 : 1.0;
    float weight = halo * clamp(z * 1e30, 0.0, 1.0);
#else
    facing = positive(facing);
    float near = positive(d2 * s.falloff + 1.0);
    float halo = halo_weighted ? at_most_one(at_least(d.z * s.halo_step + 1.6, 0.4)) : 1.0;
    float weight = z > 0.0 ? halo : 0.0;
#endif
    sum.obscurance += facing * near * weight;
    sum.weight += weight;
}

#ifndef FOR_GPU
float depth_of(int slice, ivec2 t) { return imageLoad(depths, depth_index(slice, 0, t)).x; }

// --- reference: positions by texture coordinate, as AMD's sampler sees them.
vec3 sample_reference(Surface s, vec2 offset, int mip) {
    precise vec2 uv = s.uv + offset * k.slice_inv;
    ivec2 size = mip_size(mip);
    ivec2 m = clamp(ivec2(floor(uv * vec2(size))), ivec2(0), size - 1);
    float z = imageLoad(depths, depth_index(s.slice, mip, m)).x;
    return vec3((k.view_mul * uv + k.view_add) * z, z);
}

// Samples far in front of the surface count less: that is what keeps halos off whatever stands before a wall.
float halo_weight(float dz) {
    return halo_weighted ? 0.6 * clamp(2.0 + k.neg_rec_radius * max(0.0, -dz), 0.0, 1.0) + 0.4 : 1.0;
}

void add_reference(Surface s, vec3 seen, float weight, inout Sum sum) {
    vec3 d = seen - s.point;
    weight *= halo_weight(d.z);
    sum.obscurance += obscurance(s.normal, d, s.falloff) * weight;
    sum.weight += weight;
}

// --- scan, depth in a buffer. Coordinates are floats at a scale where an addition rounds and the low bits count texels: a
// tap's texel, the mip texel around it and its centre are then a few integer steps. |coordinate| < 2^16, far outside everything
// is clamped.
const int fraction = mips != 0 ? 6 : 0;                             // bits below one texel, for centres of mip texels
const float snap = mips != 0 ? 196608.0 : 12582912.0;               // 1.5 * 2^(23 - fraction)
const int snap_bits = mips != 0 ? 0x48400000 : 0x4b400000;

struct Level {
    int shift, first, stride; // which depth cells hold the mip's texels
    int whole_texels, middle; // from a coordinate's bits to those of its mip texel's centre
};

Level level(Surface s, int mip) {
    int one = (1 << fraction) << mip;
    return Level(mip + fraction, s.depth_base - (k.depth_mips >> (2 * mip)), k.depth_stride >> mip, -one, (one >> 1) - ((1 << fraction) >> 1));
}

void look(Surface s, Level l, vec2 at, inout Sum sum) {
    ivec2 bits = min(max(floatBitsToInt(at), snap_bits - (1 << fraction)), s.beyond);
    ivec2 m = (bits - snap_bits) >> l.shift;
    float z = imageLoad(depths, l.first + m.y * l.stride + m.x).x;
    precise vec2 centre = intBitsToFloat((bits & l.whole_texels) + l.middle) - snap;
    add_scan(s, s.ray + centre * s.ray_step, z, sum);
}

void look_both_ways(Surface s, vec2 offset, float mip_bias, inout Sum sum) {
    Level l = level(s, mips != 0 ? min(max(nearest(mip_bias + s.mip_base), 0), 3) : 0);
    precise vec2 ahead = s.at + offset, behind = s.at - offset;
    look(s, l, ahead, sum);
    look(s, l, behind, sum);
}

vec2 coordinate(ivec2 t) { return vec2(t) + (mips != 0 ? snap + 0.5 : snap); }
#else
float depth_of(int slice, ivec2 t) { return texelFetch(depths, ivec3(t, slice), 0).x; }

// --- scan, depth in images whose size is a multiple of 8, so that a mip's texel covers whole texels. The sampler finds a texel, and
// 0, a hole, outside.
void look(Surface s, vec2 uv, float mip, inout Sum sum) {
    add_scan(s, s.ray + uv * s.ray_range, textureLod(depths, vec3(uv, float(s.slice)), mip).x, sum);
}

// Coordinates that are `snap` too large keep 6 bits below one texel, as in a buffer, and clearing bits rounds them down to a texel of
// any mip. What snap adds to uv is taken off with its offset, and rays follow from uv: that costs 1e-4 texels of precision.
void look_both_ways(Surface s, vec2 offset, float mip_bias, inout Sum sum) {
    const float snap = 196608.0; // 1.5 * 2^17
    vec2 uv_step = 1.0 / vec2((k.slice + 7) & ~7);
    if (mips == 0) {
        precise vec2 texels = (offset + magic) - magic;
        vec2 uv = (s.at + 0.5) * uv_step;
        look(s, uv + texels * uv_step, 0.0, sum);
        look(s, uv - texels * uv_step, 0.0, sum);
        return;
    }
    precise float shifted = 3.0 * clamp(mip_bias * (1.0 / 3.0) + s.mip_base, 0.0, 1.0) + magic; // that clamp costs nothing
    precise float mip = shifted - magic;
    int level = floatBitsToInt(shifted), whole_texels = -64 << (level & 3);
    float texel = intBitsToFloat((level << 23) + 0x3f800000); // 2^mip
    vec2 uv = (0.5 * texel - snap) * uv_step;
    vec2 at = s.at + (snap + 0.5);
    precise vec2 ahead = at + offset, behind = at - offset;
    ahead = intBitsToFloat(floatBitsToInt(ahead) & whole_texels);
    behind = intBitsToFloat(floatBitsToInt(behind) & whole_texels);
    look(s, uv + ahead * uv_step, mip, sum);
    look(s, uv + behind * uv_step, mip, sum);
}

vec2 coordinate(ivec2 t) { return vec2(t); }
#endif

void tap(Surface s, vec4 row, bool weighted, inout Sum sum) {
    float weight = weighted ? row.z : 1.0;
    vec2 offset = s.rotation * row.xy;
    if (scan != 0) {
        Sum pair = Sum(0.0, 0.0);
        look_both_ways(s, offset, row.w, pair);
        sum.obscurance += weight * pair.obscurance;
        sum.weight += weight * pair.weight;
        return;
    }
#ifndef FOR_GPU
    float mip = clamp(row.w + s.mip_base, 0.0, 3.0);
    offset = roundEven(offset);
    int m = mips != 0 ? int(roundEven(mip)) : 0;
    add_reference(s, sample_reference(s, offset, m), weight, sum);
    add_reference(s, sample_reference(s, -offset, m), weight, sum);
#endif
}

#ifdef FOR_GPU
#define ROW(i, x, y, w, bias) vec4(x, y, w, bias),
const vec4 taps[cacao_taps + 1] = {CACAO_PATTERN_0_3(ROW) CACAO_PATTERN_3_5(ROW) CACAO_PATTERN_5_12(ROW) CACAO_PATTERN_12_31(ROW) vec4(0.0)};
vec4 adaptive_tap(int i) { return taps[i]; }
#else
vec4 adaptive_tap(int i) { return imageLoad(pattern, i); }
#endif

#define TAP(i, dx, dy, w, bias) tap(s, vec4(dx, dy, w, bias), true, sum);

vec4 neighbour_depths(int slice, ivec2 t) {
    ivec2 low = max(t - 1, ivec2(0)), high = min(t + 1, k.slice - 1);
    vec4 z = vec4(depth_of(slice, ivec2(low.x, t.y)), depth_of(slice, ivec2(high.x, t.y)),
                  depth_of(slice, ivec2(t.x, low.y)), depth_of(slice, ivec2(t.x, high.y)));
    if (scan != 0) z *= vec4(t.x > 0, t.x + 1 < k.slice.x, t.y > 0, t.y + 1 < k.slice.y);
    return z;
}

vec3 normal_at(int slice, ivec2 t) { return unpack_normal(imageLoad(normals, slice_index(slice, t)).x); }
vec3 coded_normal_at(int slice, ivec2 t) { return coded_normal(imageLoad(normals, slice_index(slice, t)).x); }

// Edges where normals turn away. Outside the slice there is no normal: the reference halves that edge.
vec4 normal_edges(vec3 n, int slice, ivec2 t) {
    ivec2 low = max(t - 1, ivec2(0)), high = min(t + 1, k.slice - 1);
    n *= normal_code;
    vec4 c = vec4(dot(n, coded_normal_at(slice, ivec2(low.x, t.y))), dot(n, coded_normal_at(slice, ivec2(high.x, t.y))),
                  dot(n, coded_normal_at(slice, ivec2(t.x, low.y))), dot(n, coded_normal_at(slice, ivec2(t.x, high.y))));
    c = mix(vec4(0.0), c, bvec4(t.x > 0, t.x + 1 < k.slice.x, t.y > 0, t.y + 1 < k.slice.y));
    return clamp(c + 0.5, 0.0, 1.0);
}

// Obscurance by the four adjacent texels, with a falloff four times as tight.
float detail(Surface s, vec2 step_m, vec4 z, vec4 edges) {
    vec3 r = vec3(s.point.xy / s.point.z, 1.0);
    vec4 o = vec4(obscurance(s.normal, vec3(-step_m.x, 0.0, 0.0) + r * (z.x - s.point.z), 4.0 * s.falloff),
                  obscurance(s.normal, vec3(+step_m.x, 0.0, 0.0) + r * (z.y - s.point.z), 4.0 * s.falloff),
                  obscurance(s.normal, vec3(0.0, -step_m.y, 0.0) + r * (z.z - s.point.z), 4.0 * s.falloff),
                  obscurance(s.normal, vec3(0.0, +step_m.y, 0.0) + r * (z.w - s.point.z), 4.0 * s.falloff));
    return k.detail_strength * dot(o, edges);
}

float importance_at(vec2 uv) {
    ivec2 c = filter_coordinate(uv, k.importance);
    Footprint f = footprint(c, k.importance);
    return filtered(f, imageLoad(importance, f.low.y * k.importance.x + f.low.x).x, imageLoad(importance, f.low.y * k.importance.x + f.high.x).x,
                    imageLoad(importance, f.high.y * k.importance.x + f.low.x).x, imageLoad(importance, f.high.y * k.importance.x + f.high.x).x);
}

// The AO texel of t, or what the base pass stores for it.
uint generated(int slice, ivec2 t) {
    Surface s;
    s.slice = slice;
    int here = slice_index(s.slice, t);
    float zc = depth_of(s.slice, t);
    if (scan != 0 && !(zc > 0.0)) return hole_texel;
    ivec2 parity = ivec2(s.slice & 1, s.slice >> 1);
    s.uv = (vec2(t) + 0.5) * k.slice_inv;
    s.ray_step = k.ray_step * float(2 * spacing);
    s.ray = k.ray_base + vec2(spacing * parity) * k.ray_step;
    s.at = coordinate(t);
#ifndef FOR_GPU
    s.beyond = (((k.slice + 7) & ~7) << fraction) + snap_bits;
#endif
    s.depth_base = s.slice * k.depth_pitch + k.depth_end;
    s.halo_step = halo_scale * -k.neg_rec_radius;
    vec2 step_m = scan != 0 ? zc * s.ray_step : zc * k.view_mul * k.slice_inv;
    s.point = scan != 0 ? vec3(s.ray + vec2(t) * s.ray_step, 1.0) * zc : vec3((k.view_mul * s.uv + k.view_add) * zc, zc);
    s.normal = normal_at(s.slice, t);
    s.quick_normal = s.normal * quick_scale;

    float radius = scan != 0 ? k.radius : k.radius * (clamp(length(s.point) * k.near_limit_rec, 0.0, 1.0) * 0.8 + 0.2);
    float disc = (0.85 * radius) / step_m.x;
    s.falloff = -1.0 / (radius * radius);
    s.mip_base = log2(disc) - 4.3;
    vec2 turn = imageLoad(pattern, cacao_taps + s.slice * 5 + int(uint(t.x + 2 * t.y) % 5u)).xy * disc;
    s.rotation = mat2(turn.x, turn.y, turn.y, -turn.x);
    if (scan != 0) { // pixels need not be square
        float aspect = step_m.x / -step_m.y;
        s.rotation[0].y *= aspect;
        s.rotation[1].y *= aspect;
    }
    s.point *= k.depth_offset;
#ifdef FOR_GPU
    s.ray_range = s.ray_step * vec2((k.slice + 7) & ~7);
    s.ray -= 0.5 * s.ray_step;
    s.mip_base *= 1.0 / 3.0;
#endif

    Sum sum = Sum(0.0, 0.0);
    vec4 edges = vec4(1.0), unknown = vec4(0.0);
    if (detailed || (scan != 0 && base == 0)) { // scan never blurs across a depth edge, whatever the quality
        vec4 z = neighbour_depths(s.slice, t);
        edges = scan != 0 ? edges_from_inverse(1.0 / zc, inverse_or_hole(z)) : edges_from_depth(zc, z);
        if (scan != 0) unknown = vec4(equal(z, vec4(0.0)));
        if (detailed) sum.obscurance = detail(s, step_m, z, edges);
        if (kernel >= 2) edges *= normal_edges(s.normal, s.slice, t);
    }

    if (kernel == 3 && base == 0) {
        float wanted = importance_at(s.uv + vec2(parity) * k.slice_inv);
        sum.obscurance *= 5.0 / 32.0 + wanted * (27.0 / 32.0);
        uint b = imageLoad(base_result, here).x;
        sum.weight = weight_range * float(b >> 16) * (1.0 / weight_levels());
        if (scan == 0) sum.weight = weight_range * (float(b >> 16) * inv_255);
        sum.obscurance += ao_value(b) * sum.weight;
        float average = float(imageLoad(load_counter, 0).x) * k.load_counter_div;
        wanted *= clamp(k.adaptive_limit / average, 0.0, 1.0);
        int end = min(31, int(27.0 * wanted + 1.5) + 5);
        int i = 5;
#ifdef FOR_GPU // two pairs on their way at a time
        for (; i + 1 < end; i += 2) {
            tap(s, adaptive_tap(i), false, sum);
            tap(s, adaptive_tap(i + 1), false, sum);
        }
#endif
        for (; i < end; ++i) tap(s, adaptive_tap(i), false, sum);
    } else {
        CACAO_PATTERN_0_3(TAP)
        if (kernel >= 1) { CACAO_PATTERN_3_5(TAP) }
        if (kernel == 2) { CACAO_PATTERN_5_12(TAP) }
    }

    float o = scan != 0 ? sum.obscurance / max(sum.weight, 1e-6) : sum.obscurance / sum.weight;
    if (base != 0) return quantised(o, value_levels()) | quantised(sum.weight / weight_range, weight_levels()) << 16;
    float fade = clamp(s.point.z * k.fade_mul + k.fade_add, 0.0, 1.0);
    if (detailed) { // fades what stands out on two sides; a hole does not say that a surface ends
        vec4 on = edges + unknown;
        vec2 cut = clamp(0.35 * (1.0 - on.xz - on.yw), 0.0, 1.0);
        fade *= clamp(1.0 - cut.x - cut.y, 0.0, 1.0);
    }
    float visibility = clamp(1.0 - fade * min(k.shadow_strength * o, k.shadow_clamp), 0.0, 1.0);
    uint filled = scan != 0 ? imageLoad(normals, here).x & filled_texel : 0u;
    return ao_texel(pow(visibility, k.shadow_power), pack_edges(edges)) | filled;
}

#ifdef FOR_GPU
// A work group makes 20x8 texels. Each row of its threads, 32 of them, takes those of one rotation, four neighbouring threads from
// a block of 5x4: their taps lie side by side, so that fewer lines of the cache serve them. Results change places in shared memory
// to be stored in rows.
const ivec2 tile = ivec2(20, 8);
shared uint made[tile.y][tile.x];

void main() {
    k = constants;
    ivec2 corner = tile * ivec2(gl_WorkGroupID.xy);
    int slice = slice_of_layer(int(gl_WorkGroupID.z)), lane = int(gl_LocalInvocationID.x), row = int(gl_LocalInvocationID.y);
    ivec2 at = ivec2(5 * (lane >> 2 & 3), 4 * (lane >> 4) + (lane & 3));
    at.x += (row + 3 * (corner.y + at.y)) % 5; // x + 2y = rotation, modulo 5
    if (all(lessThan(corner + at, k.slice))) made[at.y][at.x] = generated(slice, corner + at);
    barrier();
    int i = int(gl_LocalInvocationIndex);
    at = ivec2(i % tile.x, i / tile.x);
    if (all(lessThan(corner + at, k.slice))) imageStore(ao, slice_index(slice, corner + at), uvec4(made[at.y][at.x]));
}
#else
void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    int slice = slice_of_layer(int(gl_GlobalInvocationID.z));
    imageStore(ao, slice_index(slice, t), uvec4(whole(generated(slice, t))));
}
#endif
