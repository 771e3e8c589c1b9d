// Cosine between the surface normal and the way back to the camera; 0 in holes. From 1/z = n . ray / (n . point), the normal
// is parallel to (fx du, fy dv, 1/z - du (u - cx) - dv (v - cy)), du and dv being the slopes of 1/z.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(binding = 0, r32f) readonly uniform imageBuffer surface;
layout(binding = 16, scalar) writeonly buffer Out { float cosine[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

FinishConstants k;
#include "finish/clay.glsl"

// A line through the pixel and its neighbours, least squares.
float slope(Line line) { return line.squares > 0.0 ? line.product / line.squares : 0.0; }

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int at = p.y * k.size.x + p.x;
    float w = inverse_at(at);
    float du = slope(along(p, ivec2(1, 0), w, 3)), dv = slope(along(p, ivec2(0, 1), w, 3));
    vec2 from_centre = vec2(p) - vec2(k.camera.cx, k.camera.cy), focal = vec2(k.camera.fx, k.camera.fy);
    vec3 normal = vec3(focal * vec2(du, dv), w - du * from_centre.x - dv * from_centre.y);
    vec3 ray = vec3(from_centre / focal, 1.0);
    float lengths = dot(normal, normal) * dot(ray, ray);
    cosine[at] = w > 0.0 && lengths > 0.0 ? abs(dot(normal, ray)) * inversesqrt(lengths) : 0.0;
}
