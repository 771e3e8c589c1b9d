// The normal of a pixel: expects the texel buffer `normals`, three floats a pixel.
vec3 normal_at(int index) {
    return vec3(imageLoad(normals, 3 * index).x, imageLoad(normals, 3 * index + 1).x, imageLoad(normals, 3 * index + 2).x);
}
