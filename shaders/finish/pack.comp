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
layout(binding = 0, r32f) readonly uniform imageBuffer visibility;
layout(binding = 1, r32f) readonly uniform imageBuffer expected_error;
layout(binding = 2, r32f) readonly uniform imageBuffer surface; // 0 in holes
layout(binding = 3, r32f) readonly uniform imageBuffer cosine;
layout(binding = 4, r32ui) readonly uniform uimageBuffer colour;       // bytes: blue, green, red of each pixel
layout(binding = 5, r32ui) readonly uniform uimageBuffer colour_known; // bytes: 0 = not
layout(binding = 6, r32f) readonly uniform imageBuffer linear_light;   // of the 256 stored values, in steps
layout(binding = 7, r32ui) readonly uniform uimageBuffer stored_light; // of every step
layout(binding = 16, scalar) writeonly buffer MapOut { uint map_out[]; };
layout(binding = 17, scalar) writeonly buffer ConfidenceOut { uint confidence_out[]; };
layout(binding = 18, scalar) writeonly buffer PictureOut { uint picture_out[]; };
layout(binding = 32, scalar) uniform Constants { FinishConstants k; };

const uvec3 no_surface = uvec3(no_surface_blue, no_surface_green, no_surface_red);

// 0 = no surface, 1 .. most = 0 .. 1.
uint as_integer(float value, float most) {
    return isnan(value) ? 0u : uint(clamp(value, 0.0, 1.0) * (most - 1.0) + 1.5);
}

float confidence_at(int at) { return 1.0 - imageLoad(expected_error, at).x / hopeless_error; }

uint byte_of(uint word, int i) { return word >> (8 * i) & 0xffu; }

// Of light that is stored as in sRGB, so much.
uint dimmed(uint stored, float light) {
    return imageLoad(stored_light, int(imageLoad(linear_light, int(stored)).x * light + 0.5)).x;
}

uvec3 pixel_of(int at, uvec3 own_colour, uint known, float visible) {
    float light = isnan(visible) ? 1.0 : clamp(1.0 - k.strength + k.strength * visible, 0.0, 1.0);
    uvec3 base = own_colour;
    if (picture != picture_colour) {
        bool surface = imageLoad(surface, at).x > 0.0;
        uint grey = uint(roundEven(clay_edge_on + clay_facing * imageLoad(cosine, at).x));
        base = picture == picture_both && known != 0u ? own_colour : surface ? uvec3(grey) : no_surface;
    }
    return uvec3(dimmed(base.x, light), dimmed(base.y, light), dimmed(base.z, light));
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
    if (picture == picture_none) return;
    uvec3 c = uvec3(0u);
    uint known = 0u;
    if (picture != picture_clay)
        c = uvec3(imageLoad(colour, 3 * word).x, imageLoad(colour, 3 * word + 1).x, imageLoad(colour, 3 * word + 2).x);
    if (picture == picture_both) known = imageLoad(colour_known, word).x;
    uvec3 a = pixel_of(at.x, uvec3(byte_of(c.x, 0), byte_of(c.x, 1), byte_of(c.x, 2)), byte_of(known, 0), visible.x);
    uvec3 b = pixel_of(at.y, uvec3(byte_of(c.x, 3), byte_of(c.y, 0), byte_of(c.y, 1)), byte_of(known, 1), visible.y);
    uvec3 d = pixel_of(at.z, uvec3(byte_of(c.y, 2), byte_of(c.y, 3), byte_of(c.z, 0)), byte_of(known, 2), visible.z);
    uvec3 e = pixel_of(at.w, uvec3(byte_of(c.z, 1), byte_of(c.z, 2), byte_of(c.z, 3)), byte_of(known, 3), visible.w);
    picture_out[3 * word] = a.x | a.y << 8 | a.z << 16 | b.x << 24;
    picture_out[3 * word + 1] = b.y | b.z << 8 | d.x << 16 | d.y << 24;
    picture_out[3 * word + 2] = d.z | e.x << 8 | e.y << 16 | e.z << 24;
}
