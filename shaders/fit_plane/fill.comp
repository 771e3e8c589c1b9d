// Fourth pass of depth preparation: narrow holes get the depth of the surface behind them, so that it occludes what is around.
// Structured light and stereo leave a shadow beside what stands in front, and sensors lose single pixels and outlines. Nothing
// is seen in such a hole, so it gets no visibility of its own. A hole wider than `fill_px` may be a window, and stays.
//
// Along its row, the farther of the two surfaces beside a hole continues as a plane: a nearer one would be seen.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth; // z of the plane fits, 0 in holes
layout(binding = 1, r32f) readonly uniform imageBuffer normals;
layout(binding = 16, scalar) writeonly buffer Filled { float filled[]; };
layout(binding = 17, scalar) writeonly buffer Normals { vec3 normals_out[]; }; // the same: written in holes, read elsewhere
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

FitPlaneConstants k;

float depth_at(ivec2 p) {
    bool inside = uint(p.x) < uint(k.size.x);
    float z = imageLoad(depth, inside ? p.y * k.size.x + p.x : 0).x;
    return inside ? z : 0.0;
}

// Of the plane fit; zero where there is none.
vec3 normal_at(int index) {
    return vec3(imageLoad(normals, 3 * index).x, imageLoad(normals, 3 * index + 1).x, imageLoad(normals, 3 * index + 2).x);
}

// Pixels from p along its row to the next one with depth, `most` + 1 where there is none so near.
int to_depth(ivec2 p, int direction, int most) {
    int i = 0;
    do ++i;
    while (i <= most && !(depth_at(p + ivec2(i * direction, 0)) > 0.0));
    return i;
}

// The depth of a pixel's plane at a pixel `apart` to its right; its own where no plane was fitted.
float continued(ivec2 from, int apart, vec3 n, float z) {
    vec3 ray = ray_through(k.camera, vec2(from)), there = ray_through(k.camera, vec2(from) + vec2(apart, 0.0));
    float here = dot(n, ray), ahead = dot(n, there);
    return here == 0.0 ? z : here * ahead > 0.0 ? z * here / ahead : 1e30;
}

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float z = imageLoad(depth, here).x;
    // One loop for all lanes; the second looks no farther than the hole may be wide.
    int most = z > 0.0 ? 0 : k.fill_px;
    int left = to_depth(p, -1, most);
    bool has_left = left <= most;
    int before_it = has_left ? left : p.x + 1; // the image's border may be one side
    most = z > 0.0 ? 0 : k.fill_px + 1 - before_it;
    int right = to_depth(p, 1, most);
    bool has_right = right <= most;
    float before = has_left ? depth_at(p - ivec2(left, 0)) : 0.0, after = has_right ? depth_at(p + ivec2(right, 0)) : 0.0;
    int width = before_it + (has_right ? right : k.size.x - p.x) - 1;
    bool fills = !(z > 0.0) && (has_left || has_right) && width <= k.fill_px;
    int apart = before > after ? left : -right;
    float farther = max(before, after), nearer = has_left && has_right ? min(before, after) : farther;
    ivec2 from = fills ? p - ivec2(apart, 0) : ivec2(0);
    vec3 n = normal_at(from.y * k.size.x + from.x);
    filled[here] = fills ? clamp(continued(from, apart, n, farther), nearer, 1.3 * farther) : z;
    if (fills) normals_out[here] = n;
}
