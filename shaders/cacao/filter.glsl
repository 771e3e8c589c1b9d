// Bilinear reads of 8-bit maps in integers, so that no driver's filter decides the result (section 11.1, rule F):
// coordinates in 1/256 texel, and each interpolation is rounded to 8 bits, as lavapipe's sampler does.

struct Footprint {
    ivec2 low, high; // clamped texels
    ivec2 part;      // 0 .. 255 of 256 towards `high`
};

ivec2 filter_coordinate(vec2 uv, ivec2 size) { return ivec2(roundEven(256.0 * uv * vec2(size))) - 128; }

Footprint footprint(ivec2 c, ivec2 size) {
    ivec2 t = c >> 8;
    return Footprint(clamp(t, ivec2(0), size - 1), clamp(t + 1, ivec2(0), size - 1), c & 255);
}

int between(int part, int p, int q) { return p + ((part * (q - p) + 128) >> 8); }

float filtered(Footprint f, uint ll, uint hl, uint lh, uint hh) {
    int low = between(f.part.x, int(ll), int(hl)), high = between(f.part.x, int(lh), int(hh));
    return float(between(f.part.y, low, high)) * (1.0 / 255.0);
}
