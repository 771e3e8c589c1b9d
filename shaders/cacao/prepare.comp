// CACAO, first pass: one slice texel per thread. De-interleaves depth into four slices and writes four normals,
// derived from the full-precision depth or taken from the supplied image.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/cacao.glsl"
#include "lib/cacao_normal.glsl"

layout(local_size_x = cacao_tile_x, local_size_y = cacao_tile_y) in;
layout(constant_id = spec_normals) const int supplied = 0;
layout(constant_id = spec_device_depth) const int device_depth = 0;

layout(binding = 0) uniform samplerBuffer depth_in;
layout(binding = 1) uniform samplerBuffer normals_in;
layout(binding = 16, scalar) writeonly buffer Depths { float depths[]; };
layout(binding = 17, scalar) writeonly buffer Normals { uint normals[]; };

float depth_at(ivec2 p) {
    float d = texelFetch(depth_in, p.y * k.image.x + p.x).x;
    return device_depth != 0 ? linear_depth(d) : d;
}
bool inside(ivec2 p) { return all(greaterThanEqual(p, ivec2(0))) && all(lessThan(p, k.image)); }
float depth_replicated(ivec2 p) { return depth_at(clamp(p, ivec2(0), k.image - 1)); }
float depth_or_outside(ivec2 p) { return inside(p) ? depth_at(p) : k.outside_depth; }

// Depth next to a pixel, for its normal. Scan knows nothing outside the image: a hole.
float neighbour(ivec2 p) {
    if (scan != 0) return inside(p) ? depth_at(p) : 0.0;
    return spacing == 1 ? depth_replicated(p) : depth_or_outside(p);
}

vec3 supplied_normal(ivec2 p) {
    int at = 3 * (p.y * k.image.x + p.x);
    vec3 given = vec3(texelFetch(normals_in, at).x, texelFetch(normals_in, at + 1).x, texelFetch(normals_in, at + 2).x);
    vec3 n = (inside(p) ? given : vec3(0.0)) * k.normals_mul + k.normals_add;
    return n * vec3(1.0, -1.0, 1.0); // camera space has y down, this room y up
}

void main() {
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    ivec2 p0 = 2 * spacing * t;

    float z[4];
    for (int a = 0; a < 4; ++a) {
        ivec2 p = p0 + spacing * ivec2(a & 1, a >> 1);
        if (scan != 0)
            z[a] = inside(p) ? depth_at(p) : 0.0;
        else
            z[a] = two_slices != 0 ? depth_or_outside(p) : depth_replicated(p);
        if (two_slices == 0 || a == 0 || a == 3)
            depths[slice_index(a, t)] = scan != 0 ? z[a] : half_toward_zero(z[a]);
    }

    if (supplied != 0) {
        for (int a = 0; a < 4; ++a)
            normals[slice_index(a, t)] = pack_normal(supplied_normal(p0 + spacing * ivec2(a & 1, a >> 1)));
        return;
    }

    // Rows and columns -1 .. 2 around the four pixels; the corners are not needed.
    float s[4][4];
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i)
            s[j][i] = (i == 0 || i == 3) && (j == 0 || j == 3) ? 0.0 : neighbour(p0 + spacing * ivec2(i - 1, j - 1));
    vec3 v[4][4];
    vec2 uv0 = (vec2(p0) + 0.5) * k.image_inv;
    for (int j = 0; j < 4; ++j)
        for (int i = 0; i < 4; ++i) {
            vec2 ray;
            if (scan != 0)
                ray = k.ray_base + vec2(p0 + spacing * ivec2(i - 1, j - 1)) * k.ray_step;
            else
                ray = k.view_mul * (uv0 + vec2(i - 1, j - 1) * float(spacing) * k.image_inv) + k.view_add;
            v[j][i] = vec3(ray, 1.0) * s[j][i];
        }
    for (int a = 0; a < 4; ++a) {
        int i = 1 + (a & 1), j = 1 + (a >> 1);
        vec4 edges = edges_from_depth(s[j][i], vec4(s[j][i - 1], s[j][i + 1], s[j - 1][i], s[j + 1][i]));
        vec3 n = normal_from_neighbours(edges, v[j][i], v[j][i - 1], v[j][i + 1], v[j - 1][i], v[j + 1][i]);
        normals[slice_index(a, t)] = pack_normal(n);
    }
}
