// Normals of `scan`: from the four quadrants around a point, weighted by edges (section 8.1), and how they are stored.

// Unit vector to a neighbour. It is meaningless for a neighbour without depth, whose edge weight is zero.
vec3 towards(vec3 from, vec3 to) {
    vec3 d = to - from;
    return d * inversesqrt(max(dot(d, d), 1e-30));
}

// Not normalised. Zero where no quadrant is complete; AMD's normal then faces the camera.
vec3 normal_from_neighbours(vec4 e, vec3 c, vec3 left, vec3 right, vec3 top, vec3 bottom) {
    vec3 l = towards(c, left), r = towards(c, right), t = towards(c, top), b = towards(c, bottom);
    // The four quadrants' cross products, each weighted by its two edges, factor into one.
    return cross(e.x * l - e.y * r, e.z * t - e.w * b);
}

// Zero stays zero: without a normal no sample is above the horizon, so the surface stays open.
vec3 unit(vec3 n) { return n * inversesqrt(max(dot(n, n), 1e-20)); }
bool is_normal(vec3 n) { return dot(n, n) > 1e-8; }

// 10 bits per axis (AMD: 8) in the same 32, 512 standing for zero.
uint pack_normal(vec3 n) {
    vec3 q = clamp(n, -1.0, 1.0) * 511.0 + 512.0;
    return nearest_small(q.x) | nearest_small(q.y) << 10 | nearest_small(q.z) << 20;
}
// As it was stored: normal_levels times the unit vector.
const float normal_levels = 511.0;
vec3 coded_normal(uint p) { return small_less(uvec3(p, p >> 10, p >> 20) & 1023u, 512.0); }
vec3 unpack_normal(uint p) { return coded_normal(p) * (1.0 / normal_levels); }
