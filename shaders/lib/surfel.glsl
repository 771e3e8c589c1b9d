// The image as surfels: each pixel's depth, normal and thickness in two words, the form in which occluders are read.

// Unit vector to two numbers in [-1, 1] and back, but for length (octahedral map, Meyer et al. 2010).
vec2 folded(vec3 n) {
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    vec2 away = 1.0 - abs(p.yx);
    return n.z < 0.0 ? vec2(p.x < 0.0 ? -away.x : away.x, p.y < 0.0 ? -away.y : away.y) : p;
}
vec3 unfolded(vec2 p) {
    float z = 1.0 - abs(p.x) - abs(p.y);
    float over = positive(-z);
    return vec3(p.x - (p.x < 0.0 ? -over : over), p.y - (p.y < 0.0 ? -over : over), z);
}

// 12 bits for each number of the normal (0.03 degrees), 8 for the thickness as a share of `thickest`. All ones: no normal.
const uint no_normal = 0xffffff00u;
uint packed(vec3 n, float thickness) {
    uint t = uint(nearest(at_most_one(thickness) * 255.0));
    ivec2 p = ivec2(nearest(folded(n).x * 2046.0), nearest(folded(n).y * 2046.0)) + 2047;
    return dot(n, n) > 0.0 ? (uint(p.x) << 20) | (uint(p.y) << 8) | t : no_normal | t;
}
bool has_normal(uint word) { return word < no_normal; }
// Some 0.7 to 1.7 long.
vec3 normal_of(uint word) {
    return unfolded(vec2(float(int(word >> 20) - 2047), float(int((word >> 8) & 0xfffu) - 2047)) * (1.0 / 2046.0));
}
float thickness_of(uint word) { return float(int(word & 0xffu)) * (1.0 / 255.0); }
