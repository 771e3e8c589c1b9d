// How much of the ball around each point the camera saw (projection/confidence.h).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"
#include "lib/cheap.glsl"

layout(local_size_x = finish_row) in;
layout(binding = 0, r32f) readonly uniform imageBuffer seen; // z; far behind the camera where nothing was seen
layout(binding = 16, scalar) writeonly buffer Out { float confidence[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

void main() {
    FinishConstants k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float recorded = imageLoad(seen, here).x;
    bool known = recorded > -1e29;
    float z = known ? recorded : 1.0, inverse = 1.0 / z;
    vec2 focal = vec2(k.camera.fx, k.camera.fy);
    vec2 ball = min(k.radius * focal * inverse, vec2(1e6)); // pixels
    float limit = z - k.radius;
    int count = 0;
    for (int i = 0; i < confidence_seeds; ++i) {
        ivec2 q = p + ivec2(nearest(k.seeds[i].x * ball.x), nearest(k.seeds[i].y * ball.y));
        bool inside = uint(q.x) < uint(k.size.x) && uint(q.y) < uint(k.size.y);
        float there = imageLoad(seen, inside ? q.y * k.size.x + q.x : here).x;
        count += int(inside && there > limit);
    }
    float resolved = clamp(0.5 * (k.radius * sqrt(focal.x * focal.y) * inverse) - 0.5, 0.0, 1.0);
    float told = max(0.0, 1.0 - 3.0 * (k.noise_floor + k.noise_per_z2 * z * z) / k.radius);
    float share = float(count) * (1.0 / float(confidence_seeds));
    confidence[here] = known ? share * resolved * told : uintBitsToFloat(0x7fc00000u);
}
