// A surfel in four floats, the form in which occluders are read: depth, normal, and in the lowest bits of the last the
// thickness as a share of the thickest. The bias keeps those bits from being a denormal number's.

const float surfel_bias = 4.0;
vec4 surfel(float z, vec3 n, float thickness) {
    uint t = uint(nearest(at_most_one(thickness) * 255.0));
    return vec4(z, n.xy, uintBitsToFloat((floatBitsToUint(n.z + surfel_bias) & 0xffffff00u) | t));
}

// Pixels 4 apart lie side by side, one plane for each place in a 4x4 tile: threads of one plane share their rotation and
// steps, so what they read lies side by side too.
int surfel_index(ivec2 p, ivec2 plane) { return (((p.y & 3) * 4 + (p.x & 3)) * plane.y + (p.y >> 2)) * plane.x + (p.x >> 2); }
