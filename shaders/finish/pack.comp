// Last pass of a frame: visibility, confidence and the shaded picture in the bytes that are encoded. Four pixels a thread,
// since these are whole words of each.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/finish.h"

layout(local_size_x = finish_row) in;
layout(constant_id = spec_map_bits) const int map_bits = 0;
layout(constant_id = spec_confidence_bits) const int confidence_bits = 0;
layout(constant_id = spec_picture) const int picture = picture_none;
layout(constant_id = spec_light) const int has_light = 0;
layout(constant_id = spec_ambient) const int ambient_alone = 0;
layout(constant_id = spec_unshaded) const int unshaded = 0;
layout(constant_id = spec_split) const int split = 0;
layout(constant_id = spec_indirect) const int indirect = 0;
layout(binding = 0, r32f) readonly uniform imageBuffer visibility;
layout(binding = 1, r32f) readonly uniform imageBuffer expected_error;
layout(binding = 2, r32f) readonly uniform imageBuffer surface; // 0 in holes
layout(binding = 3, r32f) readonly uniform imageBuffer cosine;
layout(binding = 4, r32ui) readonly uniform uimageBuffer colour;       // bytes: blue, green, red of each pixel
layout(binding = 5, r32ui) readonly uniform uimageBuffer colour_known; // bytes: 0 = not
layout(binding = 6, r32f) readonly uniform imageBuffer linear_light;   // of the 256 stored values, in steps
layout(binding = 7, r32ui) readonly uniform uimageBuffer stored_light; // of every step
layout(binding = 8, r32f) readonly uniform imageBuffer direct;         // light over ambient light
layout(binding = 9, r32f) readonly uniform imageBuffer bounced;        // red, green, blue of each pixel, in steps
layout(binding = 16, scalar) writeonly buffer MapOut { uint map_out[]; };
layout(binding = 17, scalar) writeonly buffer ConfidenceOut { uint confidence_out[]; };
layout(binding = 18, scalar) writeonly buffer PictureOut { uint picture_out[]; };
layout(binding = 19, scalar) writeonly buffer UnshadedOut { uint unshaded_out[]; };
layout(binding = 20, scalar) writeonly buffer AmbientOut { uint ambient_out[]; };
layout(binding = 21, scalar) writeonly buffer DirectOut { uint direct_out[]; };
layout(binding = 22, scalar) writeonly buffer IndirectOut { uint indirect_out[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants k; };

const uvec3 no_surface = uvec3(no_surface_blue, no_surface_green, no_surface_red);

// 0 = no surface, 1 .. most = 0 .. 1.
uint as_integer(float value, float most) {
    return isnan(value) ? 0u : uint(clamp(value, 0.0, 1.0) * (most - 1.0) + 1.5);
}

uint byte_of(uint word, int i) { return word >> (8 * i) & 0xffu; }

float steps_of(uint stored) { return imageLoad(linear_light, int(stored)).x; }
uint stored_from(float steps) { return imageLoad(stored_light, int(min(steps, 4095.0) + 0.5)).x; }
vec3 steps_of(uvec3 stored) { return vec3(steps_of(stored.x), steps_of(stored.y), steps_of(stored.z)); }
uvec3 stored_from(vec3 steps) { return uvec3(stored_from(steps.x), stored_from(steps.y), stored_from(steps.z)); }

#include "finish/parts.glsl"

uvec3 shaded_pixel(int at, uvec3 own_colour, uint known, float visible) {
    float light = strong(visible);
    if (picture == picture_colour || (picture == picture_both && known != 0u))
        return stored_from(steps_of(own_colour) * (ambient_alone == 0 ? light : 1.0 - ambient_part(at) * (1.0 - light)));
    bool surface = imageLoad(surface, at).x > 0.0;
    uint grey = uint(roundEven(clay_edge_on + clay_facing * imageLoad(cosine, at).x));
    return stored_from(steps_of(surface ? uvec3(grey) : no_surface) * light);
}

uvec3 unshaded_pixel(int at, uvec3 own_colour, float visible) {
    return stored_from(unshaded_light(at, steps_of(own_colour), visible, 4095.0));
}

uvec3 packed(uvec3 a, uvec3 b, uvec3 d, uvec3 e) {
    return uvec3(a.x | a.y << 8 | a.z << 16 | b.x << 24, b.y | b.z << 8 | d.x << 16 | d.y << 24,
                       d.z | e.x << 8 | e.y << 16 | e.z << 24);
}

// As all pictures: blue first.
uvec3 bounced_pixel(int at) {
    return stored_from(vec3(imageLoad(bounced, 3 * at + 2).x, imageLoad(bounced, 3 * at + 1).x, imageLoad(bounced, 3 * at).x));
}

void main() {
    int word = int(gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * finish_row);
    if (word >= k.words) return;
    int last = k.size.x * k.size.y - 1;
    ivec4 at = min(4 * word + ivec4(0, 1, 2, 3), ivec4(last));
    vec4 visible = vec4(imageLoad(visibility, at.x).x, imageLoad(visibility, at.y).x, imageLoad(visibility, at.z).x,
                        imageLoad(visibility, at.w).x);
    if (map_bits == 16) {
        uvec4 v = uvec4(as_integer(visible.x, 65535.0), as_integer(visible.y, 65535.0), as_integer(visible.z, 65535.0),
                        as_integer(visible.w, 65535.0));
        map_out[2 * word] = v.x | v.y << 16;
        map_out[2 * word + 1] = v.z | v.w << 16;
    }
    if (map_bits == 8) {
        uvec4 v = uvec4(as_integer(visible.x, 255.0), as_integer(visible.y, 255.0), as_integer(visible.z, 255.0),
                        as_integer(visible.w, 255.0));
        map_out[word] = v.x | v.y << 8 | v.z << 16 | v.w << 24;
    }
    if (confidence_bits == 8) {
        uvec4 v = uvec4(as_integer(confidence_at(at.x), 255.0), as_integer(confidence_at(at.y), 255.0),
                        as_integer(confidence_at(at.z), 255.0), as_integer(confidence_at(at.w), 255.0));
        confidence_out[word] = v.x | v.y << 8 | v.z << 16 | v.w << 24;
    }
    if (indirect != 0) {
        uvec3 words = packed(bounced_pixel(at.x), bounced_pixel(at.y), bounced_pixel(at.z), bounced_pixel(at.w));
        indirect_out[3 * word] = words.x;
        indirect_out[3 * word + 1] = words.y;
        indirect_out[3 * word + 2] = words.z;
    }
    bool has_colour = picture == picture_colour || picture == picture_both || unshaded != 0 || split != 0;
    if (picture == picture_none && !has_colour) return;
    uvec3 c = uvec3(0u);
    uint known = 0u;
    if (has_colour)
        c = uvec3(imageLoad(colour, 3 * word).x, imageLoad(colour, 3 * word + 1).x, imageLoad(colour, 3 * word + 2).x);
    if (picture == picture_both) known = imageLoad(colour_known, word).x;
    uvec3 first = uvec3(byte_of(c.x, 0), byte_of(c.x, 1), byte_of(c.x, 2));
    uvec3 second = uvec3(byte_of(c.x, 3), byte_of(c.y, 0), byte_of(c.y, 1));
    uvec3 third = uvec3(byte_of(c.y, 2), byte_of(c.y, 3), byte_of(c.z, 0));
    uvec3 fourth = uvec3(byte_of(c.z, 1), byte_of(c.z, 2), byte_of(c.z, 3));
    uvec3 words;
    if (picture != picture_none) {
        words = packed(shaded_pixel(at.x, first, byte_of(known, 0), visible.x),
                       shaded_pixel(at.y, second, byte_of(known, 1), visible.y),
                       shaded_pixel(at.z, third, byte_of(known, 2), visible.z),
                       shaded_pixel(at.w, fourth, byte_of(known, 3), visible.w));
        picture_out[3 * word] = words.x;
        picture_out[3 * word + 1] = words.y;
        picture_out[3 * word + 2] = words.z;
    }
    if (unshaded != 0) {
        words = packed(unshaded_pixel(at.x, first, visible.x), unshaded_pixel(at.y, second, visible.y),
                       unshaded_pixel(at.z, third, visible.z), unshaded_pixel(at.w, fourth, visible.w));
        unshaded_out[3 * word] = words.x;
        unshaded_out[3 * word + 1] = words.y;
        unshaded_out[3 * word + 2] = words.z;
    }
    if (split != 0) {
        mat4x3 light = mat4x3(steps_of(first), steps_of(second), steps_of(third), steps_of(fourth));
        mat4x3 ambient = mat4x3(light[0] * ambient_part(at.x), light[1] * ambient_part(at.y),
                                light[2] * ambient_part(at.z), light[3] * ambient_part(at.w));
        mat4x3 rest = light - ambient;
        words = packed(stored_from(ambient[0]), stored_from(ambient[1]), stored_from(ambient[2]), stored_from(ambient[3]));
        ambient_out[3 * word] = words.x;
        ambient_out[3 * word + 1] = words.y;
        ambient_out[3 * word + 2] = words.z;
        words = packed(stored_from(rest[0]), stored_from(rest[1]), stored_from(rest[2]), stored_from(rest[3]));
        direct_out[3 * word] = words.x;
        direct_out[3 * word + 1] = words.y;
        direct_out[3 * word + 2] = words.z;
    }
}
