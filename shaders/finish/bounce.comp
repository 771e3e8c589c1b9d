// One bounce of light, its gathering: for each pixel the colours of what blocks directions over its surface, those of all that
// lies within the radius, and their weights.
//
// Ritschel, Grosch, Seidel, "Approximating Dynamic Global Illumination in Image Space" (2009), section 3.2, normalised: a
// direction has one sample at a random distance within the radius, and is blocked where the depth image lies in front of
// it. Only what faces the pixel sends light. bounce_mean.comp makes the mean of neighbours' sums.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(constant_id = spec_known) const int has_unknown = 0;
layout(constant_id = spec_linear) const int is_linear = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer surface;
layout(binding = 1, r32f) readonly uniform imageBuffer normals;
layout(binding = 2, r32ui) readonly uniform uimageBuffer colour;       // bytes: blue, green, red of each pixel
layout(binding = 3, r32ui) readonly uniform uimageBuffer colour_known; // bytes: 0 = not
layout(binding = 4, r32f) readonly uniform imageBuffer linear_light;   // of the 256 stored values, in steps
layout(binding = 5, r32f) readonly uniform imageBuffer linear_colour;  // blue, green, red of each pixel, where is_linear
layout(binding = 16, scalar) writeonly buffer Sums { vec4 sums[]; };   // red, green, blue, in steps or 0 .. 1; weight
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

FinishConstants k;
#include "finish/clay.glsl"
#include "finish/normal.glsl"

uint byte_at(int index) { return imageLoad(colour, index >> 2).x >> (8 * (index & 3)) & 0xffu; }
float light_of(int index) { return imageLoad(linear_light, int(byte_at(index))).x; }
vec3 colour_at(int at) {
    if (is_linear != 0)
        return vec3(imageLoad(linear_colour, 3 * at + 2).x, imageLoad(linear_colour, 3 * at + 1).x,
                    imageLoad(linear_colour, 3 * at).x);
    return vec3(light_of(3 * at + 2), light_of(3 * at + 1), light_of(3 * at));
}
bool is_known(int at) { return has_unknown == 0 || (imageLoad(colour_known, at >> 2).x >> (8 * (at & 3)) & 0xffu) != 0u; }

// Noise that differs between neighbours (Jimenez 2014).
float between_0_and_1(vec2 p) { return fract(52.9829189 * fract(dot(p, vec2(0.06711056, 0.00583715)))); }

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int here = p.y * k.size.x + p.x;
    vec4 sum = vec4(0.0), around = vec4(0.0);
    vec3 normal = normal_of(p, here);
    if (dot(normal, normal) > 0.0) {
        vec3 point = unproject(k.camera, vec2(p), 1.0 / inverse_at(here));
        vec3 axis = abs(normal.x) < 0.6 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
        vec3 e1 = normalize(axis - normal * dot(axis, normal)), e2 = cross(normal, e1);
        float turn = between_0_and_1(vec2(p)), rise = between_0_and_1(vec2(p) + 47.0);
        for (int i = 0; i < bounce_directions; ++i) {
            float cosine = 1.0 - (float(i) + rise) / float(bounce_directions), sine = sqrt(max(1.0 - cosine * cosine, 0.0));
            float angle = 6.2831853 * (float(i) * 0.6180339887 + turn);
            float share = fract(float(i) * 0.7548776662 + 3.0 * turn + rise + 0.5);
            vec3 tip = point + k.radius * share * (sine * (cos(angle) * e1 + sin(angle) * e2) + cosine * normal);
            ivec2 q = ivec2(floor(project(k.camera, vec3(tip.xy, max(tip.z, 1e-3))) + 0.5));
            int there = q.y * k.size.x + q.x;
            if (tip.z <= 0.01 || uint(q.x) >= uint(k.size.x) || uint(q.y) >= uint(k.size.y) || inverse_at(there) <= 0.0)
                continue; // unknown: nothing comes from there
            float z = 1.0 / inverse_at(there), slack = 2.0 * (k.noise_floor + k.noise_per_z2 * z * z) + 1e-3 * z;
            vec3 apart = unproject(k.camera, vec2(q), z) - point;
            float away = length(apart);
            if (away > k.radius || !is_known(there)) continue;
            vec4 colour_there = vec4(colour_at(there), 1.0);
            around += colour_there;
            if (z < tip.z - slack && dot(apart, normal) > 0.02 * away + slack && dot(normal_of(q, there), apart) < 0.0)
                sum += cosine * colour_there;
        }
    }
    sums[2 * here] = sum;
    sums[2 * here + 1] = around;
}
