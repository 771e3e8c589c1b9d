// First pass of depth preparation: depth becomes 1/z, and flying pixels, where a sensor mixed two surfaces, become holes.
// A flying pixel agrees with less than a quarter of its neighbours, or with less than half and has both nearer and farther
// ones. A wire agrees with two neighbours and has no nearer ones. Neighbours on a slope agree, however steep it is: floors seen
// at grazing angles, and rows that were doubled or interpolated when depth was aligned to colour.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/fit_plane.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, r32f) readonly uniform imageBuffer recorded;
layout(binding = 16, scalar) writeonly buffer Kept { float kept[]; }; // 1/z, `nowhere` where there is none
layout(binding = 32, scalar) uniform Constants { FitPlaneConstants constants; };

FitPlaneConstants k;

// Of two places on opposite sides of p.
vec2 depths_at(ivec2 p, ivec2 step) {
    ivec2 a = p - step, b = p + step, last = k.size - 1;
    bool a_inside = uint(a.x) <= uint(last.x) && uint(a.y) <= uint(last.y);
    bool b_inside = uint(b.x) <= uint(last.x) && uint(b.y) <= uint(last.y);
    float za = imageLoad(recorded, a_inside ? a.y * k.size.x + a.x : 0).x, zb = imageLoad(recorded, b_inside ? b.y * k.size.x + b.x : 0).x;
    return vec2(a_inside ? za : 0.0, b_inside ? zb : 0.0);
}

// Whether 1/z changes evenly over five pixels to either side. Between two surfaces it changes within fewer, even where a sensor
// smears the edge over seven pixels.
bool is_slope(ivec2 p, ivec2 step, float z_here) {
    vec2 outer_z = depths_at(p, 5 * step), inner_z = depths_at(p, 2 * step);
    // Of 1/z, but for the factor 1 / (z_here z): as comparisons are of ratios, products do without divisions.
    vec2 outer_change = vec2(-1.0, 1.0) * (z_here - outer_z), inner_change = vec2(-1.0, 1.0) * (z_here - inner_z);
    vec2 sides = abs(inner_change * inner_z.yx);
    vec2 outer = outer_change * inner_z, inner = inner_change * outer_z;
    return all(greaterThan(outer_z, vec2(0.0))) && all(greaterThan(inner_z, vec2(0.0))) &&
           inner_change.x * inner_change.y > 0.0 && max(sides.x, sides.y) < 2.5 * min(sides.x, sides.y) &&
           all(greaterThan(outer * inner, 1.6 * inner * inner)) && all(lessThan(outer * inner, 4.0 * inner * inner));
}

// What a pixel's neighbours say of it. They come in pairs on opposite sides, one bit each.
struct Around {
    int known, friends;            // neighbours with a depth; those of the pixel's own depth
    int nearer, farther;           // pairs with such a one
    int strangers, half_strangers; // pairs of known ones, not both of them friends; one a friend
};

void look(inout Around around, int bit, ivec2 p, ivec2 step, float z, float tolerance) {
    vec2 others = depths_at(p, step);
    bvec2 there = greaterThan(others, vec2(0.0)), alike = lessThanEqual(abs(others - z), vec2(tolerance));
    bvec2 nearer = lessThan(others, vec2(z)), farther = greaterThan(others, vec2(z));
    around.known += int(there.x) + int(there.y);
    around.friends += int(alike.x) + int(alike.y);
    around.nearer |= (there.x && !alike.x && nearer.x) || (there.y && !alike.y && nearer.y) ? bit : 0;
    around.farther |= (!alike.x && farther.x) || (!alike.y && farther.y) ? bit : 0;
    bool both_there = there.x && there.y;
    around.strangers |= both_there && !(alike.x && alike.y) ? bit : 0;
    around.half_strangers |= both_there && (alike.x != alike.y) ? bit : 0;
}

bool flies(Around around) {
    return 4 * around.friends < (around.nearer != 0 && around.farther != 0 ? 2 * around.known : around.known);
}

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    float z = imageLoad(recorded, here).x;
    // A slope up to 76 degrees is one surface.
    float tolerance = 3.0 * (k.noise_floor + k.noise_per_z2 * z * z) + 4.0 * z / k.camera.fx;
    Around around = Around(0, 0, 0, 0, 0, 0);
    look(around, 1, p, ivec2(-1, -1), z, tolerance);
    look(around, 2, p, ivec2(0, -1), z, tolerance);
    look(around, 4, p, ivec2(1, -1), z, tolerance);
    look(around, 8, p, ivec2(-1, 0), z, tolerance);

    // Slopes turn strangers into friends, so the few pixels that seem to fly ask for them, pair by pair. The loop tests at its
    // end: lavapipe would run any other once more with all lanes off.
    int left = z > 0.0 && flies(around) ? around.strangers : 0;
    do {
        int bit = left & -left;
        ivec2 step = ivec2(bit == 4 ? 1 : bit == 2 ? 0 : -1, bit == 8 ? 0 : -1);
        if (is_slope(p, step, z) && bit != 0) {
            around.friends += (around.half_strangers & bit) != 0 ? 1 : 2;
            around.nearer &= ~bit;
            around.farther &= ~bit;
        }
        left &= left - 1;
    } while (left != 0);
    bool keep = z > 0.0 && !(k.drop_flying != 0 && flies(around));
    kept[here] = keep ? 1.0 / z : nowhere;
}
