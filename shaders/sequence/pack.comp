// Depth and normals as other frames of the recording look at them: two words a pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#include "lib/screen.glsl"
#include "lib/cheap.glsl"

layout(local_size_x = screen_tile, local_size_y = screen_tile) in;
layout(binding = 0, rgba32f) readonly uniform imageBuffer surfaces;
layout(binding = 16, rg32ui) uniform writeonly uimageBuffer words;
layout(binding = 32, scalar) uniform Constants { ScreenConstants constants; };

#include "lib/surfel.glsl"

void main() {
    k = constants;
    ivec2 p = ivec2(gl_GlobalInvocationID.xy);
    if (!inside(p)) return;
    vec4 surface = imageLoad(surfaces, index_of(p));
    imageStore(words, index_of(p), uvec4(surfel(surface.w, surface.xyz, 0.0), 0u, 0u));
}
