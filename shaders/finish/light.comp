// Direct light over ambient light at each pixel (ao/finish/light.h); 0 where there is no surface, and in shadow. The
// depth image casts the shadows: a ray towards the light stops at what lies before it, by no more than a thickness.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(binding = 0, r32f) readonly uniform imageBuffer surface;
layout(binding = 1, r32f) readonly uniform imageBuffer normals;
layout(binding = 2, r32f) readonly uniform imageBuffer visibility;
layout(binding = 16, scalar) writeonly buffer Out { float direct[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

FinishConstants k;
#include "finish/clay.glsl"
#include "finish/normal.glsl"

float lit(vec3 from, vec3 ray) {
    for (int i = 0; i < shadow_steps; ++i) {
        vec3 at = from + ray * shadow_step(i);
        if (at.z <= 0.01) return 1.0;
        ivec2 q = ivec2(floor(project(k.camera, at) + 0.5));
        if (uint(q.x) >= uint(k.size.x) || uint(q.y) >= uint(k.size.y)) return 1.0; // nothing is known there: open
        float w = inverse_at(q.y * k.size.x + q.x);
        float behind = at.z - 1.0 / max(w, 1e-6);
        if (w > 0.0 && behind > shadow_bias(at.z) && behind < shadow_thickness) return 0.0;
    }
    return 1.0;
}

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int at = p.y * k.size.x + p.x;
    vec3 normal = normal_of(p, at);
    float visible = imageLoad(visibility, at).x, ratio = 0.0;
    if (dot(normal, k.light.direct) > 0.0) {
        float z = 1.0 / inverse_at(at);
        vec3 from = unproject(k.camera, vec2(p), z) + normal * shadow_bias(z);
        float sees = lit(from, normalize(k.light.direct));
        ratio = direct_over_ambient(k.light, normal, isnan(visible) ? 1.0 : visible, sees);
    }
    direct[at] = ratio;
}
