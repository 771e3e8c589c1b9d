// What every pass of `reference` needs: AMD's shaders bit for bit, as far as one device can repeat another's roundings. They know no holes.
// Values that they keep in 8- and 16-bit images are rounded here as lavapipe stores them (section 11.1).
#include "cacao/cacao.glsl"

const float inv_255 = 1.0 / 255.0;

// --- AO texels in 8-bit UNORM steps (rule C).
uint ao_texel(float value, uint edges) { return quantised(value, 255.0) | (edges << 16); }
float ao_value(uint texel) { return float(texel & 0xffffu) * inv_255; }
// The output is 8-bit as well; rounded here, in the arithmetic its ties were broken in.
float stored(float v) { return roundEven(255.0 * clamp(v, 0.0, 1.0)) * inv_255; }

// --- binary16 as an exact float, independent of how a driver rounds its own conversions (rules A and B).
float half_even(float v) {
    if (abs(v) < 6.103515625e-5) return roundEven(v * 16777216.0) * (1.0 / 16777216.0);
    uint b = floatBitsToUint(v);
    return uintBitsToFloat((b + 0xfffu + ((b >> 13) & 1u)) & 0xffffe000u);
}
float half_toward_zero(float v) {
    if (abs(v) < 6.103515625e-5) return trunc(v * 16777216.0) * (1.0 / 16777216.0);
    return uintBitsToFloat(floatBitsToUint(v) & 0xffffe000u);
}

// --- Edges (section 8.1). Differences are corrected by the slope seen on the other side; a cut edge still lets iota through.
vec4 edges_from_depth(float zc, vec4 z) {
    vec4 d = z - zc;
    vec4 e = min(abs(d), abs(d + d.yxwz));
    return clamp(1.3 - e / (0.04 * zc), 0.0, 1.0);
}
vec4 unpack_edges(uint p) { return clamp(vec4(uvec4(p >> 6, p >> 4, p >> 2, p) & 3u) / 3.0 + k.inv_sharpness, 0.0, 1.0); }

float depth_from(float recorded) { return device_depth != 0 ? linear_depth(recorded) : recorded; }
ivec2 mip_size(int mip) { return max(k.slice >> mip, ivec2(1)); }
