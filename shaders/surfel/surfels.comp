// Depth, normal and silhouette width -> surfels. What shows w pixels across between two drops to something farther is taken
// to be half as thick; what goes on behind something nearer, or out of the image, is taken to be thick.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/cheap.glsl"
#include "lib/surfel.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth;
layout(binding = 1, r32f) readonly uniform imageBuffer normals;
layout(binding = 2, rg32ui) readonly uniform uimageBuffer edges;
layout(binding = 16, rg32ui) writeonly uniform uimageBuffer surfels;
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

const int open = 1 << 20; // a run without an end

// Pixels from i to the last edge at or before it, itself counted; `open` where none lies within reach or where the surface
// goes on behind it.
int before(int base, int stride, int i, int reach) {
    int word = i >> 5;
    int lowest = max((i - reach) >> 5, 0);
    uvec2 e = imageLoad(edges, base + word * stride).xy;
    uint found = e.x & (0xffffffffu >> (31 - (i & 31)));
    while (found == 0u && word > lowest) {
        --word;
        e = imageLoad(edges, base + word * stride).xy;
        found = e.x;
    }
    int bit = findMSB(found);
    bool drops = found != 0u && ((e.y >> (bit & 31)) & 1u) == 1u;
    return drops ? i - (word * surfel_run + bit) + 1 : open;
}

int after(int base, int stride, int i, int reach, int words) {
    int word = (i + 1) >> 5;
    int highest = min((i + 1 + reach) >> 5, words - 1);
    bool inside = word < words;
    uvec2 e = imageLoad(edges, base + min(word, words - 1) * stride).xy;
    uint found = inside ? e.x & (0xffffffffu << ((i + 1) & 31)) : 0u;
    while (found == 0u && word < highest) {
        ++word;
        e = imageLoad(edges, base + word * stride).xy;
        found = e.x;
    }
    int bit = findLSB(found);
    bool drops = found != 0u && ((e.y >> (bit & 31)) & 1u) == 0u;
    return drops ? word * surfel_run + bit - i : open;
}

void main() {
    SurfelConstants s = constants;
    ScreenConstants k = s.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float z = imageLoad(depth, here).x;
    vec3 n = vec3(imageLoad(normals, 3 * here).x, imageLoad(normals, 3 * here + 1).x, imageLoad(normals, 3 * here + 2).x);

    // Beyond this width a surfel is as thick as it gets.
    float pixels_per_m = min(k.camera.fx, k.camera.fy) / max(z, 1e-6);
    int reach = nearest(at_most_one(2.0 * s.thickest * pixels_per_m * (1.0 / 16384.0)) * 16384.0) + 1;
    int columns = s.words.x * k.size.y;
    int across = before(p.y, k.size.y, p.x, reach) + after(p.y, k.size.y, p.x, reach, s.words.x) - 1;
    int along = before(columns + p.x, k.size.x, p.y, reach) + after(columns + p.x, k.size.x, p.y, reach, s.words.y) - 1;
    float width = min(float(across) / k.camera.fx, float(along) / k.camera.fy) * z;
    float thickness = clamp(0.5 * width, s.thinnest, s.thickest);

    imageStore(surfels, surfel_index(p, s.plane), uvec4(surfel(z, n, thickness / s.thickest), 0u, 0u));
}
