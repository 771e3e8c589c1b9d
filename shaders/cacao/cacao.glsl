// What every pass of CACAO needs, in both profiles: the constant block, the slices and their addresses, AO texels, edges.
//
// Sections ("8.4") are those of our specification of AMD's shaders, kernels (D, N, G, B, A, U) the names it gives them:
//   prepare = D and N, generate = G, importance = I0 IA IB, blur = B, apply = A, stage and upsample = U
#include "shared/cacao.h"
#include "cacao/device.glsl"

layout(binding = 32, scalar) uniform Constants { CacaoConstants constants; };

// Every main() starts with `k = constants`, before any branch. Inside a branch, lavapipe loads each constant lane by lane (some
// 35 instructions); at the start it loads each once. Unused constants cost nothing.
CacaoConstants k;

layout(constant_id = spec_spacing) const int spacing = 1;
layout(constant_id = spec_kernel) const int kernel = 2;
layout(constant_id = spec_two_slices) const int two_slices = 0;
layout(constant_id = spec_device_depth) const int device_depth = 0;

// --- Slices (section 3): slice a holds the AO grid's pixels 2t + (a mod 2, a div 2).
ivec2 parity_of(int slice) { return ivec2(slice & 1, slice >> 1); }
int slice_of_layer(int layer) { return two_slices != 0 && layer == 1 ? 3 : layer; }
int slice_index(int slice, ivec2 texel) { return (slice * k.slice.y + texel.y) * k.slice.x + texel.x; }
int depth_index(int slice, int mip, ivec2 texel) {
    return slice * k.depth_pitch + k.depth_end - (k.depth_mips >> (2 * mip)) + texel.y * (k.depth_stride >> mip) + texel.x;
}

// --- AO texels: a value in bits 0..15, from bit 16 on packed edges or, in the base pass, a weight.
uint quantised(float value, float levels) { return nearest_small(clamp(value, 0.0, 1.0) * levels); }
uint ao_edges(uint texel) { return (texel >> 16) & 0xffu; }

// --- Edges (section 8.1), 1 = same surface, 0 = cut; left, right, above, below.
uint pack_edges(vec4 edges) {
    vec4 r = clamp(edges, 0.0, 1.0) * 3.05;
    return nearest_small(r.x) << 6 | nearest_small(r.y) << 4 | nearest_small(r.z) << 2 | nearest_small(r.w);
}

// --- Metric depth from device depth (section 6.2). The order of operations keeps AMD's rounding (the inverse of 0 is 0).
float linear_depth(float d) {
    float v = k.depth_unpack.y - d;
    float s = sign(v) * sign(v);
    return k.depth_unpack.x * (s / ((v + s) - 1.0));
}

// Computes a value for all lanes before it is stored. lavapipe stores lane by lane, and LLVM would repeat the packing in each of
// the eight rounds. A minimum with a number unknown to the compiler prevents that.
uint whole(uint v) { return min(v, k.all_ones); }
float whole(float v) { return min(v, uintBitsToFloat(k.all_ones >> 1 & 0x7f800000u)); }
