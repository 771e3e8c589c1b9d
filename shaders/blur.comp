// The published blurs of luna and hemisphere: one direction of a separable Gaussian over the pixels of the same surface.
// Before denoise, where a room asks for it.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_blur_radius) const int radius = 5;
layout(constant_id = spec_blur_down) const int down = 0;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 1, r32f) readonly uniform imageBuffer from;
layout(binding = 2, r32f) readonly uniform imageBuffer weights; // of offsets 0, 1, 2 ...
layout(binding = 16, scalar) writeonly buffer To { float to[]; };
layout(binding = 32, scalar) uniform Constants { ScreenConstants constants; };

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = index_of(p);
    vec4 own = imageLoad(surfaces, here);
    float z = own.w;
    vec3 normal = own.xyz, point = ray_of(vec2(p)) * z;
    // Off the pixel's plane by more than this is another surface: a limit on depth would cut slopes apart.
    float tolerance = max(max(0.02 * z, 3.0 * sigma_of(z)), 0.1 * k.radius);
    float weight = imageLoad(weights, 0).x, sum = weight * imageLoad(from, here).x;
    for (int i = -radius; i <= radius; ++i) {
        ivec2 q = p + (down != 0 ? ivec2(0, i) : ivec2(i, 0));
        bool known = inside(q) && i != 0;
        int at = known ? index_of(q) : here;
        vec4 other = imageLoad(surfaces, at); // its normal is zero in holes
        float off = dot(normal, ray_of(vec2(q)) * other.w - point);
        bool same = known && dot(normal, other.xyz) >= 0.8 && abs(off) <= tolerance;
        float w = same ? imageLoad(weights, abs(i)).x : 0.0;
        sum += w * imageLoad(from, at).x;
        weight += w;
    }
    to[here] = sum / weight;
}
