// CACAO depth mips in a buffer (section 8.2), both profiles: one thread builds the 4x4, 2x2 and single texel of mips 1 to 3 over 8x8 texels
// of one slice. The includer has the functions declared here.

// Depth of a texel of mip 0.
float depth_at(int slice, ivec2 t);
// A texel from four of the mip below.
float nearest_surface(float a, float b, float c, float d);
void store(int slice, int mip, ivec2 t, float z);

layout(local_size_x = 64) in;

// The texel of mip 1 at t, from four of mip 0 taken column by column, as AMD orders them.
float mip1(int slice, ivec2 t) {
    float z = nearest_surface(depth_at(slice, 2 * t), depth_at(slice, 2 * t + ivec2(0, 1)), depth_at(slice, 2 * t + ivec2(1, 0)),
                              depth_at(slice, 2 * t + ivec2(1, 1)));
    store(slice, 1, t, z);
    return z;
}

float mip2(int slice, ivec2 t) {
    float z = nearest_surface(mip1(slice, 2 * t), mip1(slice, 2 * t + ivec2(0, 1)), mip1(slice, 2 * t + ivec2(1, 0)),
                              mip1(slice, 2 * t + ivec2(1, 1)));
    store(slice, 2, t, z);
    return z;
}

void main() {
    k = constants;
    int i = int(gl_GlobalInvocationID.x);
    ivec2 blocks = (k.slice + 7) / 8;
    int slice = i / (blocks.x * blocks.y);
    if (slice > 3) return;
    i -= slice * blocks.x * blocks.y;
    ivec2 t = ivec2(i % blocks.x, i / blocks.x);
    float z = nearest_surface(mip2(slice, 2 * t), mip2(slice, 2 * t + ivec2(0, 1)), mip2(slice, 2 * t + ivec2(1, 0)),
                              mip2(slice, 2 * t + ivec2(1, 1)));
    store(slice, 3, t, z);
}
