// Rays from every point of a cloud against the discs of its points: the share that hits nothing within the radius.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/cloud.h"

layout(local_size_x = cloud_group) in;
layout(binding = 0, std430) readonly buffer Points { vec4 points[]; };   // with the disc's radius
layout(binding = 1, std430) readonly buffer Normals { vec4 normals[]; }; // with roughness; zero where there is no surface
layout(binding = 2, std430) readonly buffer Boxes { vec4 boxes[]; };
layout(binding = 3, std430) readonly buffer Begins { uint begins[]; };
layout(binding = 4, std430) readonly buffer Directions { vec4 directions[]; };       // directions about z, run after run
layout(binding = 16, std430) writeonly buffer Values { float values[]; };
layout(binding = 32, scalar) uniform Constants { CloudConstants k; };
#include "cloud/tree.glsl"

const float missed = 3.4e38;

struct Ray {
    vec3 from, along, inverse;
    float reach;
};
struct Own { // the surface that rays start from
    vec3 point, normal;
    float reach, depth;
};

// Where a ray enters a box; the last bits may not lose a disc that lies in the box's side.
float entry(Ray ray, vec3 low, vec3 high) {
    vec3 a = (low - ray.from) * ray.inverse, b = (high - ray.from) * ray.inverse;
    vec3 first = min(a, b), last = max(a, b);
    float enters = max(max(first.x, first.y), max(first.z, 0.0));
    float leaves = min(min(last.x, last.y), min(last.z, ray.reach));
    return enters <= leaves * 1.00001 ? enters : missed;
}

bool meets(Ray ray, Own own, uint i) {
    vec4 disc = points[i];
    vec3 n = normals[i].xyz, apart = disc.xyz - ray.from;
    float t = dot(n, apart) / dot(n, ray.along);
    if (!(t > 0.0 && t < ray.reach)) return false;
    vec3 off = t * ray.along - apart;
    if (!(dot(off, off) <= disc.w * disc.w)) return false;
    return !(t < own.reach && abs(dot(n, own.normal)) > own_alike && abs(dot(n, own.point - disc.xyz)) <= own.depth);
}

bool blocked(Ray ray, Own own) {
    uint node = 1, trail = 0, leaves = 1u << k.levels;
    do {
        bool inside = true;
        while (inside && node < leaves) {
            vec4 a = boxes[3 * node], b = boxes[3 * node + 1], c = boxes[3 * node + 2];
            float left = entry(ray, a.xyz, vec3(a.w, b.xy)), right = entry(ray, vec3(b.zw, c.x), c.yzw);
            inside = min(left, right) < missed;
            if (inside) descend(node, trail, right < left, max(left, right) < missed);
        }
        if (inside)
            for (uint i = begins[node - leaves], end = begins[node - leaves + 1]; i < end; ++i)
                if (meets(ray, own, i)) return true;
    } while (next_sibling(node, trail));
    return false;
}

void main() {
    uint place = own_number();
    if (place >= k.points) return;
    vec4 point = points[place], normal = normals[place];
    vec3 n = normal.xyz;
    if (n == vec3(0.0)) {
        values[place] = uintBitsToFloat(0x7fc00000u); // unknown
        return;
    }
    // Duff et al. 2017, "Building an Orthonormal Basis, Revisited"
    float side = floatBitsToInt(n.z) < 0 ? -1.0 : 1.0, a = -1.0 / (side + n.z), b = n.x * n.y * a;
    vec3 x = vec3(1.0 + side * n.x * n.x * a, side * b, -side * n.x), y = vec3(b, side + n.y * n.y * a, -n.y);

    float disc = point.w, lift = lift_of(disc, normal.w, k.rounding);
    Own own = Own(point.xyz, n, own_reach(disc), own_depth(disc, normal.w));
    Ray ray;
    ray.from = point.xyz + lift * n;
    ray.reach = max(k.radius - lift, 0.0);
    uint first = place % k.runs * k.rays, open = 0;
    for (uint i = 0; i < k.rays; ++i) {
        vec3 d = directions[first + i].xyz;
        ray.along = d.x * x + d.y * y + d.z * n;
        if (k.only_up != 0 && dot(ray.along, k.up) <= 0.0) continue;
        bvec3 level = lessThan(abs(ray.along), vec3(1e-12));
        ray.inverse = 1.0 / mix(ray.along, vec3(1e-12), level);
        open += uint(!blocked(ray, own));
    }
    values[place] = float(open) / float(k.rays);
}
