// CACAO `scan`, generate, on GPUs: from depth in images, whose size is a multiple of 8, so that a mip's texel covers whole texels. The
// sampler finds a texel, and 0, a hole, outside.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#define FOR_GPU

struct Lookup {
    vec2 at;               // the texel as a coordinate of taps
    vec2 ray0, ray_range;  // view ray of uv = 0, and its change to uv = 1
    float third_of_mip;    // a third of mip_base
};
#include "cacao/scan/generate.glsl"

layout(local_size_x = 32, local_size_y = 5) in;
layout(binding = 0) uniform sampler2DArray depths;

#define ROW(i, x, y, w, bias) vec4(x, y, w, bias),
const vec4 taps[cacao_taps + 1] = {CACAO_PATTERN_0_3(ROW) CACAO_PATTERN_3_5(ROW) CACAO_PATTERN_5_12(ROW) CACAO_PATTERN_12_31(ROW) vec4(0.0)};
vec4 adaptive_tap(int i) { return taps[i]; }

float depth_of(int slice, ivec2 t) { return texelFetch(depths, ivec3(t, slice), 0).x; }

Lookup lookup_of(Surface s) {
    return Lookup(vec2(s.texel), s.ray - 0.5 * s.ray_step, s.ray_step * vec2((k.slice + 7) & ~7), s.mip_base * (1.0 / 3.0));
}

void look_at(Surface s, vec2 uv, float mip, inout Sum sum) {
    look(s, s.lookup.ray0 + uv * s.lookup.ray_range, textureLod(depths, vec3(uv, float(s.slice)), mip).x, sum);
}

// Coordinates that are `snap` too large keep 6 bits below one texel, as in a buffer. Clearing bits rounds them down to a texel of
// any mip. What snap adds to uv is taken off with its offset, and rays follow from uv: that costs 1e-4 texels of precision.
void look_both_ways(Surface s, vec2 offset, float mip_bias, inout Sum sum) {
    const float magic = 12582912.0; // 1.5 * 2^23: adding it leaves the nearest integer in the low bits
    const float snap = 196608.0;    // 1.5 * 2^17
    vec2 uv_step = 1.0 / vec2((k.slice + 7) & ~7);
    if (mips == 0) {
        precise vec2 texels = (offset + magic) - magic;
        vec2 uv = (s.lookup.at + 0.5) * uv_step;
        look_at(s, uv + texels * uv_step, 0.0, sum);
        look_at(s, uv - texels * uv_step, 0.0, sum);
        return;
    }
    precise float shifted = 3.0 * clamp(mip_bias * (1.0 / 3.0) + s.lookup.third_of_mip, 0.0, 1.0) + magic; // that clamp costs nothing
    precise float mip = shifted - magic;
    int level = floatBitsToInt(shifted), whole_texels = -64 << (level & 3);
    float texel = intBitsToFloat((level << 23) + 0x3f800000); // 2^mip
    vec2 uv = (0.5 * texel - snap) * uv_step;
    vec2 at = s.lookup.at + (snap + 0.5);
    precise vec2 ahead = at + offset, behind = at - offset;
    ahead = intBitsToFloat(floatBitsToInt(ahead) & whole_texels);
    behind = intBitsToFloat(floatBitsToInt(behind) & whole_texels);
    look_at(s, uv + ahead * uv_step, mip, sum);
    look_at(s, uv + behind * uv_step, mip, sum);
}

// Each row of a work group's threads, 32 of them, takes those of one rotation, four neighbouring threads from
// a block of 5x4: their taps lie side by side, so that fewer lines of the cache serve them. Results change places in shared memory
// to be stored in rows.
const ivec2 tile = ivec2(cacao_taps_wide, cacao_taps_high);
shared uint made[tile.y][tile.x];

void main() {
    k = constants;
    ivec2 corner = tile * ivec2(gl_WorkGroupID.xy);
    int slice = slice_of_layer(int(gl_WorkGroupID.z)), lane = int(gl_LocalInvocationID.x), row = int(gl_LocalInvocationID.y);
    ivec2 at = ivec2(5 * (lane >> 2 & 3), 4 * (lane >> 4) + (lane & 3));
    at.x += (row + 3 * (corner.y + at.y)) % 5; // x + 2y = rotation, modulo 5
    if (all(lessThan(corner + at, k.slice))) made[at.y][at.x] = generated(slice, corner + at);
    barrier();
    int i = int(gl_LocalInvocationIndex);
    at = ivec2(i % tile.x, i / tile.x);
    if (all(lessThan(corner + at, k.slice))) ao[slice_index(slice, corner + at)] = made[at.y][at.x];
}
