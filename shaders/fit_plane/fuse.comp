// In recordings, between the first and the second pass of depth preparation: the mean depth of a pixel's surface over this
// frame and its neighbours. Frames that saw another surface there do not count.
//
// Holes take what neighbours saw there: shadows of the projector, and the outlines where a sensor mixed two surfaces. Of the
// nearest and the farthest surface the farther one, unless twice as many frames saw the nearer one.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"
#include "lib/neighbour.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer kept;       // 1/z, `nowhere` where there is none
layout(binding = 1, r32f) readonly uniform imageBuffer neighbours; // z of each, one image after the other
layout(binding = 2, r32ui) readonly uniform uimageBuffer ends;     // of holes, as shaders/fit_plane/splat.comp has them
layout(binding = 16, scalar) writeonly buffer Fused { float fused[]; };   // like `kept`
layout(binding = 17, scalar) writeonly buffer Relief { float relief[]; }; // of what one frame errs, how much is left
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

FitPlaneConstants k;

struct Mean {
    float z, weights;
};

// Of what all frames saw along a ray about depth z; `own` is this frame's weight. A second round is about the first one's mean,
// so that it leans to no frame.
Mean mean_about(float z, vec3 ray, float own, int here) {
    float narrow = 1.0 / (3.5 * (k.noise_floor + k.noise_per_z2 * z * z));
    int count = not_compiled_in(k.neighbours, here), rounds = not_compiled_in(2, here), round = 0;
    float offset = 0.0, weights = 0.0;
    do {
        float sum = 0.0, middle = offset;
        weights = own * positive(1.0 - middle * middle * narrow * narrow);
        int i = 0;
        do {
            NeighbourPlace place = constants.places[i];
            vec3 there = point_there(ray * z, place);
            float along = turned_there(ray, place).z; // its z per z of this view
            vec2 at;
            bool sees = seen_there(there, place, k.size, at) && along > 0.2;
            int index = index_there(i, at, k.size, sees);
            float recorded = imageLoad(neighbours, index).x, farther = (recorded - there.z) / along, apart = (farther - middle) * narrow;
            float weight = sees && recorded > 0.0 ? positive(1.0 - apart * apart) : 0.0;
            weights += weight;
            sum += weight * farther;
        } while (++i < count);
        offset = sum / max(weights, 1e-6);
    } while (++round < rounds);
    return Mean(z + offset, weights);
}

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    vec3 ray = ray_through(k.camera, vec2(p));
    float w = imageLoad(kept, here).x, nearest_w = uintBitsToFloat(imageLoad(ends, here).x);
    bool seen = w > 0.0, filled = !seen && nearest_w > 0.0;
    Mean mean = Mean(1.0, 1.0);
    if (seen || filled) mean = mean_about(1.0 / (seen ? w : nearest_w), ray, seen ? 1.0 : 0.0, here);
    if (filled) {
        Mean farthest = mean_about(uintBitsToFloat(imageLoad(ends, k.size.x * k.size.y + here).x), ray, 0.0, here);
        if (mean.weights < 2.0 * farthest.weights) mean = farthest;
        filled = mean.weights > 0.5;
    }
    fused[here] = seen || filled ? 1.0 / mean.z : nowhere;
    relief[here] = inversesqrt(max(mean.weights, 1e-6));
}
