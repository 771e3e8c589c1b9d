// Depth, normal and silhouette width -> surfels. What shows w pixels across between two drops to something farther is taken
// to be half as thick; what goes on behind something nearer, or out of the image, is taken to be thick.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"
#include "lib/surfel.glsl"

layout(constant_id = spec_layers) const int layers = 1;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 1, rg32ui) readonly uniform uimageBuffer edges;
layout(binding = 2, r32ui) readonly uniform uimageBuffer runs;
layout(binding = 3, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 4, r32ui) readonly uniform uimageBuffer behind;
layout(binding = 5, r32ui) readonly uniform uimageBuffer shapes;
layout(binding = 6, rg32ui) readonly uniform uimageBuffer neighbours;
layout(binding = 7, r32f) readonly uniform imageBuffer poses;
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

float pose(int neighbour, int i) { return imageLoad(poses, neighbour * neighbour_floats + i).x; }
vec3 row(int neighbour, int i) { return vec3(pose(neighbour, i), pose(neighbour, i + 1), pose(neighbour, i + 2)); }

// Whether a neighbour looked through a point of this view.
bool free(int i, vec3 point, float margin) {
    vec3 away = point - row(i, 9);
    vec3 there = away.x * row(i, 0) + away.y * row(i, 3) + away.z * row(i, 6); // the inverse rotation
    vec2 at = (there.xy / there.z - vec2(pose(i, 14), pose(i, 15))) / vec2(pose(i, 12), pose(i, 13));
    bool sees = there.z > 0.0 && all(greaterThan(at, vec2(-0.5))) && all(lessThan(at, vec2(k.window) - 0.5));
    ivec2 p = sees ? ivec2(floor(at + 0.5)) : ivec2(0);
    float z = uintBitsToFloat(imageLoad(neighbours, (i * k.window.y + p.y) * k.window.x + p.x).x);
    return sees && z > there.z + margin;
}

// The share of a thickness that no neighbour looked through.
float solid(vec3 point, float thickness) {
    vec3 away = normalize(point) * thickness;
    float margin = max(0.02 * k.radius, 0.01 * point.z) + 3.0 * sigma_of(point.z), share = 1.0;
    for (int i = 0; i < k.neighbours; ++i) {
        share = share > 0.75 && free(i, point + away, margin) ? 0.75 : share;
        share = share > 0.37 && free(i, point + 0.5 * away, margin) ? 0.37 : share;
        share = share > 0.18 && free(i, point + 0.25 * away, margin) ? 0.18 : share;
        share = share > 0.09 && free(i, point + 0.125 * away, margin) ? 0.09 : share;
    }
    return share;
}

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    vec4 surface = imageLoad(surfaces, p.y * k.size.x + p.x);
    float z = surface.w;

    int across = run_length(p.x, (p.x >> 5) * k.size.y + p.y);
    int along = run_length(p.y, s.words.x * k.size.y + (p.y >> 5) * k.size.x + p.x);
    float width = min(float(across) / k.camera.fx, float(along) / k.camera.fy) * abs(z);
    bool ends_in_sight = across < open || along < open;
    float thickness = ends_in_sight ? clamp(0.5 * width, s.thinnest, s.thickest) : s.hidden;

    if (layers == 1) {
        imageStore(surfels, surfel_index(p, s.plane), uvec4(surfel(z, surface.xyz, thickness / s.thickest), 0u, 0u));
        return;
    }
    // What other views saw behind this pixel; where this one saw nothing the first of it is the surface itself.
    int here = p.y * k.size.x + p.x, pixels = k.size.x * k.size.y;
    bool own = imageLoad(depth_in, here).x > 0.0;
    uvec2 one = uvec2(imageLoad(behind, here).x, imageLoad(shapes, here).x);
    uvec2 two = uvec2(imageLoad(behind, pixels + here).x, imageLoad(shapes, pixels + here).x);
    uvec2 second = own ? one : two, third = own ? two : uvec2(0u);
    float beyond = 1.0 / uintBitsToFloat(second.x);
    // No surface is thicker than the way to what was seen behind it.
    thickness = second.x != 0u ? max(min(thickness, 0.7 * (beyond - abs(z))), s.thinnest) : thickness;
    if (z != 0.0) thickness = max(thickness * solid(ray_of(vec2(p)) * abs(z), thickness), s.thinnest);
    uvec2 word = surfel(z, surface.xyz, thickness / s.thickest);
    // The last bit of a depth tells that there is another layer.
    int at = surfel_index(p, s.plane), layer = 16 * s.plane.x * s.plane.y;
    imageStore(surfels, at, uvec4((word.x & ~1u) | uint(second.x != 0u), word.y, 0u, 0u));
    imageStore(surfels, layer + at,
               uvec4(second.x == 0u ? 0u : (floatBitsToUint(beyond) & ~1u) | uint(third.x != 0u), second.y, 0u, 0u));
    imageStore(surfels, 2 * layer + at, uvec4(third.x == 0u ? 0u : floatBitsToUint(1.0 / uintBitsToFloat(third.x)) & ~1u, third.y, 0u, 0u));
}
