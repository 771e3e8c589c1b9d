// What every CACAO pass needs: the constant block, the profile, AO texels, binary16 and 8-bit rounding, edges.
#include "shared/cacao.h"

layout(binding = 32, scalar) uniform Constants { CacaoConstants constants; };

// Every main() starts with `k = constants`, before any branch: where lanes may be off, lavapipe loads each constant lane by
// lane (some 35 instructions); what main() loads first is loaded once. What is not used costs nothing.
CacaoConstants k;

layout(constant_id = spec_scan) const int scan = 0;
layout(constant_id = spec_spacing) const int spacing = 1;
layout(constant_id = spec_kernel) const int kernel = 2;
layout(constant_id = spec_two_slices) const int two_slices = 0;

const float inv_255 = 1.0 / 255.0;
const uint hole_texel = 0x80000000u;
const uint filled_texel = 0x40000000u; // of normals and of AO texels: a hole that prepare filled for its neighbours' sake

// --- AO texel: visibility (or raw obscurance) in bits 0..15, packed edges or sample weight from bit 16, hole flags in bits 30 and 31.
// The reference keeps AMD's 8-bit UNORM steps; scan has 16 bits for the value.
float value_levels() { return scan != 0 ? 65535.0 : 255.0; }
float weight_levels() { return scan != 0 ? 32767.0 : 255.0; }

// Between floats and integers below 2^22. On GPUs conversions run at an eighth of the rate of everything else, and 2^23 added
// to a float leaves the nearest integer in its low bits.
#ifdef FOR_GPU
float small(uint n) { return uintBitsToFloat(0x4b000000u | n) - 8388608.0; }
uint nearest_small(float x) { return floatBitsToUint(x + 8388608.0) & 0x7fffffu; }
vec4 up_to_one(vec4 positive) { return clamp(positive, 0.0, 1.0); } // free there
#else
float small(uint n) { return float(n); }
uint nearest_small(float x) { return uint(roundEven(x)); }
vec4 up_to_one(vec4 positive) { return min(positive, 1.0); }
#endif
vec4 small(uvec4 n) { return vec4(small(n.x), small(n.y), small(n.z), small(n.w)); }

uint quantised(float value, float levels) { return nearest_small(clamp(value, 0.0, 1.0) * levels); }
uint ao_texel(float value, uint edges) { return quantised(value, value_levels()) | (edges << 16); }
float ao_value(uint texel) { return small(texel & 0xffffu) * (scan != 0 ? 1.0 / 65535.0 : inv_255); }
uint ao_edges(uint texel) { return (texel >> 16) & 0xffu; }
// The reference's output is 8-bit; rounded here, in the arithmetic its ties were broken in.
float stored(float v) { return roundEven(255.0 * clamp(v, 0.0, 1.0)) * inv_255; }
bool is_hole(uint texel) { return scan != 0 && texel >= hole_texel; }

// The same, unpacked: visibility in 65535ths, or -1 at a hole, and packed edges.
struct Texel {
    float value;
    uint edges;
};

// --- binary16 as an exact float, independent of how a driver rounds its own conversions.
float half_even(float v) {
    if (abs(v) < 6.103515625e-5) return roundEven(v * 16777216.0) * (1.0 / 16777216.0);
    uint b = floatBitsToUint(v);
    return uintBitsToFloat((b + 0xfffu + ((b >> 13) & 1u)) & 0xffffe000u);
}
float half_toward_zero(float v) {
    if (abs(v) < 6.103515625e-5) return trunc(v * 16777216.0) * (1.0 / 16777216.0);
    return uintBitsToFloat(floatBitsToUint(v) & 0xffffe000u);
}

// --- edges: 1 = same surface, 0 = cut; order left, right, top, bottom.
// Differences are corrected by the slope seen on the other side.
vec4 edges_from_depth(float zc, vec4 z) {
    vec4 d = z - zc;
    vec4 e = min(abs(d), abs(d + d.yxwz));
    return clamp(1.3 - e / (0.04 * zc), 0.0, 1.0);
}
// Scan: the same thresholds on 1/z, which is linear across any plane, so that even a grazing plane is one surface.
// A hole (1/z = 0) is cut and lends no slope.
vec4 edges_from_inverse(float wc, vec4 w) {
    vec4 d = w - wc;
    bvec4 known = greaterThan(w, vec4(0.0));
    vec4 e = mix(abs(d), min(abs(d), abs(d + d.yxwz)), known.yxwz);
    return mix(vec4(0.0), clamp(1.3 - e * (25.0 / wc), 0.0, 1.0), known);
}
// Where there is no hole among them.
vec4 edges_without_holes(float wc, vec4 w) {
    vec4 d = w - wc;
    return clamp(1.3 - min(abs(d), abs(d + d.yxwz)) * (25.0 / wc), 0.0, 1.0);
}
vec4 inverse_or_hole(vec4 z) { return mix(vec4(0.0), 1.0 / z, greaterThan(z, vec4(0.0))); }
uint pack_edges(vec4 edges) {
    vec4 r = clamp(edges, 0.0, 1.0) * 3.05;
    return nearest_small(r.x) << 6 | nearest_small(r.y) << 4 | nearest_small(r.z) << 2 | nearest_small(r.w);
}
// Reference: a cut edge still lets iota through. Scan: cut is cut, so that nothing of a hole or another surface leaks.
vec4 unpack_edges(uint p) {
    if (scan != 0) { // fields where they lie: 64, 16, 4 and 1 times 0 .. 3
        vec4 f = small(p & uvec4(0xc0u, 0x30u, 0xcu, 0x3u));
        return min(up_to_one(f * (1.0 / vec4(192.0, 48.0, 12.0, 3.0)) + k.inv_sharpness), f);
    }
    return clamp(vec4(uvec4(p >> 6, p >> 4, p >> 2, p) & 3u) / 3.0 + k.inv_sharpness, 0.0, 1.0);
}

// A value about to be stored, finished as a vector. lavapipe stores lane by lane, and LLVM would move the packing into
// that loop, eight times over; a minimum with an unknown number cannot be moved.
uint whole(uint v) { return min(v, k.all_ones); }
float whole(float v) { return min(v, uintBitsToFloat(k.all_ones >> 1 & 0x7f800000u)); }

// --- addresses
int slice_index(int slice, ivec2 texel) { return (slice * k.slice.y + texel.y) * k.slice.x + texel.x; }
int depth_index(int slice, int mip, ivec2 texel) {
    return slice * k.depth_pitch + k.depth_end - (k.depth_mips >> (2 * mip)) + texel.y * (k.depth_stride >> mip) + texel.x;
}
ivec2 mip_size(int mip) { return max(k.slice >> mip, ivec2(1)); }
int slice_of_layer(int layer) { return two_slices != 0 && layer == 1 ? 3 : layer; }

// --- depth linearisation; the literal order keeps AMD's rounding (inverse of 0 is 0)
float linear_depth(float d) {
    if (scan != 0 && d == 0.0) return 0.0; // a hole, whatever the depth counts
    float v = k.depth_unpack.y - d;
    float s = sign(v) * sign(v);
    return k.depth_unpack.x * (s / ((v + s) - 1.0));
}
