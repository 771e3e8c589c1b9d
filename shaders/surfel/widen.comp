// Outside its image and in its holes this view takes the surfaces that other views saw. Outside the image, where there are
// none, the surface at its border continues as a plane. In holes the depth is negative: these surfaces occlude, but are no
// pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, r32ui) readonly uniform uimageBuffer behind;
layout(binding = 2, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 16, scalar) writeonly buffer Widened { vec4 widened[]; }; // the same: where there is depth it is only read
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

#include "lib/depth.glsl"
#include "surfel/layer.glsl"

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (!inside(p) || depth_at(p) > 0.0) return;
    int here = index_of(p);
    ivec2 border = clamp(p, k.origin, k.origin + k.window - 1);
    bool hole = border == p;
    uint first = imageLoad(behind, layer_index(p >> 1)).x;
    vec3 n = layer_normal(first);
    vec4 seen = vec4(dot(n, ray_of(vec2(p))) > 0.0 ? -n : n, layer_depth_at(first, p));
    vec4 last = hole ? vec4(0.0) : imageLoad(surfaces, index_of(border));
    float ratio = dot(last.xyz, ray_of(vec2(border))) / dot(last.xyz, ray_of(vec2(p)));
    vec4 goes_on = last.w > 0.0 && abs(ratio - 1.5) < 1.2 ? vec4(last.xyz, last.w * ratio) : vec4(0.0);
    vec4 surface = first != 0u ? seen : goes_on;
    widened[here] = vec4(surface.xyz, hole ? -surface.w : surface.w);
}
