// CACAO `reference`, blur (B, section 8.7): one Jacobi step over the four neighbours of a slice texel, weighted by its edges. A mirrored
// halo evolves with the image, and values are binary16 between steps.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"

layout(local_size_x = cacao_row) in;
layout(constant_id = spec_first) const int first = 0;
layout(constant_id = spec_last) const int last = 0;
layout(constant_id = spec_halo) const int halo = 0;
layout(binding = 0, r32ui) readonly uniform uimageBuffer from;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer to;

int mirrored(int i, int size) {
    int m = (i + 16 * size) % (2 * size); // of negative numbers it is undefined, and NVIDIA's is not the mathematical one; i >= -8
    return m < size ? m : 2 * size - 1 - m;
}

int index_between_steps(int slice, ivec2 t) {
    ivec2 size = k.slice + 2 * halo;
    ivec2 p = clamp(t + halo, ivec2(0), size - 1);
    return (slice * size.y + p.y) * size.x + p.x;
}

uint read(int slice, ivec2 t) {
    if (first != 0) return imageLoad(from, slice_index(slice, ivec2(mirrored(t.x, k.slice.x), mirrored(t.y, k.slice.y)))).x;
    return imageLoad(from, index_between_steps(slice, t)).x;
}

float value(uint texel) { return first != 0 ? half_even(ao_value(texel)) : unpackHalf2x16(texel).x; }

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy) - halo;
    if (any(greaterThanEqual(t, k.slice + halo))) return;
    int slice = slice_of_layer(int(gl_GlobalInvocationID.z));
    uint c = read(slice, t);
    uvec4 around = uvec4(read(slice, t - ivec2(1, 0)), read(slice, t + ivec2(1, 0)), read(slice, t - ivec2(0, 1)), read(slice, t + ivec2(0, 1)));
    vec4 e = unpack_edges(ao_edges(c));
    float sum = 0.5 * value(c) + e.x * value(around.x) + e.y * value(around.y) + e.z * value(around.z) + e.w * value(around.w);
    float v = half_even(sum / (0.5 + e.x + e.y + e.z + e.w));
    if (last == 0)
        imageStore(to, index_between_steps(slice, t), uvec4(whole((packHalf2x16(vec2(v, 0.0)) & 0xffffu) | (c & 0xffff0000u))));
    else if (all(greaterThanEqual(t, ivec2(0))) && all(lessThan(t, k.slice)))
        imageStore(to, slice_index(slice, t), uvec4(whole(ao_texel(v, ao_edges(c)))));
}
