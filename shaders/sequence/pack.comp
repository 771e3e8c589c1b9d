// Depth and normals packed for other frames of the recording: two words a pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/screen.glsl"
#include "lib/cheap.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 16, scalar) writeonly buffer Words { uvec2 words[]; };
layout(binding = 32, scalar) uniform Constants { ScreenConstants constants; };

#include "lib/surfel.glsl"

const int reach = 1;

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (!inside(p)) return;
    vec4 surface = imageLoad(surfaces, index_of(p));
    // The outlines of a noisy sensor move from frame to frame.
    bool noisy = k.noise_floor > 0.0 || k.noise_per_z2 > 0.0;
    if (noisy) {
        float tolerance = 3.0 * sigma_of(surface.w) + 4.0 * surface.w * k.ray_step.x * float(reach);
        bool edge = false;
        for (int i = 0; i < 8; ++i) {
            int j = i < 4 ? i : i + 1;
            ivec2 q = p + reach * (ivec2(j % 3, j / 3) - 1);
            float z = inside(q) ? imageLoad(surfaces, index_of(q)).w : surface.w;
            edge = edge || abs(z - surface.w) > tolerance;
        }
        surface.w = edge ? 0.0 : surface.w;
    }
    words[index_of(p)] = surfel(surface.w, surface.xyz, 0.0);
}
