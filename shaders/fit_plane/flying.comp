// First pass of depth preparation: depth becomes 1/z, and flying pixels, where a sensor mixed two surfaces, become holes.
// A flying pixel agrees with less than a quarter of its neighbours, or with less than half and has both nearer and farther
// ones. A wire agrees with two neighbours and has no nearer ones. Neighbours on a slope agree, however steep it is: floors seen
// at grazing angles, and rows that were doubled or interpolated when depth was aligned to colour.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer recorded;
layout(binding = 16, r32f) uniform writeonly imageBuffer kept; // 1/z, 0 where there is none
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants k; };

float depth_at(ivec2 p) {
    bool inside = all(lessThan(uvec2(p), uvec2(k.size)));
    return imageLoad(recorded, inside ? p.y * k.size.x + p.x : 0).x * float(inside);
}

// Whether 1/z changes evenly over five pixels to either side. Between two surfaces it changes within fewer, even where a sensor
// smears the edge over seven pixels.
bool is_slope(ivec2 p, ivec2 step, float z_here) {
    vec4 z = vec4(depth_at(p - 5 * step), depth_at(p + 5 * step), depth_at(p - 2 * step), depth_at(p + 2 * step));
    vec4 change = vec4(-1.0, 1.0, -1.0, 1.0) * (1.0 / max(z, 1e-6) - 1.0 / z_here);
    vec2 outer = change.xy, inner = change.zw;
    return all(greaterThan(z, vec4(0.0))) && inner.x * inner.y > 0.0 &&
           max(abs(inner.x), abs(inner.y)) < 2.5 * min(abs(inner.x), abs(inner.y)) &&
           all(greaterThan(outer * inner, 1.6 * inner * inner)) && all(lessThan(outer * inner, 4.0 * inner * inner));
}

void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    float z = depth_at(p);
    // A slope up to 76 degrees is one surface.
    float tolerance = 3.0 * (k.noise_floor + k.noise_per_z2 * z * z) + 4.0 * z / k.camera.fx;
    int known = 0, friends = 0;
    bool nearer = false, farther = false;
    for (int i = 0; i < 4; ++i) { // pairs on opposite sides
        ivec2 step = ivec2(i % 3, i / 3) - 1;
        vec2 others = vec2(depth_at(p + step), depth_at(p - step));
        bvec2 there = greaterThan(others, vec2(0.0)), alike = lessThanEqual(abs(others - z), vec2(tolerance));
        if (!all(alike) && all(there) && is_slope(p, step, z)) alike = there;
        known += int(there.x) + int(there.y);
        friends += int(alike.x) + int(alike.y);
        nearer = nearer || any(bvec2(there.x && !alike.x && others.x < z, there.y && !alike.y && others.y < z));
        farther = farther || any(bvec2(!alike.x && others.x > z, !alike.y && others.y > z));
    }
    bool flies = 4 * friends < (nearer && farther ? 2 * known : known);
    bool keep = z > 0.0 && !(flies && k.drop_flying != 0);
    imageStore(kept, p.y * k.size.x + p.x, vec4(keep ? 1.0 / z : 0.0));
}
