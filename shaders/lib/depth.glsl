// Depth and normals of a pixel, with holes: expects the texel buffers `depth_in` and, where normals are read, `normals`.

// 0 in holes and outside the image: both are unknown.
float depth_at(ivec2 p) {
    bool known = inside(p);
    float z = imageLoad(depth_in, known ? index_of(p) : 0).x;
    return known ? z : 0.0;
}
