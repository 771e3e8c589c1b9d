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

// Pixels of a column: their rays, and this frame's weights. Together they pay once for what a neighbour's place costs to load.
struct Column {
    vec3 ray, down; // through the first pixel; what each further one adds
    vec4 own;
};
const vec4 rows = vec4(0.0, 1.0, 2.0, 3.0);

struct Means {
    vec4 z, weights;
};

// How much farther than depths z the neighbour saw something there, along the rays; `nothing` where it saw none.
const float nothing = 1e9;
vec4 farther_of(int i, vec4 z, Column column) {
    NeighbourPlace place = constants.places[i];
    vec3 ray = turned_there(column.ray, place), down = turned_there(column.down, place), origin = turned_there(-place.shift, place);
    vec4 along = ray.z + rows * down.z; // its z per z of this view
    vec4 there_z = along * z + origin.z, inverse = 1.0 / there_z;
    vec4 u = (((ray.x + rows * down.x) * z + origin.x) * inverse - place.ray_base.x) / place.ray_step.x;
    vec4 v = (((ray.y + rows * down.y) * z + origin.y) * inverse - place.ray_base.y) / place.ray_step.y;
    vec2 half_size = 0.5 * vec2(k.size);
    vec4 outside = max(abs(u + 0.5 - half_size.x) - half_size.x, abs(v + 0.5 - half_size.y) - half_size.y);
    ivec4 index = mix(ivec4(0), (i * k.size.y + nearest(v)) * k.size.x + nearest(u), lessThan(outside, vec4(0.0)));
    vec4 recorded = vec4(imageLoad(neighbours, index.x).x, imageLoad(neighbours, index.y).x, imageLoad(neighbours, index.z).x,
                         imageLoad(neighbours, index.w).x);
    vec4 unseen = max(max(outside, -recorded), max(-there_z, 0.2 - along));
    return mix(vec4(nothing), (recorded - there_z) / along, lessThan(unseen, vec4(0.0)));
}

// Of what all frames saw along the rays about depths z. A second round is about the first one's mean, so that it leans to no frame.
Means means_about(vec4 z, Column column) {
    vec4 narrow = 1.0 / (3.5 * (k.noise_floor + k.noise_per_z2 * z * z));
    vec4 apart[most_neighbours], sum = vec4(0.0), weights = column.own;
    int i = 0;
    do {
        vec4 e = farther_of(i, z, column) * narrow, weight = positive(1.0 - e * e);
        apart[i] = e;
        weights += weight;
        sum += weight * e;
    } while (++i < k.neighbours);
    vec4 middle = sum / max(weights, 1e-6);
    weights = column.own * positive(1.0 - middle * middle);
    sum = vec4(0.0);
    i = 0;
    do {
        vec4 e = apart[i], from_middle = e - middle, weight = positive(1.0 - from_middle * from_middle);
        weights += weight;
        sum += weight * e;
    } while (++i < k.neighbours);
    return Means(z + sum / (max(weights, 1e-6) * narrow), weights);
}

// The greatest 1/z and the greatest z that neighbours saw there; 0 = none.
vec2 ends_at(ivec2 p) {
    ivec2 inside = clamp(p, ivec2(0), k.size - 1);
    int at = inside.y * k.size.x + inside.x;
    return vec2(uintBitsToFloat(imageLoad(ends, at).x), uintBitsToFloat(imageLoad(ends, k.size.x * k.size.y + at).x));
}

// Loops test at their end and stand for branches: lavapipe goes through a branch with all lanes off, and once through a loop.
void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy) * ivec2(1, fused_rows);
    if (any(greaterThanEqual(p, k.size))) return;
    ivec4 at = min(p.y + ivec4(0, 1, 2, 3), k.size.y - 1) * k.size.x + p.x;
    vec4 w = vec4(imageLoad(kept, at.x).x, imageLoad(kept, at.y).x, imageLoad(kept, at.z).x, imageLoad(kept, at.w).x);
    bvec4 seen = greaterThan(w, vec4(0.0));

    // Not every pixel of the neighbours was splatted: a hole's pixel that none met asks those beside it.
    vec4 nearest_w = vec4(0.0), farthest_z = vec4(0.0);
    bool asks;
    int beside = 0;
    do {
        ivec2 q = p + ivec2(beside == 1 ? 1 : beside == 2 ? -1 : 0, beside == 3 ? 1 : beside == 4 ? -1 : 0);
        vec2 a = ends_at(q), b = ends_at(q + ivec2(0, 1)), c = ends_at(q + ivec2(0, 2)), d = ends_at(q + ivec2(0, 3));
        bvec4 none = equal(nearest_w, vec4(0.0));
        nearest_w = mix(nearest_w, vec4(a.x, b.x, c.x, d.x), none);
        farthest_z = mix(farthest_z, vec4(a.y, b.y, c.y, d.y), none);
        asks = any(equal(mix(nearest_w, vec4(1.0), seen), vec4(0.0)));
    } while (++beside < 5 && asks);

    bvec4 fills = greaterThan(mix(nearest_w, vec4(0.0), seen), vec4(0.0));
    vec4 z = 1.0 / mix(mix(vec4(1.0), nearest_w, fills), w, seen);
    Column column = Column(ray_through(k.camera, vec2(p)), vec3(0.0, 1.0 / k.camera.fy, 0.0), vec4(seen));
    Means means = Means(z, vec4(0.0));
    int hypotheses = any(fills) ? 2 : 1, hypothesis = 0;
    do {
        Means found = means_about(z, column);
        bvec4 takes = hypothesis == 0 ? bvec4(true) : lessThan(mix(vec4(nothing), means.weights, fills), 2.0 * found.weights);
        means = Means(mix(means.z, found.z, takes), mix(means.weights, found.weights, takes));
        z = mix(z, farthest_z, fills);
    } while (++hypothesis < hypotheses);

    for (int r = 0; r < fused_rows; ++r)
        if (p.y + r < k.size.y) {
            bool known = seen[r] || (fills[r] && means.weights[r] > 0.5);
            fused[at[r]] = known ? 1.0 / means.z[r] : nowhere;
            relief[at[r]] = inversesqrt(max(means.weights[r], 1e-6));
        }
}
