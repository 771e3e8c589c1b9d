// Cosine between the surface normal and the way back to the camera; 0 in holes.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(binding = 0, r32f) readonly uniform imageBuffer surface;
layout(binding = 1, r32f) readonly uniform imageBuffer normals;
layout(binding = 16, scalar) writeonly buffer Out { float cosine[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

FinishConstants k;
#include "finish/clay.glsl"
#include "finish/normal.glsl"

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int at = p.y * k.size.x + p.x;
    vec3 normal = normal_of(p, at), ray = ray_through(k.camera, vec2(p));
    cosine[at] = abs(dot(normal, ray)) * inversesqrt(dot(ray, ray));
}
