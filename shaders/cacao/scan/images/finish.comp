// CACAO `scan`, last pass on GPUs: the last blur steps (section 8.7) and the resolve of all four slices in shared memory, instead of a
// pass each through the device's. Native resolution comes out as visibility, half resolution as the grid that upsample reads.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU
#include "cacao/scan/scan.glsl"
#include "cacao/scan/resolve.glsl"
#include "cacao/out.glsl"

// A thread keeps its texel throughout, with the weights of its neighbours. Threads at the rim only supply their values: each step
// leaves one more texel at each side unknown, and so does the resolve.
layout(local_size_x = cacao_wide, local_size_y = cacao_high) in;
layout(constant_id = spec_steps) const int steps = 2;
layout(binding = 0, r32ui) readonly uniform uimageBuffer ao;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 17, scalar) writeonly buffer Staged { vec2 staged[]; };

const int rim = steps + 1, area = cacao_wide * cacao_high;
shared float values[4 * area + 2 * cacao_wide]; // slice after slice, as in Texel; and a row at each end that nothing needs
shared uint edges[area];                        // of the four slices, a byte each

ivec2 corner; // slice texel of the first thread

Texel texel_or_hole(int slice, ivec2 t) {
    ivec2 l = t - corner;
    int at = l.y * cacao_wide + l.x;
    return Texel(values[slice * area + at + cacao_wide], edges[at] >> (8 * slice) & 0xffu);
}

// The weights of the neighbours left, right, above and below; the rest is the texel's own.
vec4 shares(uint e) {
    vec4 on = unpack_edges(e);
    return on * (1.0 / (0.5 + on.x + on.y + on.z + on.w));
}

// Of the four slices.
vec4 values_at(int at) { return vec4(values[at], values[at + area], values[at + 2 * area], values[at + 3 * area]); }
void keep(int at, vec4 v) {
    values[at] = v.x;
    values[at + area] = v.y;
    values[at + 2 * area] = v.z;
    values[at + 3 * area] = v.w;
}

uvec4 loaded(ivec2 t) {
    uvec4 texel = uvec4(hole_texel);
    if (any(greaterThanEqual(uvec2(t), uvec2(k.slice)))) return texel;
    texel.x = imageLoad(ao, slice_index(0, t)).x;
    texel.w = imageLoad(ao, slice_index(3, t)).x;
    if (two_slices == 0) texel.yz = uvec2(imageLoad(ao, slice_index(1, t)).x, imageLoad(ao, slice_index(2, t)).x);
    return texel;
}

float depth_at(ivec2 p) {
    if (any(greaterThanEqual(p, k.image))) return 0.0;
    return depth_from(imageLoad(depth_in, p.y * k.image.x + p.x).x);
}

// LOWEST does not compute every second pixel.
bool own(ivec2 g) { return two_slices == 0 || (g.x & 1) == (g.y & 1); }

// For the upsampler: depth 0 marks holes and pixels that LOWEST has not computed, and keeps them out.
void stage(ivec2 g, float v) {
    if (all(lessThan(g + 2, k.grid))) staged[(g.y + 2) * k.grid.x + g.x + 2] = vec2(v, own(g) ? depth_at(2 * g) : 0.0);
}

// -1 stands for a hole. Pixels that LOWEST has not computed have no such flag.
float result(ivec2 g, float v) { return or_unknown(v, v >= 0.0 && (own(g) || depth_at(g) > 0.0)); }

// Grid pixels g and the next, and their visibilities.
void put(ivec2 g, vec2 v) {
    const ivec2 x = ivec2(1, 0);
    if (spacing == 1) {
        store_visibility(g, vec2(result(g, v.x), result(g + x, v.y)));
        return;
    }
    stage(g, v.x);
    stage(g + x, v.y);
}

void main() {
    k = constants;
    ivec2 l = ivec2(gl_LocalInvocationID.xy);
    ivec2 inner = ivec2(cacao_wide - 2 * rim, cacao_high - 2 * rim);
    corner = inner * ivec2(gl_WorkGroupID.xy) - rim;
    ivec2 t = corner + l;
    int here = l.y * cacao_wide + l.x, at = here + cacao_wide;
    uvec4 texel = loaded(t);
    bvec4 hole = greaterThanEqual(texel, uvec4(hole_texel));
    vec4 v = mix(small(texel & 0xffffu), vec4(-1.0), hole);
    uvec4 e = (texel >> 16) & 0xffu;
    edges[here] = e.x | e.y << 8 | e.z << 16 | e.w << 24;
    keep(at, v);
    barrier();
    if (steps > 0) {
        vec4 w0 = shares(e.x), w1 = shares(e.y), w2 = shares(e.z), w3 = shares(e.w);
        vec4 kept = 1.0 - vec4(w0.x + w0.y + w0.z + w0.w, w1.x + w1.y + w1.z + w1.w, w2.x + w2.y + w2.z + w2.w, w3.x + w3.y + w3.z + w3.w);
        for (int step = 1; step <= steps; ++step) {
            vec4 left = values_at(at - 1), right = values_at(at + 1), above = values_at(at - cacao_wide), below = values_at(at + cacao_wide);
            v = kept * v + vec4(w0.x, w1.x, w2.x, w3.x) * left + vec4(w0.y, w1.y, w2.y, w3.y) * right + vec4(w0.z, w1.z, w2.z, w3.z) * above +
                vec4(w0.w, w1.w, w2.w, w3.w) * below;
            barrier();
            keep(at, v);
            barrier();
        }
    }
    if (any(greaterThanEqual(uvec2(l - rim), uvec2(inner))) || any(greaterThanEqual(t, k.slice))) return;
    vec4 seen = mix(resolved_block(t), vec4(-1.0), notEqual(texel & filled_texel, uvec4(0)));
    put(2 * t, seen.xy);
    put(2 * t + ivec2(0, 1), seen.zw);
}
