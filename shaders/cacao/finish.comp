// CACAO, last pass on GPUs: the last blur steps and the resolve of all four slices in shared memory, instead of a pass each
// through the device's. Native resolution comes out as visibility, half resolution as the grid that upsample reads.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"
#include "lib/cacao_blur.glsl"

layout(local_size_x_id = spec_tile_x, local_size_y_id = spec_tile_y) in;
layout(constant_id = spec_steps) const int steps = 2;
layout(constant_id = spec_device_depth) const int device_depth = 0;
layout(binding = 0, r32ui) readonly uniform uimageBuffer ao;
layout(binding = 1, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 16, scalar) writeonly buffer Out { float visibility[]; };
layout(binding = 17, rg32f) uniform writeonly imageBuffer staged;

const int halo = steps + 1, layers = two_slices != 0 ? 2 : 4;
const int wide = int(gl_WorkGroupSize.x) + 2 * halo, high = int(gl_WorkGroupSize.y) + 2 * halo;
const int area = wide * high, half_of_all = layers * area;
shared uint texels[2 * half_of_all]; // before and after a step, in turns

ivec2 origin() { return ivec2(gl_WorkGroupID.xy) * ivec2(gl_WorkGroupSize.xy) - halo; } // slice texel of texels[0]

uint texel_or_hole(int slice, ivec2 t) {
    ivec2 l = t - origin();
    return texels[(steps & 1) * half_of_all + (two_slices != 0 ? slice / 3 : slice) * area + l.y * wide + l.x];
}
#include "lib/cacao_resolve.glsl"

void load_texels() {
    ivec2 first = origin();
    for (int i = int(gl_LocalInvocationIndex); i < half_of_all; i += int(gl_WorkGroupSize.x * gl_WorkGroupSize.y)) {
        int layer = i / area, rest = i - layer * area;
        ivec2 t = first + ivec2(rest % wide, rest / wide);
        bool inside = all(lessThan(uvec2(t), uvec2(k.slice)));
        texels[i] = inside ? imageLoad(ao, slice_index(slice_of_layer(layer), t)).x : hole_texel;
    }
}

// Step n leaves n texels at each side as they are: nothing reads them any more.
void blur_step(int n) {
    int from = (n - 1 & 1) * half_of_all, to = (n & 1) * half_of_all;
    ivec2 size = ivec2(wide, high) - 2 * n;
    for (int i = int(gl_LocalInvocationIndex); i < layers * size.x * size.y; i += int(gl_WorkGroupSize.x * gl_WorkGroupSize.y)) {
        int layer = i / (size.x * size.y), rest = i - layer * size.x * size.y;
        int at = layer * area + (n + rest / size.x) * wide + n + rest % size.x, c = from + at;
        texels[to + at] = blurred(texels[c], uvec4(texels[c - 1], texels[c + 1], texels[c - wide], texels[c + wide]));
    }
}

float depth_at(ivec2 p) {
    if (any(greaterThanEqual(p, k.image))) return 0.0;
    float d = imageLoad(depth_in, p.y * k.image.x + p.x).x;
    return device_depth != 0 ? linear_depth(d) : d;
}

// Grid pixel g, whose visibility is v, -1 for none. LOWEST tells holes of odd pixels by their depth alone; what it has not
// computed itself, and holes, are kept out of the upsampler by depth 0.
void put(ivec2 g, float v) {
    bool own = two_slices == 0 || (g.x & 1) == (g.y & 1);
    if (spacing == 2) {
        if (all(lessThan(g + 2, k.grid))) imageStore(staged, (g.y + 2) * k.grid.x + g.x + 2, vec4(v, own ? depth_at(2 * g) : 0.0, 0.0, 0.0));
    } else if (all(lessThan(g, k.image))) {
        bool surface = v >= 0.0 && (own || depth_at(g) > 0.0);
        visibility[g.y * k.image.x + g.x] = surface ? v : uintBitsToFloat(0x7fc00000u);
    }
}

void main() {
    k = constants;
    load_texels();
    barrier();
    for (int n = 1; n <= steps; ++n) {
        blur_step(n);
        barrier();
    }
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    vec4 v = resolved_block(t);
    put(2 * t, v.x);
    put(2 * t + ivec2(1, 0), v.y);
    put(2 * t + ivec2(0, 1), v.z);
    put(2 * t + ivec2(1, 1), v.w);
}
