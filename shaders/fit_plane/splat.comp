// In recordings, before frames are fused: the nearest and the farthest surface that the neighbours saw where this frame has a
// hole. Of 2x2 pixels of each neighbour one takes part, from neighbour to neighbour another one, or all where there are few
// neighbours: all of twelve would take four times as long (50 ms on lavapipe), and of what is missing fuse.comp finds most beside
// it. The order of threads changes nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"
#include "lib/cheap.glsl"
#include "lib/neighbour.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer kept;       // 1/z, `nowhere` where there is none
layout(binding = 1, r32f) readonly uniform imageBuffer neighbours; // z of each, one image after the other
layout(binding = 16, scalar) buffer Ends { uint ends[]; }; // of each pixel the bits of the greatest 1/z, then of the greatest z; 0 = none
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

void main() {
    FitPlaneConstants k = constants;
    ivec2 block = ivec2(gl_GlobalInvocationID.xy) * 2;
    if (any(greaterThanEqual(block, k.size))) return;
    int corners = k.neighbours < 4 ? 4 : 1, count = not_compiled_in(k.neighbours, block.x) * corners, turn = 0;
    do {
        int i = turn / corners;
        NeighbourPlace place = constants.places[i];
        // They come from before and from after this frame in turns: four in a row take all four pixels, and so do four of either side.
        int corner = (corners == 4 ? turn : (i >> 1) + 2 * (i & 1)) & 3;
        ivec2 p = min(block + ivec2(corner == 1 || corner == 2 ? 1 : 0, corner & 1), k.size - 1);
        float z = imageLoad(neighbours, (i * k.size.y + p.y) * k.size.x + p.x).x;
        vec3 point = point_here(ray_there(vec2(p), place) * z, place);
        vec2 at = vec2(k.camera.fx, k.camera.fy) * point.xy / point.z + vec2(k.camera.cx, k.camera.cy);
        bool sees = z > 0.0 && point.z > 0.0 && all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(k.size) - 0.5));
        int there = sees ? nearest(at.y) * k.size.x + nearest(at.x) : 0;
        if (sees && imageLoad(kept, there).x <= 0.0) {
            atomicMax(ends[there], floatBitsToUint(1.0 / point.z)); // bits of positive numbers order as these do
            atomicMax(ends[k.size.x * k.size.y + there], floatBitsToUint(point.z));
        }
    } while (++turn < count);
}
