// Three lines for the pass runner's own tests: out = in + 1, one element a thread.
#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(constant_id = 0) const int step = 1;
layout(binding = 0, r32ui) readonly uniform uimageBuffer from;
layout(binding = 16, r32ui) uniform writeonly uimageBuffer to;
layout(binding = 32, scalar) uniform Constants { int count; };
void main() {
    int i = int(gl_GlobalInvocationID.x);
    // A slow neighbour: reads the far end, so that a missing barrier shows.
    if (i < count) imageStore(to, i, uvec4(imageLoad(from, count - 1 - i).x + uint(step)));
}
