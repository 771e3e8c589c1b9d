// Depth of a pixel, with holes: expects the texel buffer `depth_in`.

// 0 in holes and outside the image: both are unknown.
float depth_at(ivec2 p) {
    bool known = inside(p);
    float z = imageLoad(depth_in, known ? index_of(p) : 0).x;
    return known ? z : 0.0;
}
