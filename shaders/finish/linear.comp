// Colour divided by visibility, its two parts, and one bounce, as linear light in floats: 1 = white. pack.comp makes the same
// in 8 bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(constant_id = spec_light) const int has_light = 0;
layout(constant_id = spec_ambient) const int ambient_alone = 0;
layout(constant_id = spec_unshaded) const int unshaded = 0;
layout(constant_id = spec_split) const int split = 0;
layout(constant_id = spec_indirect) const int indirect = 0;
layout(constant_id = spec_unbounded) const int unbounded = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer visibility;
layout(binding = 1, r32f) readonly uniform imageBuffer expected_error;
layout(binding = 2, r32f) readonly uniform imageBuffer linear_colour; // blue, green, red of each pixel
layout(binding = 3, r32f) readonly uniform imageBuffer direct;        // light over ambient light
layout(binding = 4, r32f) readonly uniform imageBuffer bounced;       // red, green, blue of each pixel
layout(binding = 16, scalar) writeonly buffer UnshadedOut { float unshaded_out[]; };
layout(binding = 17, scalar) writeonly buffer AmbientOut { float ambient_out[]; };
layout(binding = 18, scalar) writeonly buffer DirectOut { float direct_out[]; };
layout(binding = 19, scalar) writeonly buffer IndirectOut { float indirect_out[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants k; };

#include "finish/parts.glsl"

vec3 colour_at(int at) {
    return vec3(imageLoad(linear_colour, 3 * at).x, imageLoad(linear_colour, 3 * at + 1).x, imageLoad(linear_colour, 3 * at + 2).x);
}

void main() {
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, k.size))) return;
    int at = p.y * k.size.x + p.x;
    if (unshaded != 0) {
        vec3 light = unshaded_light(at, colour_at(at), imageLoad(visibility, at).x, unbounded != 0 ? 1e30 : 1.0);
        unshaded_out[3 * at] = light.x;
        unshaded_out[3 * at + 1] = light.y;
        unshaded_out[3 * at + 2] = light.z;
    }
    if (split != 0) {
        vec3 light = colour_at(at), ambient = light * ambient_part(at), rest = light - ambient;
        ambient_out[3 * at] = ambient.x;
        ambient_out[3 * at + 1] = ambient.y;
        ambient_out[3 * at + 2] = ambient.z;
        direct_out[3 * at] = rest.x;
        direct_out[3 * at + 1] = rest.y;
        direct_out[3 * at + 2] = rest.z;
    }
    if (indirect != 0) { // as all pictures: blue first
        indirect_out[3 * at] = imageLoad(bounced, 3 * at + 2).x;
        indirect_out[3 * at + 1] = imageLoad(bounced, 3 * at + 1).x;
        indirect_out[3 * at + 2] = imageLoad(bounced, 3 * at).x;
    }
}
