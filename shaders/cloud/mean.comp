// The mean of a value and its neighbours' on the same surface: parallel planes, distances small against the radius.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/cloud.h"

layout(local_size_x = cloud_group) in;
layout(binding = 0, std430) readonly buffer Points { vec4 points[]; };
layout(binding = 1, std430) readonly buffer Normals { vec4 normals[]; };
layout(binding = 2, std430) readonly buffer Near { uint near[]; };
layout(binding = 3, std430) readonly buffer Values { float values[]; };
layout(binding = 16, std430) writeonly buffer Means { float means[]; };
layout(binding = 32, scalar) uniform Constants { CloudConstants k; };
#include "cloud/tree.glsl"

void main() {
    uint own = own_number();
    if (own >= k.points) return;
    vec3 point = points[own].xyz, normal = normals[own].xyz;
    float value = values[own], sum = value, weights = 1.0;
    for (int i = 0; i < cloud_kept; ++i) {
        uint other = near[own * cloud_kept + i];
        float beside = values[other];
        vec3 apart = points[other].xyz - point, n = normals[other].xyz;
        bool same = other != own && !isnan(beside) && dot(normal, n) > 0.9;
        float off = (value - beside) / mean_apart;
        float weight = exp(k.falloff * dot(apart, apart)) * max(1.0 - off * off, 0.0);
        sum += same ? weight * beside : 0.0;
        weights += same ? weight : 0.0;
    }
    means[own] = isnan(value) ? value : sum / weights;
}
