// Depth, normal and silhouette width -> surfels. A surface that is w wide between two drops to farther ones is assumed to reach
// 0.65 w back. One that ends behind something narrower is at most as much wider as that hides it. One that goes on behind
// something wide, or out of the image, or is seen again beyond, is assumed to be thick.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"
#include "lib/cheap.glsl"
#include "lib/surfel.glsl"
#include "surfel/layer.glsl"

layout(constant_id = spec_layers) const int layers = 1;

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 1, rg32ui) readonly uniform uimageBuffer edges;
layout(binding = 2, r32ui) readonly uniform uimageBuffer runs;
layout(binding = 3, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 4, r32ui) readonly uniform uimageBuffer behind;
layout(binding = 16, scalar) writeonly buffer Surfels { uvec2 surfels[]; };
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

const int open = 1 << 20; // a run with an end that is not known

// A row or column: its pixels in `surfaces`, its words in `edges`.
struct Line {
    int start, step, pixels, first_word, next_word;
};

// Edges beside pixel i, doubled; the last bit is set where what lies beyond is farther away, so that the end is in sight.
uint edge_before(Line line, int i) { // the first pixel of its run
    int word = line.first_word + (i >> 5) * line.next_word, bit = i & 31;
    uvec2 e = imageLoad(edges, word).xy;
    uint here = e.x & (0xffffffffu >> (31 - bit));
    int last = findMSB(here);
    uint before = imageLoad(runs, 2 * word).x;
    return here != 0u ? uint((i & ~31) + last) << 1 | (e.y >> (last & 31) & 1u) : before;
}
uint edge_after(Line line, int i) { // the first pixel of the next run
    int word = line.first_word + (i >> 5) * line.next_word, bit = i & 31;
    uvec2 e = imageLoad(edges, word).xy;
    uint there = bit == 31 ? 0u : e.x & (0xfffffffeu << bit);
    int first = findLSB(there);
    uint after = imageLoad(runs, 2 * word + 1).x;
    return there != 0u ? uint((i & ~31) + first) << 1 | (~e.y >> (first & 31) & 1u) : after;
}

float inverse_at(Line line, int i) { return 1.0 / max(abs(imageLoad(surfaces, line.start + i * line.step).w), 1e-6); }

// Whether the surface that ends at pixel `last` goes on at pixel `i`, behind something nearer.
bool goes_on(Line line, int last, int i) {
    float w = inverse_at(line, last), there = inverse_at(line, i);
    return abs(there - w) < 0.02 * w;
}

// Pixels of the run that pixel i lies in; `open` where an end is not known. A surface that ends behind something narrower goes
// on there at most as far as that hides it, unless it is seen again beyond.
int run_length(Line line, int i) {
    uint before = edge_before(line, i), after = edge_after(line, i);
    int first = int(before >> 1), end = int(after >> 1);
    if ((before & 1u) == 0u) {
        if (first >= line.pixels) return open; // the border of the image
        uint hider = edge_before(line, first - 1);
        int from = int(hider >> 1);
        if ((hider & 1u) == 0u || goes_on(line, first, from - 1)) return open;
        first = from;
    }
    if ((after & 1u) == 0u) {
        if (end >= line.pixels) return open;
        uint hider = edge_after(line, end);
        int until = int(hider >> 1);
        if ((hider & 1u) == 0u || goes_on(line, end - 1, until)) return open;
        end = until;
    }
    return end - first;
}

// How far behind depth z the next layer lies, 0 where there is none, in the four last bits of a depth: quarters of the radius.
// The bit before them tells what other views saw, or may have.
const uint place_mask = 31u, foreign = 16u;

// The surfel of a layer, thin; `place` is its depth's last bits.
uvec2 hidden_surfel(uint word, ivec2 p, SurfelConstants s, uint place) {
    uvec2 w = surfel(layer_depth_at(word, p), layer_normal(word), 0.0);
    return word == 0u ? uvec2(0u) : uvec2((w.x & ~place_mask) | place | foreign, w.y | uint(s.hidden_shape));
}

uint place_of(uint word, ivec2 p, float z) {
    return word == 0u ? 0u : uint(clamp(1 + int((layer_depth_at(word, p) - z) * 4.0 / k.radius), 1, 15));
}

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    vec4 surface = imageLoad(surfaces, p.y * k.size.x + p.x);
    float z = surface.w;

    int across = run_length(Line(p.y * k.size.x, 1, k.size.x, p.y, k.size.y), p.x);
    int along = run_length(Line(p.x, k.size.x, k.size.y, s.words.x * k.size.y + p.x, k.size.x), p.y);
    float width = min(float(across) / k.camera.fx, float(along) / k.camera.fy) * abs(z);
    bool ends_in_sight = across < open || along < open;
    float thickness = ends_in_sight ? clamp(0.65 * width, s.thinnest, s.thickest) : s.thickest;

    if (layers == 1) {
        surfels[surfel_index(p, s.plane)] = surfel(z, surface.xyz, thickness / s.thickest);
        return;
    }
    // Layers that other views saw behind this pixel; where this view saw nothing, the first layer is the surface itself.
    bool own = imageLoad(depth_in, index_of(p)).x > 0.0;
    int block = layer_index(p >> 1);
    uint one = imageLoad(behind, block).x, two = imageLoad(behind, layers_size() + block).x;
    // A layer behind the nearest pixel of the block need not be behind this pixel.
    bool behind_this = own && layer_depth_at(one, p) > z + layer_gap(z, s);
    uint second = behind_this ? one : two, third = behind_this ? two : 0u;
    // No surface is thicker than the distance to the layer behind it.
    thickness = max(min(thickness, 0.7 * (layer_depth_at(second, p) - abs(z))), s.thinnest);
    uvec2 word = surfel(z, surface.xyz, thickness / s.thickest);
    int at = surfel_index(p, s.plane), layer = 16 * s.plane.x * s.plane.y;
    surfels[at] = uvec2((word.x & ~place_mask) | place_of(second, p, abs(z)) | (own ? 0u : foreign), word.y);
    surfels[layer + at] = hidden_surfel(second, p, s, place_of(third, p, layer_depth_at(second, p)));
    surfels[2 * layer + at] = hidden_surfel(third, p, s, 0u);
}
