// CACAO `reference`, generate (G, sections 8.4 and 8.5): obscurance of each slice texel from pairs of taps on opposite sides, on the slice's
// own depth. One kernel for every quality; HIGHEST runs it twice, first as the base pass that decides how many taps follow.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"
#include "cacao/pattern.glsl"

layout(local_size_x = cacao_row) in;
layout(constant_id = spec_base) const int base = 0;
layout(constant_id = spec_mips) const int mips = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depths;
layout(binding = 1, r32ui) readonly uniform uimageBuffer normals;
layout(binding = 2, r32ui) readonly uniform uimageBuffer base_result;
layout(binding = 3, r32ui) readonly uniform uimageBuffer importance;
layout(binding = 4, r32ui) readonly uniform uimageBuffer load_counter;
layout(binding = 5, rgba32f) readonly uniform imageBuffer pattern;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer ao;
#include "cacao/adaptive.glsl"

// The features of a quality (section 8.4, first table).
const bool detailed = kernel >= 1 && base == 0; // depth edges, edge fade-out, detail shadows
const bool halo_weighted = kernel >= 1;
const bool turned_edges = kernel >= 2 && base == 0; // edges where normals turn away

struct Surface {
    int slice;
    vec2 uv;        // of the texel in its slice
    vec3 point;     // P, moved a little towards the camera
    vec3 normal;    // n
    float falloff;  // F = -1 / R'^2
    mat2 rotation;  // M, scaled to texels
    float mip_base; // lambda0
};

struct Sum {
    float obscurance, weight; // O, Wt
};

float depth_of(int slice, ivec2 t) { return imageLoad(depths, depth_index(slice, 0, t)).x; }

vec3 normal_at(int slice, ivec2 t) {
    int q = int(imageLoad(normals, slice_index(slice, t)).x);
    return max(vec3(q << 24 >> 24, q << 16 >> 24, q << 8 >> 24) * (1.0 / 127.0), vec3(-1.0));
}

// Section 8.1.
float obscurance(vec3 normal, vec3 d, float falloff) {
    float d2 = dot(d, d);
    return max(0.0, dot(normal, d) / sqrt(d2) - k.horizon) * max(0.0, d2 * falloff + 1.0);
}

// Positions by texture coordinate, as AMD's sampler sees them.
vec3 point_at(Surface s, vec2 offset, int mip) {
    precise vec2 uv = s.uv + offset * k.slice_inv;
    ivec2 size = mip_size(mip);
    ivec2 m = clamp(ivec2(floor(uv * vec2(size))), ivec2(0), size - 1);
    float z = imageLoad(depths, depth_index(s.slice, mip, m)).x;
    return vec3((k.view_mul * uv + k.view_add) * z, z);
}

// Samples far in front of the surface count less. That prevents halos around objects in front of a wall.
float halo_weight_of(float dz) {
    return halo_weighted ? 0.6 * clamp(2.0 + k.neg_rec_radius * max(0.0, -dz), 0.0, 1.0) + 0.4 : 1.0;
}

void look(Surface s, vec3 seen, float weight, inout Sum sum) {
    vec3 d = seen - s.point;
    weight *= halo_weight_of(d.z);
    sum.obscurance += obscurance(s.normal, d, s.falloff) * weight;
    sum.weight += weight;
}

void tap(Surface s, vec4 row, float weight, inout Sum sum) {
    vec2 offset = roundEven(s.rotation * row.xy);
    int mip = mips != 0 ? int(roundEven(clamp(row.w + s.mip_base, 0.0, 3.0))) : 0;
    look(s, point_at(s, offset, mip), weight, sum);
    look(s, point_at(s, -offset, mip), weight, sum);
}
#define TAP(i, x, y, weight, mip_bias) tap(s, vec4(x, y, weight, mip_bias), weight, sum);

vec4 neighbour_depths(int slice, ivec2 t) {
    ivec2 low = max(t - 1, ivec2(0)), high = min(t + 1, k.slice - 1);
    return vec4(depth_of(slice, ivec2(low.x, t.y)), depth_of(slice, ivec2(high.x, t.y)), depth_of(slice, ivec2(t.x, low.y)),
                depth_of(slice, ivec2(t.x, high.y)));
}

// Outside the slice there is no normal: that edge is halved.
vec4 normal_edges(vec3 n, int slice, ivec2 t) {
    ivec2 low = max(t - 1, ivec2(0)), high = min(t + 1, k.slice - 1);
    vec4 c = vec4(dot(n, normal_at(slice, ivec2(low.x, t.y))), dot(n, normal_at(slice, ivec2(high.x, t.y))),
                  dot(n, normal_at(slice, ivec2(t.x, low.y))), dot(n, normal_at(slice, ivec2(t.x, high.y))));
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

uint generated(int slice, ivec2 t) {
    Surface s;
    s.slice = slice;
    int here = slice_index(slice, t);
    float zc = depth_of(slice, t);
    s.uv = (vec2(t) + 0.5) * k.slice_inv;
    vec2 step_m = zc * k.view_mul * k.slice_inv; // s
    s.point = vec3((k.view_mul * s.uv + k.view_add) * zc, zc);
    s.normal = normal_at(slice, t);
    float radius = k.radius * (clamp(length(s.point) * k.near_limit_rec, 0.0, 1.0) * 0.8 + 0.2); // R'
    float disc = (0.85 * radius) / step_m.x;                                                     // rho
    s.falloff = -1.0 / (radius * radius);
    s.mip_base = log2(disc) - 4.3;
    vec2 turn = imageLoad(pattern, cacao_taps + slice * 5 + int(uint(t.x + 2 * t.y) % 5u)).xy * disc;
    s.rotation = mat2(turn.x, turn.y, turn.y, -turn.x);
    s.point *= k.depth_offset;

    Sum sum = Sum(0.0, 0.0);
    vec4 edges = vec4(1.0);
    if (detailed) {
        vec4 z = neighbour_depths(slice, t);
        edges = edges_from_depth(zc, z);
        sum.obscurance = detail(s, step_m, z, edges);
    }
    if (turned_edges) edges *= normal_edges(s.normal, slice, t);

    if (kernel == 3 && base == 0) { // G3: the taps of the base pass, then as many as the image needs, without weights
        float wanted = importance_at(s.uv + vec2(parity_of(slice)) * k.slice_inv);
        sum.obscurance *= detail_share(wanted);
        uint b = imageLoad(base_result, here).x;
        sum.weight = weight_range * (float(b >> 16) * inv_255);
        sum.obscurance += ao_value(b) * sum.weight;
        int end = taps_end(wanted);
        for (int i = base_taps; i < end; ++i) tap(s, imageLoad(pattern, i), 1.0, sum);
    } else {
        CACAO_PATTERN_0_3(TAP)
        if (kernel >= 1) { CACAO_PATTERN_3_5(TAP) }
        if (kernel == 2) { CACAO_PATTERN_5_12(TAP) }
    }

    float o = sum.obscurance / sum.weight;
    if (base != 0) return quantised(o, 255.0) | quantised(sum.weight / weight_range, 255.0) << 16; // GB
    float fade = clamp(s.point.z * k.fade_mul + k.fade_add, 0.0, 1.0);
    if (detailed) { // weaker AO on surfaces that stand out on two sides
        vec2 cut = clamp(0.35 * (1.0 - edges.xz - edges.yw), 0.0, 1.0);
        fade *= clamp(1.0 - cut.x - cut.y, 0.0, 1.0);
    }
    float visibility = clamp(1.0 - fade * min(k.shadow_strength * o, k.shadow_clamp), 0.0, 1.0);
    return ao_texel(pow(visibility, k.shadow_power), pack_edges(edges));
}

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    int slice = slice_of_layer(int(gl_GlobalInvocationID.z));
    imageStore(ao, slice_index(slice, t), uvec4(whole(generated(slice, t))));
}
