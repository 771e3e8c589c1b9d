// What another view saw behind a pixel, in one word that orders by nearness: 16 bits of R/z, logarithmic, then the normal.

const int least_nearness = (127 - 12) << 12; // of z = 2^12 R, where the radius no longer shows; the most is z = R / 16

// 0 is no surface. Of the normal only the plane is kept, not which side of it was seen.
uint layer_word(float z, vec3 n, float radius) {
    int nearness = clamp((floatBitsToInt(radius / z) >> 11) - least_nearness, 1, 0xffff);
    vec2 flat_normal = n.xy * ((n.z > 0.0 ? -127.0 : 127.0) / (abs(n.x) + abs(n.y) + abs(n.z) + 1e-20)); // octahedron
    return uint(nearness << 16 | (nearest(flat_normal.x) & 0xff) << 8 | (nearest(flat_normal.y) & 0xff));
}

// To one part in 8000; huge where there is none.
float layer_depth(uint word, float radius) {
    return word == 0u ? 1e30 : radius / intBitsToFloat((int(word >> 16) + least_nearness) << 11 | 1 << 10);
}

vec3 layer_normal(uint word) {
    vec2 p = vec2(ivec2(int(word)) << ivec2(16, 24) >> 24) / 127.0;
    return normalize(vec3(p, -positive(1.0 - abs(p.x) - abs(p.y))));
}
