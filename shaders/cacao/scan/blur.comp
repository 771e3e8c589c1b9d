// CACAO `scan`, blur (section 8.7): one Jacobi step over the four neighbours of a slice texel, weighted by its edges. Those to holes and to
// the outside are cut, and a hole stays one.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/scan/scan.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 0, r32ui) readonly uniform uimageBuffer from;
layout(binding = 16, scalar) writeonly buffer To { uint to[]; };

uint read(int slice, ivec2 t) { return imageLoad(from, slice_index(slice, clamp(t, ivec2(0), k.slice - 1))).x; }

// A value mixed with those left, right, above and below by its edges.
float blurred(float c, vec4 around, uint edges) {
    vec4 e = unpack_edges(edges);
    return (0.5 * c + dot(e, around)) / (0.5 + e.x + e.y + e.z + e.w);
}

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    int slice = slice_of_layer(int(gl_GlobalInvocationID.z));
    uint c = read(slice, t);
    uvec4 around = uvec4(read(slice, t - ivec2(1, 0)), read(slice, t + ivec2(1, 0)), read(slice, t - ivec2(0, 1)), read(slice, t + ivec2(0, 1)));
    float v = blurred(float(c & 0xffffu), vec4(around & 0xffffu), ao_edges(c));
    to[slice_index(slice, t)] = whole(uint(v + 0.5) | (c & 0xffff0000u));
}
