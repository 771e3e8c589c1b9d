// What every pass of `scan` needs: CACAO for the metric depth of sensors, with holes.
//
// The passes, each in the file of its name. `buffers` holds the code that runs them on CPUs, `images` on GPUs:
//   prepare   image -> four slices of depth and normals; fills holes of one pixel, for use by their neighbours; mip: coarser depth
//   generate  slices -> obscurance of each texel by pairs of taps, as visibility with edges
//   blur      one edge-aware step over the four neighbours
//   resolve   slices -> one value for each pixel of the AO grid: at native resolution, the result
//   upsample  half resolution: the grid -> image, 5x5 bilateral
// Where it departs from AMD's shaders (profile `reference`) a comment says why.
#include "cacao/cacao.glsl"

// --- AO texels with 16 bits of visibility (AMD: 8), or of raw obscurance in the base pass, and flags.
const uint hole_texel = 0x80000000u;
const uint filled_texel = 0x40000000u; // in normals and AO texels: a hole that prepare filled for use by its neighbours
const float weight_levels = 32767.0;   // bit 31 is taken

uint ao_texel(float value, uint edges) { return quantised(value, 65535.0) | (edges << 16); }
float ao_value(uint texel) { return small(texel & 0xffffu) * (1.0 / 65535.0); }
bool is_hole(uint texel) { return texel >= hole_texel; }

// An unpacked AO texel: visibility in 65535ths, or -1 at a hole, and packed edges.
struct Texel {
    float value;
    uint edges;
};

// --- Depth: 0 is a hole, in metric and in device depth.
float depth_from(float recorded) { return device_depth == 0 ? recorded : recorded == 0.0 ? 0.0 : linear_depth(recorded); }
vec4 inverse_or_hole(vec4 z) { return mix(vec4(0.0), 1.0 / z, greaterThan(z, vec4(0.0))); }

// --- Edges: AMD's thresholds (section 8.1) on 1/z, which is linear across any plane, so that even a grazing plane is one surface.
// The edge to a hole (1/z = 0) is cut, and a hole gives no slope.
vec4 edges_from_inverse(float wc, vec4 w) {
    vec4 d = w - wc;
    bvec4 known = greaterThan(w, vec4(0.0));
    vec4 e = mix(abs(d), min(abs(d), abs(d + d.yxwz)), known.yxwz);
    return mix(vec4(0.0), clamp(1.3 - e * (25.0 / wc), 0.0, 1.0), known);
}
// The same, where none of the five is a hole.
vec4 edges_without_holes(float wc, vec4 w) {
    vec4 d = w - wc;
    return clamp(1.3 - min(abs(d), abs(d + d.yxwz)) * (25.0 / wc), 0.0, 1.0);
}
// AMD's cut edge lets iota (1 - sharpness) through. Here it lets nothing through, so no hole or other surface leaks in.
vec4 unpack_edges(uint p) { // the fields are not shifted: 64, 16, 4 and 1 times 0 .. 3
    vec4 f = small(p & uvec4(0xc0u, 0x30u, 0xcu, 0x3u));
    return min(up_to_one(f * (1.0 / vec4(192.0, 48.0, 12.0, 3.0)) + k.inv_sharpness), f);
}

// The visibility to store: NaN where there is no surface.
float or_unknown(float v, bool surface) { return surface ? min(v, 1.0) : uintBitsToFloat(0x7fc00000u); }
