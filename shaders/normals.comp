// Normals from depth, before any screen-space method. Each axis uses the side along which 1/z, linear on any plane,
// continues straight. Output with the depth: unit, facing the camera; (0, 0, 0) only in holes.
//
// Normals supplied with the view are kept, normalised and flipped to the camera; zero and non-finite ones are derived here.
// Where depth is noisy they come from a neighbouring plane instead, and the pixel moves onto it.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(constant_id = spec_supplied) const int supplied = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer depth_in;
layout(binding = 1, r32f) readonly uniform imageBuffer given; // normals of the view, if any, three floats a pixel
layout(binding = 16, scalar) writeonly buffer Surfaces { vec4 surfaces[]; };
layout(binding = 32, scalar) uniform Constants { ScreenConstants constants; };

#include "lib/depth.glsl"

const float straight_px = 2.0; // bend in 1/z, in pixels of parallax, up to which a side is the same surface
const float steep = 30.0;      // slope, metres of depth per metre across, beyond which a neighbour is another surface
const float never = 1e30;

// How far 1/z of the next two pixels on one side departs from a straight line, in pixels; huge where one is unknown.
float bend(float w, float z1, float z2, float z_f) {
    float b = abs(2.0 / z1 - 1.0 / z2 - w) * z_f;
    return z1 > 0.0 && z2 > 0.0 ? b : never;
}

float slope(float z, float z1, float f) { return z1 > 0.0 ? abs(z1 - z) * f / z : never; }

// Depth of the next pixel on a side, in a hole of one pixel that on the line of 1/z to what lies beyond it.
float next_z(float w, float z1, float z2) { return z1 > 0.0 || !(z2 > 0.0) ? z1 : 2.0 / (w + 1.0 / z2); }

// Tangent along one axis from the depths at -2, -1, +1, +2; zero where neither side will do.
vec3 tangent(float z, float w, vec4 along, vec3 here, vec3 ray_before, vec3 ray_after, float f) {
    vec2 next = vec2(next_z(w, along.y, along.x), next_z(w, along.z, along.w));
    vec3 back = here - ray_before * next.x, ahead = ray_after * next.y - here;
    vec2 bends = vec2(bend(w, along.y, along.x, z * f), bend(w, along.z, along.w, z * f));
    vec2 slopes = vec2(slope(z, next.x, f), slope(z, next.y, f));
    slopes += mix(vec2(0.0), slopes + 1.0, equal(along.yz, vec2(0.0))); // across a crease the line of 1/z is too gentle
    bool by_bend = min(bends.x, bends.y) < straight_px;
    vec2 cost = by_bend ? bends : slopes;
    bool any_side = by_bend || min(slopes.x, slopes.y) < steep;
    return any_side ? (cost.x < cost.y ? back : ahead) : vec3(0.0);
}

// Between holes an axis has no tangent. Then the nearest known pixel in any other direction spans the plane. Clean depth
// leaves at once; lavapipe can leave a loop early.
const int rings = 8;
const float gentle = 4.0; // slope up to which what lies across holes is taken for the same surface

void look_around(ivec2 p, float z, vec3 point, bool wanted, inout vec3 one, inout vec3 other) {
    for (int i = 0; wanted && i < 8 * rings; ++i) {
        int cell = (i & 7) + ((i & 7) >> 2); // of 3x3, without the middle one
        int ring = 1 + (i >> 3);
        int row = (11 * cell) >> 5; // of the cell: its third, without a division
        ivec2 q = p + ring * ivec2(cell - 3 * row - 1, row - 1);
        float zq = depth_at(q);
        vec3 apart = ray_of(vec2(q)) * zq - point;
        bool same = zq > 0.0 && abs(zq - z) < gentle * length(apart.xy);
        vec3 normal = cross(one, apart);
        bool spans = dot(normal, normal) > 0.2 * dot(one, one) * dot(apart, apart);
        bool first = dot(one, one) == 0.0;
        other = same && !first && spans ? apart : other;
        one = same && first ? apart : one;
        wanted = dot(other, other) == 0.0;
    }
}

// The direction to the camera less its part along the tangent; `point` itself need not be unit.
vec3 turned_to_camera(vec3 point, vec3 along) {
    return dot(along, along) > 0.0 ? along * (dot(point, along) / dot(along, along)) - point : -point;
}

// In a hole, z may be anything but 0.
vec3 derived_normal(ivec2 p, float z, bool hole) {
    vec4 row = vec4(depth_at(p - ivec2(2, 0)), depth_at(p - ivec2(1, 0)), depth_at(p + ivec2(1, 0)), depth_at(p + ivec2(2, 0)));
    vec4 column = vec4(depth_at(p - ivec2(0, 2)), depth_at(p - ivec2(0, 1)), depth_at(p + ivec2(0, 1)), depth_at(p + ivec2(0, 2)));
    vec3 ray = ray_of(vec2(p)), point = ray * z;
    vec3 dx = vec3(1.0 / k.camera.fx, 0.0, 0.0), dy = vec3(0.0, 1.0 / k.camera.fy, 0.0);
    vec3 across = tangent(z, 1.0 / z, row, point, ray - dx, ray + dx, k.camera.fx);
    vec3 down = tangent(z, 1.0 / z, column, point, ray - dy, ray + dy, k.camera.fy);
    bool no_across = dot(across, across) == 0.0, no_down = dot(down, down) == 0.0;
    bool between_holes = (no_across && row.y + row.z == 0.0) || (no_down && column.y + column.z == 0.0);
    vec3 one = no_across ? down : across, other = no_across ? vec3(0.0) : down;
    look_around(p, z, point, between_holes && !hole, one, other);
    vec3 n = dot(other, other) > 0.0 ? cross(other, one) : turned_to_camera(point, one);
    float length2 = dot(n, n);
    n = length2 > 0.0 ? n * inversesqrt(length2) : -normalize(point);
    return dot(n, point) > 0.0 ? -n : n;
}

vec3 given_at(int index) {
    return vec3(imageLoad(given, 3 * index).x, imageLoad(given, 3 * index + 1).x, imageLoad(given, 3 * index + 2).x);
}

bool is_usable(vec3 n) { return dot(n, n) > 1e-6 && dot(n, n) < 1e6; } // false for NaN

// Plane fits leave pixels without a normal at outlines, where a normal derived from noisy depth would be a random one. Such a
// pixel joins that plane of the 5x5 pixels around which comes nearest to it, within 3 sigma; else it faces the camera.
vec4 joined(ivec2 p, float z, bool wanted) {
    vec3 ray = ray_of(vec2(p));
    vec4 joined_ = vec4(-normalize(ray), z);
    float least = 3.0 * sigma_of(z);
    for (int i = 0; wanted && i < 25; ++i) {
        ivec2 q = p + ivec2(i % 5, i / 5) - 2;
        float zq = depth_at(q);
        vec3 n = given_at(zq > 0.0 ? index_of(q) : 0);
        float z_there = zq * dot(n, ray_of(vec2(q))) / dot(n, ray), apart = abs(z_there - z);
        bool nearer = zq > 0.0 && is_usable(n) && apart < least && abs(z_there - zq) < 0.1 * zq;
        n *= inversesqrt(dot(n, n)) * (dot(n, ray) > 0.0 ? -1.0 : 1.0);
        joined_ = nearer ? vec4(n, z_there) : joined_;
        least = nearer ? apart : least;
    }
    return joined_;
}

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.window))) return;
    p += k.origin;
    int here = index_of(p);
    float z = imageLoad(depth_in, here).x;
    bool hole = !(z > 0.0);
    bool noisy = k.noise_floor > 0.0 || k.noise_per_z2 > 0.0;
    vec3 own = supplied != 0 ? given_at(here) : vec3(0.0);
    bool usable = supplied != 0 && is_usable(own);
    vec4 surface;
    if (supplied != 0 && noisy) surface = joined(p, hole ? 1.0 : z, !usable && !hole);
    else surface = vec4(derived_normal(p, hole ? 1.0 : z, hole), z);
    own *= dot(own, ray_of(vec2(p))) > 0.0 ? -1.0 : 1.0;
    surface = usable ? vec4(own * inversesqrt(dot(own, own)), z) : surface;
    surfaces[here] = hole ? vec4(0.0) : surface;
}
