// Fills narrow holes of a sensor's depth for other pixels' sake: the surface on the farther side continues as a plane, no
// nearer than the nearer side. Structured light leaves shadows next to foreground objects and drops single pixels. Without
// this pass surfaces would seem to end there. Filled surfaces have a negative depth: they occlude, but are no pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "shared/surfel.h"
#include "lib/screen.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 16, scalar) writeonly buffer Filled { vec4 filled[]; }; // the same: where there is depth it is only read
layout(binding = 32, scalar) uniform Constants { SurfelConstants constants; };

// Pixels from p along its row to the next one with depth, fill_px + 1 where there is none so near.
int to_depth(ivec2 p, int direction, int most, out vec4 surface) {
    int i = 0;
    do {
        ++i;
        ivec2 q = ivec2(p.x + i * direction, p.y);
        surface = inside(q) ? imageLoad(surfaces, index_of(q)) : vec4(0.0);
    } while (i <= most && !(surface.w > 0.0));
    return i;
}

bool has_depth(ivec2 q) { return inside(q) && imageLoad(surfaces, index_of(q)).w > 0.0; }

// A pixel of a narrow hole has depth at half the greatest width, to its left or its right; three tries, since that position may
// be in the next hole. Most holes are wide (the sky, out of range), and searching them would cost more than the rest.
bool may_be_narrow(ivec2 p, int half_width) {
    bool found = min(p.x, k.size.x - 1 - p.x) < half_width; // the border of the image ends a hole, too
    for (int i = 1; i <= 3; ++i)
        found = found || has_depth(p - ivec2(half_width + 4 * i - 3, 0)) || has_depth(p + ivec2(half_width + 4 * i - 3, 0));
    return found;
}

void main() {
    SurfelConstants s = constants;
    k = s.screen;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy) + k.origin;
    if (s.fill_px == 0 || !inside(p) || imageLoad(surfaces, index_of(p)).w != 0.0 || !may_be_narrow(p, s.fill_px / 2)) return;
    vec4 before, after;
    int left = to_depth(p, -1, s.fill_px, before), right = to_depth(p, 1, s.fill_px, after);
    // One side may be the border of the image.
    bool ends_left = left <= s.fill_px, ends_right = right <= s.fill_px;
    bool starts_at_border = !ends_left && p.x < s.fill_px, ends_at_border = !ends_right && k.size.x - 1 - p.x < s.fill_px;
    left = starts_at_border ? p.x + 1 : left;
    right = ends_at_border ? k.size.x - p.x : right;
    bool from_left = ends_left && (!ends_right || before.w > after.w);
    vec4 source = from_left ? before : after;
    float nearest_z = ends_left && ends_right ? min(before.w, after.w) : source.w;
    bool fill = (ends_left || starts_at_border) && (ends_right || ends_at_border) && (ends_left || ends_right) &&
                float(left + right - 1) * nearest_z < s.fill * k.camera.fx;
    ivec2 at = ivec2(from_left ? p.x - left : p.x + right, p.y);
    float ratio = dot(source.xyz, ray_of(vec2(at))) / dot(source.xyz, ray_of(vec2(p)));
    float z = ratio > 0.0 ? clamp(source.w * ratio, nearest_z, 1.1 * source.w) : source.w;
    if (fill) filled[index_of(p)] = vec4(source.xyz, -z);
}
