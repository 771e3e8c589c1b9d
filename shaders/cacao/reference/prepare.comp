// CACAO `reference`, prepare (D, section 8.2, and N, section 8.3): four depths, to binary16, and four normals per slice texel. Normals are
// those of the full-precision depth, or taken from the supplied image.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "cacao/reference/reference.glsl"

layout(local_size_x = cacao_row) in;
layout(constant_id = spec_normals) const int supplied = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, r32f) readonly uniform imageBuffer normals_in;
layout(binding = 16, r32f) uniform writeonly imageBuffer depths;
layout(binding = 17, r32ui) uniform writeonly uimageBuffer normals;

bool inside(ivec2 p) { return all(lessThan(uvec2(p), uvec2(k.image))); }
float depth_at(ivec2 p) { return depth_from(imageLoad(depth_in, p.y * k.image.x + p.x).x); }
float depth_replicated(ivec2 p) { return depth_at(clamp(p, ivec2(0), k.image - 1)); }

// --- N. Depth next to a pixel: replicated at native resolution, a load outside the image when downsampled.
float neighbour(ivec2 p) {
    float z = depth_replicated(p);
    return spacing == 1 || inside(p) ? z : k.outside_depth;
}

vec3 supplied_normal(ivec2 p) {
    ivec2 q = clamp(p, ivec2(0), k.image - 1);
    int at = 3 * (q.y * k.image.x + q.x);
    vec3 given = vec3(imageLoad(normals_in, at).x, imageLoad(normals_in, at + 1).x, imageLoad(normals_in, at + 2).x);
    vec3 n = (inside(p) ? given : vec3(0.0)) * k.normals_mul + k.normals_add;
    return n * vec3(1.0, -1.0, 1.0); // camera space has y down, this room y up
}

vec2 ray_of(ivec2 p0, int step) {
    return k.view_mul * ((vec2(p0) + 0.5) * k.image_inv + vec2(step) * float(spacing) * k.image_inv) + k.view_add;
}

vec3 normal_from_neighbours(vec4 e, vec3 c, vec3 left, vec3 right, vec3 top, vec3 bottom) {
    vec3 l = normalize(left - c), r = normalize(right - c), t = normalize(top - c), b = normalize(bottom - c);
    // The four quadrants' cross products, each weighted by its two edges, factor into one.
    return cross(e.x * l - e.y * r, e.z * t - e.w * b) + vec3(0.0, 0.0, -0.0005);
}

vec3 unit(vec3 n) { return n * inversesqrt(max(dot(n, n), 1e-20)); }

vec3 normal_of(ivec2 p, vec3 c, vec3 left, vec3 right, vec3 top, vec3 bottom) {
    if (supplied != 0) return supplied_normal(p);
    vec4 edges = edges_from_depth(c.z, vec4(left.z, right.z, top.z, bottom.z));
    return unit(normal_from_neighbours(edges, c, left, right, top, bottom));
}

uint pack_normal(vec3 n) { // SNORM8
    uvec3 q = uvec3(ivec3(roundEven(clamp(n, -1.0, 1.0) * 127.0))) & 255u;
    return q.x | q.y << 8 | q.z << 16;
}

// --- D. LOWEST writes two slices and loads zero outside the image, the others replicate. All write four normals.
void put(int slice, ivec2 t, ivec2 p, float z, vec3 n) {
    if (!inside(p)) z = two_slices != 0 ? k.outside_depth : depth_replicated(p);
    if (two_slices == 0 || slice == 0 || slice == 3) imageStore(depths, depth_index(slice, 0, t), vec4(whole(half_toward_zero(z))));
    imageStore(normals, slice_index(slice, t), uvec4(whole(pack_normal(n))));
}

// Pixels, s apart:       a1 a2
//                     b0 b1 b2 b3
//                     c0 c1 c2 c3
//                        d1 d2
void main() {
    k = constants;
    ivec2 t = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(t, k.slice))) return;
    const ivec2 x = ivec2(spacing, 0), y = ivec2(0, spacing);
    ivec2 p = 2 * spacing * t;
    float a1 = neighbour(p - y), a2 = neighbour(p + x - y);
    float b0 = neighbour(p - x), b1 = neighbour(p), b2 = neighbour(p + x), b3 = neighbour(p + 2 * x);
    float c0 = neighbour(p - x + y), c1 = neighbour(p + y), c2 = neighbour(p + x + y), c3 = neighbour(p + 2 * x + y);
    float d1 = neighbour(p + 2 * y), d2 = neighbour(p + x + 2 * y);

    vec2 r0 = ray_of(p, -1), r1 = ray_of(p, 0), r2 = ray_of(p, 1), r3 = ray_of(p, 2);
    vec3 A1 = vec3(r1.x, r0.y, 1.0) * a1, A2 = vec3(r2.x, r0.y, 1.0) * a2;
    vec3 B0 = vec3(r0.x, r1.y, 1.0) * b0, B1 = vec3(r1, 1.0) * b1, B2 = vec3(r2.x, r1.y, 1.0) * b2, B3 = vec3(r3.x, r1.y, 1.0) * b3;
    vec3 C0 = vec3(r0.x, r2.y, 1.0) * c0, C1 = vec3(r1.x, r2.y, 1.0) * c1, C2 = vec3(r2, 1.0) * c2, C3 = vec3(r3.x, r2.y, 1.0) * c3;
    vec3 D1 = vec3(r1.x, r3.y, 1.0) * d1, D2 = vec3(r2.x, r3.y, 1.0) * d2;
    put(0, t, p, b1, normal_of(p, B1, B0, B2, A1, C1));
    put(1, t, p + x, b2, normal_of(p + x, B2, B1, B3, A2, C2));
    put(2, t, p + y, c1, normal_of(p + y, C1, C0, C2, B1, D1));
    put(3, t, p + x + y, c2, normal_of(p + x + y, C2, C1, C3, B2, D2));
}
