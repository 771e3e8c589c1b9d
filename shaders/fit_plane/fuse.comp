// In recordings, between the first and the second pass of depth preparation: the mean depth of a pixel's surface over this
// frame and its neighbours. Frames that saw another surface there do not count.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"
#include "lib/neighbour.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer kept;       // 1/z, `nowhere` where there is none
layout(binding = 1, r32f) readonly uniform imageBuffer neighbours; // z of each, one image after the other
layout(binding = 16, scalar) writeonly buffer Fused { float fused[]; };   // like `kept`
layout(binding = 17, scalar) writeonly buffer Relief { float relief[]; }; // of what one frame errs, how much is left
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

void main() {
    FitPlaneConstants k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float w = imageLoad(kept, here).x;
    bool hole = !(w > 0.0);
    float z = hole ? 1.0 : 1.0 / w;
    vec3 ray = ray_through(k.camera, vec2(p));
    float narrow = 1.0 / (3.5 * (k.noise_floor + k.noise_per_z2 * z * z));
    float weights = 1.0, sum = 0.0; // of weights and of differences of z
    int i = 0, count = not_compiled_in(k.neighbours, here);
    do {
        NeighbourPlace place = constants.places[i];
        vec3 there = point_there(ray * z, place);
        float along = turned_there(ray, place).z; // its z per z of this view
        vec2 at;
        bool sees = seen_there(there, place, k.size, at) && along > 0.2;
        int index = index_there(i, at, k.size, sees);
        float recorded = imageLoad(neighbours, index).x, apart = (recorded - there.z) * narrow;
        float weight = sees && recorded > 0.0 ? positive(1.0 - apart * apart) : 0.0;
        weights += weight;
        sum += weight * (recorded - there.z) / along;
    } while (++i < count);
    fused[here] = hole ? nowhere : 1.0 / (z + sum / weights);
    relief[here] = inversesqrt(weights);
}
