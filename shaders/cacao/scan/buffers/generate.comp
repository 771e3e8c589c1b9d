// CACAO `scan`, generate, from depth in a buffer: whatever the mip, a tap's texel is a few integer steps away.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

struct Lookup {
    vec2 at;      // the texel as a coordinate of taps
    ivec2 beyond; // bits of the first coordinate beyond the slice
    int end;      // of the slice's depths
};
#include "cacao/scan/generate.glsl"

layout(local_size_x = cacao_row) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depths;

// Coordinates are floats at a scale where an addition rounds and the low bits count texels: a tap's texel, the mip texel around it and
// its centre are then a few integer steps. |coordinate| < 2^16, far outside everything is clamped.
const int fraction = mips != 0 ? 6 : 0;               // bits below one texel, for centres of mip texels
const float snap = mips != 0 ? 196608.0 : 12582912.0; // 1.5 * 2^(23 - fraction)
const int snap_bits = mips != 0 ? 0x48400000 : 0x4b400000;

struct Level {
    int shift, first, stride; // which depth cells hold the mip's texels
    int whole_texels, middle; // from a coordinate's bits to those of its mip texel's centre
};

Level level(Lookup l, int mip) {
    int one = (1 << fraction) << mip;
    return Level(mip + fraction, l.end - (k.depth_mips >> (2 * mip)), k.depth_stride >> mip, -one, (one >> 1) - ((1 << fraction) >> 1));
}

float depth_of(int slice, ivec2 t) { return imageLoad(depths, depth_index(slice, 0, t)).x; }
vec4 adaptive_tap(int i) { return imageLoad(pattern, i); }

Lookup lookup_of(Surface s) {
    return Lookup(vec2(s.texel) + (mips != 0 ? snap + 0.5 : snap), (((k.slice + 7) & ~7) << fraction) + snap_bits,
                  s.slice * k.depth_pitch + k.depth_end);
}

void look_at(Surface s, Level l, vec2 at, inout Sum sum) {
    ivec2 bits = min(max(floatBitsToInt(at), snap_bits - (1 << fraction)), s.lookup.beyond);
    ivec2 m = (bits - snap_bits) >> l.shift;
    float z = imageLoad(depths, l.first + m.y * l.stride + m.x).x;
    precise vec2 centre = intBitsToFloat((bits & l.whole_texels) + l.middle) - snap;
    look(s, s.ray + centre * s.ray_step, z, sum);
}

void look_both_ways(Surface s, vec2 offset, float mip_bias, inout Sum sum) {
    Level l = level(s.lookup, mips != 0 ? min(max(nearest(mip_bias + s.mip_base), 0), 3) : 0);
    precise vec2 ahead = s.lookup.at + offset, behind = s.lookup.at - offset;
    look_at(s, l, ahead, sum);
    look_at(s, l, behind, sum);
}

void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    int slice = slice_of_layer(int(gl_GlobalInvocationID.z));
    ao[slice_index(slice, t)] = whole(generated(slice, t));
}
