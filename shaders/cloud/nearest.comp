// The nearest neighbours of every point of a cloud, and the plane of least squares through them: near ones weigh most,
// so that edges stay edges.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/cloud.h"

layout(local_size_x = cloud_group) in;
layout(binding = 0, std430) readonly buffer Points { vec4 points[]; };
layout(binding = 1, std430) readonly buffer Boxes { vec4 boxes[]; };
layout(binding = 2, std430) readonly buffer Begins { uint begins[]; };
layout(binding = 16, std430) writeonly buffer Near { uint near[]; };
layout(binding = 17, scalar) writeonly buffer Rounds { CloudRound rounds[]; };
layout(binding = 32, scalar) uniform Constants { CloudConstants k; };
#include "cloud/tree.glsl"

const float none = 3e38;
float distances[cloud_neighbours]; // squared, ascending
uint places[cloud_neighbours];     // the lower first where distances are equal

bool before(float distance, uint place, float other_distance, uint other_place) {
    return distance < other_distance || (distance == other_distance && place < other_place);
}

void offer(float distance, uint place) {
    if (!before(distance, place, distances[cloud_neighbours - 1], places[cloud_neighbours - 1])) return;
    [[unroll]] for (int i = cloud_neighbours - 1; i > 0; --i) {
        bool farther = before(distance, place, distances[i - 1], places[i - 1]);
        bool here = before(distance, place, distances[i], places[i]);
        distances[i] = farther ? distances[i - 1] : here ? distance : distances[i];
        places[i] = farther ? places[i - 1] : here ? place : places[i];
    }
    if (before(distance, place, distances[0], places[0])) {
        distances[0] = distance;
        places[0] = place;
    }
}

float distance_to(vec3 at, vec3 low, vec3 high) {
    vec3 outside = max(max(low - at, at - high), 0.0);
    return dot(outside, outside);
}

// Whether a node at this distance may hold one of the nearest. Ties go to the lower index, so that a search among many equal
// points can stop early.
bool may_hold(float distance, uint node) {
    float reach = distances[cloud_neighbours - 1];
    if (distance != reach) return distance < reach;
    uint first_leaf = (node << (int(k.levels) - findMSB(node))) - (1u << k.levels);
    return begins[first_leaf] < places[cloud_neighbours - 1];
}

void find_round(uint own, vec3 at) {
    [[unroll]] for (int i = 0; i < cloud_neighbours; ++i) {
        distances[i] = none;
        places[i] = 0xffffffffu;
    }
    uint node = 1, trail = 0, leaves = 1u << k.levels;
    do {
        bool inside = true;
        while (inside && node < leaves) {
            vec4 a = boxes[3 * node], b = boxes[3 * node + 1], c = boxes[3 * node + 2];
            float left = distance_to(at, a.xyz, vec3(a.w, b.xy)), right = distance_to(at, vec3(b.zw, c.x), c.yzw);
            bool to_left = may_hold(left, 2 * node), to_right = may_hold(right, 2 * node + 1);
            inside = to_left || to_right;
            if (inside) descend(node, trail, to_right && !(to_left && left <= right), to_left && to_right);
        }
        if (inside)
            for (uint i = begins[node - leaves], end = begins[node - leaves + 1]; i < end; ++i) {
                vec3 apart = points[i].xyz - at;
                if (i != own) offer(dot(apart, apart), i);
            }
    } while (next_sibling(node, trail));
}

// One rotation of Jacobi's method: makes a symmetric matrix' element pq zero; r is the third axis.
void rotate(inout float pp, inout float qq, inout float pq, inout float pr, inout float qr, inout vec3 p, inout vec3 q) {
    if (abs(pq) < 1e-12 * (abs(pp) + abs(qq)) || pq == 0.0) return;
    float theta = (qq - pp) / (2.0 * pq);
    float t = (theta < 0.0 ? -1.0 : 1.0) / (abs(theta) + sqrt(1.0 + theta * theta));
    float c = inversesqrt(1.0 + t * t), s = t * c;
    pp -= t * pq;
    qq += t * pq;
    pq = 0.0;
    float to_p = c * pr - s * qr, to_q = s * pr + c * qr;
    pr = to_p;
    qr = to_q;
    vec3 axis = c * p - s * q;
    q = s * p + c * q;
    p = axis;
}

void order(inout float a, inout float b, inout vec3 of_a, inout vec3 of_b) {
    bool turn = b < a;
    float least = min(a, b);
    b = max(a, b);
    a = least;
    vec3 axis = turn ? of_b : of_a;
    of_b = turn ? of_a : of_b;
    of_a = axis;
}

void main() {
    uint own = own_number();
    if (own >= k.points) return;
    vec3 at = points[own].xyz;
    find_round(own, at);

    uint found = 0;
    float widest = 0.0, sixth = 0.0;
    [[unroll]] for (int i = 0; i < cloud_neighbours; ++i)
        if (distances[i] < none) {
            found = i + 1;
            widest = distances[i];
            sixth = i < 6 ? sqrt(distances[i]) : sixth;
        }
    [[unroll]] for (int i = 0; i < cloud_kept; ++i) near[own * cloud_kept + i] = i < found ? places[i] : own;

    CloudRound result = CloudRound(vec3(0.0), sixth, vec3(0.0), found);
    if (found >= 2 && widest > 0.0) {
        float scale = 1.0 / sqrt(widest); // numbers about 1, whatever the unit
        float sum = 1.0, xx = 0.0, yy = 0.0, zz = 0.0, xy = 0.0, xz = 0.0, yz = 0.0;
        vec3 mean = vec3(0.0);
        [[unroll]] for (int i = 0; i < cloud_neighbours; ++i)
            if (i < found) {
                vec3 offset = (points[places[i]].xyz - at) * scale;
                float weight = exp(-2.0 * distances[i] / widest); // the farthest weighs e^-2
                sum += weight;
                mean += weight * offset;
                vec3 weighted = weight * offset;
                xx += weighted.x * offset.x; yy += weighted.y * offset.y; zz += weighted.z * offset.z;
                xy += weighted.x * offset.y; xz += weighted.x * offset.z; yz += weighted.y * offset.z;
            }
        mean /= sum;
        xx = xx / sum - mean.x * mean.x; yy = yy / sum - mean.y * mean.y; zz = zz / sum - mean.z * mean.z;
        xy = xy / sum - mean.x * mean.y; xz = xz / sum - mean.x * mean.z; yz = yz / sum - mean.y * mean.z;
        vec3 a = vec3(1.0, 0.0, 0.0), b = vec3(0.0, 1.0, 0.0), c = vec3(0.0, 0.0, 1.0);
        for (int sweep = 0; sweep < 5; ++sweep) {
            rotate(xx, yy, xy, xz, yz, a, b);
            rotate(xx, zz, xz, xy, yz, a, c);
            rotate(yy, zz, yz, xy, xz, b, c);
        }
        order(xx, yy, a, b);
        order(yy, zz, b, c);
        order(xx, yy, a, b);
        result.normal = normalize(a);
        result.variance = max(vec3(xx, yy, zz), 0.0) / (scale * scale);
    }
    rounds[own] = result;
}
