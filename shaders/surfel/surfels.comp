// Depth, normal and silhouette width -> surfels. What shows w pixels across between two drops to something farther is taken
// to be half as thick; what goes on behind something nearer, or out of the image, is taken to be thick.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/cheap.glsl"
#include "lib/surfel.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 1, rg32ui) readonly uniform uimageBuffer edges;
layout(binding = 2, r32ui) readonly uniform uimageBuffer runs;
layout(binding = 16, rg32ui) writeonly uniform uimageBuffer surfels;
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

const int open = 1 << 20; // a run that ends behind something nearer, or at the border of the image

// Pixels of the run that pixel i of a line lies in; `open` where an end of it is hidden. `index` is that of the word.
int run_length(int i, int index) {
    int bit = i & 31;
    uvec2 e = imageLoad(edges, index).xy;
    uint here = e.x & (0xffffffffu >> (31 - bit)); // edges at or before the pixel
    int last = findMSB(here);
    uint before = imageLoad(runs, 2 * index).x;
    before = here != 0u ? uint((i & ~31) + last) << 1 | (e.y >> (last & 31) & 1u) : before;
    uint there = bit == 31 ? 0u : e.x & (0xfffffffeu << bit); // edges behind it
    int first = findLSB(there);
    uint after = imageLoad(runs, 2 * index + 1).x;
    after = there != 0u ? uint((i & ~31) + first) << 1 | (~e.y >> (first & 31) & 1u) : after;
    return (before & after & 1u) == 1u ? int(after >> 1) - int(before >> 1) : open;
}

void main() {
    SurfelConstants s = constants;
    ScreenConstants k = s.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    vec4 surface = imageLoad(surfaces, p.y * k.size.x + p.x);
    float z = surface.w;

    int across = run_length(p.x, (p.x >> 5) * k.size.y + p.y);
    int along = run_length(p.y, s.words.x * k.size.y + (p.y >> 5) * k.size.x + p.x);
    float width = min(float(across) / k.camera.fx, float(along) / k.camera.fy) * abs(z);
    bool ends_in_sight = across < open || along < open;
    float thickness = ends_in_sight ? clamp(0.5 * width, s.thinnest, s.thickest) : s.hidden;

    imageStore(surfels, surfel_index(p, s.plane), uvec4(surfel(z, surface.xyz, thickness / s.thickest), 0u, 0u));
}
