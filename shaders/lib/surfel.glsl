// A surfel in two words, the form in which occluders are read: depth, and in bytes the normal (127 long; half a degree is
// enough for which way a pixel's piece of surface lies) and the thickness as a share of the thickest.
uvec2 surfel(float z, vec3 n, float thickness) {
    ivec3 q = ivec3(nearest(n.x * 127.0), nearest(n.y * 127.0), nearest(n.z * 127.0)) & 0xff;
    return uvec2(floatBitsToUint(z), q.x << 24 | q.y << 16 | q.z << 8 | nearest(at_most_one(thickness) * 255.0));
}

// The normal as whole numbers, up to rounding 127 long.
ivec3 bytes_of_normal(uint shape) { return ivec3(int(shape)) << ivec3(0, 8, 16) >> 24; }

// In a row, pixels 4 apart are contiguous. Threads that share their rotation and steps lie 4 pixels apart, so their reads are
// contiguous, too.
int surfel_index(ivec2 p, ivec2 plane) { return (p.y << 2 | (p.x & 3)) * plane.x + (p.x >> 2); }
