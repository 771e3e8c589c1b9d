// A surfel in four floats, the form in which occluders are read: depth, normal, and in the lowest bits of the last the
// thickness as a share of the thickest. The bias keeps those bits from being a denormal number's.

const float surfel_bias = 4.0;
vec4 surfel(float z, vec3 n, float thickness) {
    uint t = uint(nearest(at_most_one(thickness) * 255.0));
    return vec4(z, n.xy, uintBitsToFloat((floatBitsToUint(n.z + surfel_bias) & 0xffffff00u) | t));
}
float thickness_of(float w) { return float(floatBitsToInt(w) & 0xff) * (1.0 / 255.0); }
