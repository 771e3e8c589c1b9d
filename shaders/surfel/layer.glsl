// A layer that another view saw behind a block of 2x2 pixels, in one word that orders by nearness: 16 bits of R/z, logarithmic, then the
// normal. The depth is that of the plane in the middle of the block.

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

ivec2 blocks() { return (k.size + 1) >> 1; }
int layer_index(ivec2 block) { return block.y * blocks().x + block.x; }
int layers_size() { return blocks().x * blocks().y; }
vec2 middle_of(ivec2 block) { return vec2(2 * block) + 0.5; }

// Where a ray meets the plane through a point, unless it does so far from the point's own depth.
float plane_depth(vec3 point, vec3 n, vec3 ray) {
    float ratio = dot(n, point) / (dot(n, ray) * point.z);
    return point.z * (abs(ratio - 1.0) < 0.2 ? ratio : 1.0);
}

// Of a layer at a pixel of its block.
float layer_depth_at(uint word, ivec2 p) {
    float z = layer_depth(word, k.radius);
    return plane_depth(ray_of(middle_of(p >> 1)) * z, layer_normal(word), ray_of(vec2(p)));
}

// The least distance of a layer behind the one before it.
float layer_gap(float z, SurfelConstants s) { return max(max(s.apart, 0.01 * z), 3.0 * sigma_of(z)); }
