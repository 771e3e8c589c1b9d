// One bounce of light, its end: the mean colour of what neighbours on the same surface found, times what is closed. Where
// everything has one colour B, this is B (1 - visibility).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(binding = 0, r32f) readonly uniform imageBuffer surface;
layout(binding = 1, r32f) readonly uniform imageBuffer visibility;
layout(binding = 2, r32f) readonly uniform imageBuffer sums; // eight a pixel
layout(binding = 16, scalar) writeonly buffer Out { float indirect[]; }; // red, green, blue, scaled as the sums
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

FinishConstants k;
#include "finish/clay.glsl"

vec4 sum_at(int at) {
    return vec4(imageLoad(sums, at).x, imageLoad(sums, at + 1).x, imageLoad(sums, at + 2).x, imageLoad(sums, at + 3).x);
}

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    const int reach = 3;
    float w = inverse_at(here), visible = imageLoad(visibility, here).x;
    vec4 sum = vec4(0.0), around = vec4(0.0);
    float pixels = 0.0;
    if (w > 0.0 && !isnan(visible))
        for (int y = max(p.y - reach, 0); y <= min(p.y + reach, k.size.y - 1); ++y)
            for (int x = max(p.x - reach, 0); x <= min(p.x + reach, k.size.x - 1); ++x) {
                int at = y * k.size.x + x;
                if (abs(inverse_at(at) - w) >= float(reach) * jump * w) continue;
                pixels += 1.0;
                sum += sum_at(8 * at);
                around += sum_at(8 * at + 4);
            }
    // Samples find a part of what closes a surface, and nothing of what the view does not show: that is taken to look as what
    // lies about. All cosines add up to half their number; where a hundredth of the directions is blocked, or less, that
    // tells nothing.
    float blocked = pixels > 0.0 ? sum.w / (0.5 * float(bounce_directions) * pixels) : 0.0;
    vec3 light = around.w > 0.0 ? around.rgb / around.w : vec3(0.0);
    if (sum.w > 0.0) light = mix(light, sum.rgb / sum.w, smoothstep(0.01, 0.04, blocked));
    light *= isnan(visible) ? 0.0 : 1.0 - clamp(visible, 0.0, 1.0);
    indirect[3 * here] = light.x;
    indirect[3 * here + 1] = light.y;
    indirect[3 * here + 2] = light.z;
}
