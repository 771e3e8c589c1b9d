// The error to expect of each visibility (projection/sensor/expected_error.h).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"
#include "lib/cheap.glsl"

layout(local_size_x = finish_row) in;
layout(binding = 0, r32f) readonly uniform imageBuffer seen; // z; far behind the camera where nothing was seen
layout(binding = 1, r32f) readonly uniform imageBuffer visibility;
layout(binding = 16, scalar) writeonly buffer Out { float expected_error[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants constants; };

const float nothing_beyond = -1e29;

bool is_inside(ivec2 q) { return uint(q.x) < uint(constants.size.x) && uint(q.y) < uint(constants.size.y); }

float factor(int i) { return constants.errors.factors[i]; }

// Between the knots of a row of the table; `at` in knots.
float between_knots(int first, int knots, float at) {
    float within = clamp(at, 0.0, float(knots - 1));
    int below = min(int(within), knots - 2);
    return mix(factor(first + below), factor(first + below + 1), within - float(below));
}

float of_value_and_share(float value, float share) {
    float within = clamp(share * float(error_shares - 1), 0.0, float(error_shares - 1));
    int below = min(int(within), error_shares - 2);
    float at = (1.0 - sqrt(1.0 - value)) * float(error_values - 1);
    return mix(between_knots(below * error_values, error_values, at),
               between_knots((below + 1) * error_values, error_values, at), within - float(below));
}

// How much of the ball's image was seen.
float share_of_ball(ivec2 p, int here, vec2 ball, float limit) {
    int count = 0;
    for (int i = 0; i < ball_seeds; ++i) {
        ivec2 q = p + ivec2(nearest(constants.seeds[i].x * ball.x), nearest(constants.seeds[i].y * ball.y));
        bool inside = is_inside(q);
        float there = imageLoad(seen, inside ? q.y * constants.size.x + q.x : here).x;
        count += int(inside && there > limit);
    }
    return float(count) * (1.0 / float(ball_seeds));
}

// A pair of opposite pixels: whether depth jumps between them, and whether one is a hole.
bvec2 pair_at(ivec2 p, int here, float z, ivec2 apart, float jump) {
    ivec2 one = p + apart, other = p - apart;
    bool has_one = is_inside(one), has_other = is_inside(other);
    float a = imageLoad(seen, has_one ? one.y * constants.size.x + one.x : here).x;
    float b = imageLoad(seen, has_other ? other.y * constants.size.x + other.x : here).x;
    bool hole = a < nothing_beyond || b < nothing_beyond;
    bool flat_here = !(abs(z * (a + b) - 2.0 * a * b) * z > jump * a * b);
    return bvec2(!flat_here && !hole && has_one && has_other, hole);
}

void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, constants.size))) return;
    int here = p.y * constants.size.x + p.x;
    float recorded = imageLoad(seen, here).x;
    bool known = recorded > nothing_beyond;
    float z = known ? recorded : 1.0, inverse = 1.0 / z, radius = constants.radius;
    vec2 focal = vec2(constants.camera.fx, constants.camera.fy);
    vec2 ball = min(radius * focal * inverse, vec2(1e6)); // pixels
    float share = share_of_ball(p, here, ball, z - radius);

    float sigma = constants.noise_floor + constants.noise_per_z2 * z * z;
    float jump = jump_radii * radius + jump_sigmas * sigma;
    int edge = error_rings, hole = error_rings;
    for (int ring = error_rings - 1; ring >= 0; --ring) {
        int across = ring_across(ring), slope = ring_is_diagonal(ring) ? across : 0;
        bvec2 one = pair_at(p, here, z, ivec2(across, slope), jump), other = pair_at(p, here, z, ivec2(-slope, across), jump);
        edge = one.x || other.x ? ring : edge;
        hole = one.y || other.y ? ring : hole;
    }

    float value = clamp(imageLoad(visibility, here).x, 0.0, 1.0);
    float reach = radius * sqrt(focal.x * focal.y) * inverse;
    float sum = of_value_and_share(known ? value : 0.0, share) + factor(error_edges_at + edge) +
                factor(error_holes_at + hole) +
                between_knots(error_reaches_at, error_reaches, 0.5 * log2(max(reach, 1.0))) +
                between_knots(error_noises_at, error_noises, log2(1.0 + 64.0 * (radius > 0.0 ? sigma / radius : 1e6)));
    expected_error[here] = known ? min(exp2(0.5 * sum), 1.0) : uintBitsToFloat(0x7fc00000u);
}
