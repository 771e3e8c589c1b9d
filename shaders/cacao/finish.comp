// CACAO, last pass on GPUs: the last blur steps and the resolve of all four slices in shared memory, instead of a pass each
// through the device's. Native resolution comes out as visibility, half resolution as the grid that upsample reads.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU
#include "lib/cacao.glsl"
#include "lib/cacao_blur.glsl"

layout(local_size_x = cacao_tile, local_size_y = cacao_tile) in;
layout(constant_id = spec_steps) const int steps = 2;
layout(constant_id = spec_device_depth) const int device_depth = 0;
layout(binding = 0, r32ui) readonly uniform uimageBuffer ao;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, scalar) writeonly buffer Out { float visibility[]; };
layout(binding = 17, rg32f) uniform writeonly imageBuffer staged;

const int halo = steps + 1;
const int wide = cacao_tile + 2 * halo, area = wide * wide;
shared vec4 values[2 * area]; // of the four slices, as in Texel; before and after a step, in turns
shared uint edges[area];      // of the four slices, a byte each

ivec2 origin() { return cacao_tile * ivec2(gl_WorkGroupID.xy) - halo; } // slice texel of values[0]

Texel texel_or_hole(int slice, ivec2 t) {
    ivec2 l = t - origin();
    int at = l.y * wide + l.x;
    return Texel(values[(steps & 1) * area + at][slice], edges[at] >> (8 * slice) & 0xffu);
}
#include "lib/cacao_resolve.glsl"

void load_texels() {
    ivec2 first = origin();
    for (int i = int(gl_LocalInvocationIndex); i < area; i += cacao_tile * cacao_tile) {
        ivec2 t = first + ivec2(i % wide, i / wide);
        bool inside = all(lessThan(uvec2(t), uvec2(k.slice)));
        uvec4 texel = uvec4(hole_texel);
        if (inside) {
            texel.x = imageLoad(ao, slice_index(0, t)).x;
            texel.w = imageLoad(ao, slice_index(3, t)).x;
            if (two_slices == 0) texel.yz = uvec2(imageLoad(ao, slice_index(1, t)).x, imageLoad(ao, slice_index(2, t)).x);
        }
        uvec4 e = (texel >> 16) & 0xffu;
        values[i] = mix(small(texel & 0xffffu), vec4(-1.0), greaterThanEqual(texel, uvec4(hole_texel)));
        edges[i] = e.x | e.y << 8 | e.z << 16 | e.w << 24;
    }
}

// Step n leaves n texels at each side as they are: nothing reads them any more.
void blur_step(int n) {
    int from = (n - 1 & 1) * area, to = (n & 1) * area;
    ivec2 size = ivec2(wide - 2 * n);
    for (int i = int(gl_LocalInvocationIndex); i < size.x * size.y; i += cacao_tile * cacao_tile) {
        int at = (n + i / size.x) * wide + n + i % size.x;
        vec4 c = values[from + at], l = values[from + at - 1], r = values[from + at + 1], t = values[from + at - wide], b = values[from + at + wide];
        uint e = edges[at];
        vec4 v = c;
        v.x = blurred(c.x, vec4(l.x, r.x, t.x, b.x), e & 0xffu);
        v.w = blurred(c.w, vec4(l.w, r.w, t.w, b.w), e >> 24);
        if (two_slices == 0) {
            v.y = blurred(c.y, vec4(l.y, r.y, t.y, b.y), e >> 8 & 0xffu);
            v.z = blurred(c.z, vec4(l.z, r.z, t.z, b.z), e >> 16 & 0xffu);
        }
        values[to + at] = mix(c, v, greaterThanEqual(c, vec4(0.0)));
    }
}

float depth_at(ivec2 p) {
    if (any(greaterThanEqual(p, k.image))) return 0.0;
    float d = imageLoad(depth_in, p.y * k.image.x + p.x).x;
    return device_depth != 0 ? linear_depth(d) : d;
}

// Grid pixel g, whose visibility is v, -1 for none. Holes are told by their depth: filled ones have a value, too, and LOWEST has
// none of odd pixels. What it has not computed itself, and holes, are kept out of the upsampler by depth 0.
void put(ivec2 g, float v) {
    bool own = two_slices == 0 || (g.x & 1) == (g.y & 1);
    if (spacing == 2) {
        if (all(lessThan(g + 2, k.grid))) imageStore(staged, (g.y + 2) * k.grid.x + g.x + 2, vec4(v, own ? depth_at(2 * g) : 0.0, 0.0, 0.0));
    } else if (all(lessThan(g, k.image))) {
        bool surface = v >= 0.0 && depth_at(g) > 0.0;
        visibility[g.y * k.image.x + g.x] = surface ? min(v, 1.0) : uintBitsToFloat(0x7fc00000u);
    }
}

void main() {
    k = constants;
    load_texels();
    barrier();
    if (steps > 0) { blur_step(1); barrier(); } // one by one: divisions by what is known when compiling
    if (steps > 1) { blur_step(2); barrier(); }
    if (steps > 2) { blur_step(3); barrier(); }
    if (steps > 3) { blur_step(4); barrier(); }
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    vec4 v = resolved_block(t);
    put(2 * t, v.x);
    put(2 * t + ivec2(1, 0), v.y);
    put(2 * t + ivec2(0, 1), v.z);
    put(2 * t + ivec2(1, 1), v.w);
}
