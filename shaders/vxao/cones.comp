// VXAO: visibility as the light that passes voxels along cones over the surface, front to back, with coarser voxels the wider a
// cone gets.
//
// Crassin, Neyret, Sainz, Green, Eisemann, "Interactive Indirect Illumination Using Voxel Cone Tracing" (2011), sections 5 and 7.
// Departures: three opacities a voxel instead of six colours. Cones are cosine-distributed, so all weigh alike. A cone grows no
// wider than its height over the surface permits, or planes would close themselves. The radius is a hard limit.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/vxao.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 2, rg32f) readonly uniform imageBuffer noise_table;
layout(binding = 3, rg32ui) readonly uniform uimageBuffer table;
layout(binding = 4, r32ui) readonly uniform uimageBuffer counters;
layout(binding = 5, r32ui) readonly uniform uimageBuffer voxels;
layout(binding = 16, scalar) writeonly buffer Raw { float raw[]; };
layout(binding = 32, scalar) uniform Constants { VxaoConstants constants; };

#include "lib/normal.glsl"
#include "lib/noise.glsl"
#include "lib/surface.glsl"
#include "vxao/grid.glsl"
#include "vxao/numbers.glsl"
#include "vxao/patch.glsl"

const float golden_cosine = -0.73736888, golden_sine = 0.67549029; // of the golden angle, 137.508 degrees
const float dark = 0.003; // what passes less is closed

// Opacity at a point (voxels of level 0), along a direction of squared components w; negative where there is no brick.
float opacity_of_level(vec3 at, int level, vec3 w, VxaoConstants c) {
    vec3 q = at * (1.0 / float(1 << level)) - 0.5, low = floor(q), f = q - low;
    ivec3 corner = ivec3(low);
    int brick = brick_at(level, corner >> 3, c.slots_log2);
    if (brick < 0) return -1.0;
    int first = brick * vxao_stored + stored_at(corner & 7);
    vec4 a, b; // at the eight corners
    for (int i = 0; i < 4; ++i) {
        int to = first + (i & 1) + (i >> 1) * vxao_rimmed;
        a[i] = dot(w, coverage_of(imageLoad(voxels, to).x));
        b[i] = dot(w, coverage_of(imageLoad(voxels, to + vxao_rimmed * vxao_rimmed).x));
    }
    vec4 ab = mix(a, b, f.z);
    vec2 row = mix(ab.xy, ab.zw, f.y);
    return mix(row.x, row.y, f.x);
}

// Between two levels. What is in the finer one is in the coarser one, too.
float opacity_at(vec3 at, float level, vec3 w, VxaoConstants c) {
    int low = clamp(int(level), finest, c.levels - 1), high = min(low + 1, c.levels - 1);
    float coarse = opacity_of_level(at, high, w, c);
    if (coarse < 0.0) return 0.0;
    float share = clamp(level - float(low), 0.0, 1.0);
    if (share >= 1.0 || high == low) return coarse;
    return mix(max(opacity_of_level(at, low, w, c), 0.0), coarse, share);
}

void main() {
    VxaoConstants c = constants;
    k = c.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.window))) return;
    p += k.origin;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    Surface s = surface_at(p, z, here);
    vec2 noise = noise_at(p - k.origin); // the same with a guard band as without
    number_levels(c);

    // In voxels of level 0, along the grid's axes.
    int own_level = max(level_at(s.point.z, k.ray_step, c), finest);
    float voxel = float(1 << min(own_level, vxao_levels)), radius = k.radius * c.per_voxel;
    bool none = !(z > 0.0) || own_level >= c.levels;
    vec3 n = vec3(dot(c.grid_x, s.normal), dot(c.grid_y, s.normal), dot(c.grid_z, s.normal));
    // Above the surface by one voxel, and by what other views may lie off.
    float lift = max(voxel, k.alignment_error * c.per_voxel);
    vec3 start = in_grid(s.point, c) + lift * n;
    vec3 axis = abs(n.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
    vec3 e1 = normalize(axis - n * dot(axis, n)), e2 = cross(n, e1);
    vec2 direction = vec2(cos(noise.x * 6.2831853), sin(noise.x * 6.2831853));
    float inverse = 1.0 / float(c.cones), open = 0.0;
    for (int i = 0; i < c.cones && !none; ++i) {
        float sine2 = (float(i) + 0.5) * inverse, cosine = sqrt(1.0 - sine2), sine = sqrt(sine2);
        vec3 d = sine * (direction.x * e1 + direction.y * e2) + cosine * n, w = d * d;
        direction = mat2(golden_cosine, golden_sine, -golden_sine, golden_cosine) * direction;
        float passes = 1.0, t = voxel;
        while (t < radius && passes > dark) {
            float height = lift + t * cosine;
            float wide = max(voxel, min(2.0 * t * c.tangent, (height - 0.5 * voxel) * (1.0 / 1.5)));
            float ahead = min(wide, radius - t);
            float a = c.gain * opacity_at(start + d * (t + 0.5 * ahead), log2(wide), w, c);
            passes *= pow(1.0 - min(a, 0.9999), ahead / wide);
            t += ahead;
        }
        open += passes;
    }
    float of_plane = c.open[clamp(own_level, 0, vxao_levels - 1)];
    finish(s, none, here, none ? 1.0 : min(open * inverse / of_plane, 1.0));
}
