// First pass of depth preparation: depth becomes 1/z, and flying pixels, where a sensor mixed two surfaces, become holes.
// A flying pixel agrees with less than a quarter of its neighbours, or with less than half and has both nearer and farther
// ones. A wire agrees with two neighbours and has no nearer ones.
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

void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    float z = depth_at(p);
    // A slope up to 76 degrees is one surface.
    float tolerance = 3.0 * (k.noise_floor + k.noise_per_z2 * z * z) + 4.0 * z / k.camera.fx;
    int known = 0, friends = 0;
    bool nearer = false, farther = false;
    for (int i = 0; i < 8; ++i) {
        int j = i < 4 ? i : i + 1;
        float other = depth_at(p + ivec2(j % 3, j / 3) - 1);
        known += other > 0.0 ? 1 : 0;
        friends += abs(other - z) <= tolerance ? 1 : 0;
        nearer = nearer || (other > 0.0 && other < z - tolerance);
        farther = farther || other > z + tolerance;
    }
    bool flies = 4 * friends < (nearer && farther ? 2 * known : known);
    bool keep = z > 0.0 && !(flies && k.drop_flying != 0);
    imageStore(kept, p.y * k.size.x + p.x, vec4(keep ? 1.0 / z : 0.0));
}
