// Normals of CACAO: from the four quadrants around a point, weighted by edges; and how they are stored.

// Unit vector to a neighbour; scan meets neighbours without depth, whose edge weight is zero anyway.
vec3 towards(vec3 from, vec3 to) {
    vec3 d = to - from;
    return scan != 0 ? d * inversesqrt(max(dot(d, d), 1e-30)) : normalize(d);
}

// Not normalised. Scan: zero where no quadrant is whole; the reference then faces the camera.
vec3 normal_from_neighbours(vec4 e, vec3 c, vec3 left, vec3 right, vec3 top, vec3 bottom) {
    vec3 l = towards(c, left), r = towards(c, right), t = towards(c, top), b = towards(c, bottom);
    // The four quadrants' cross products, each weighted by its two edges, factor into one.
    return cross(e.x * l - e.y * r, e.z * t - e.w * b) + vec3(0.0, 0.0, scan != 0 ? 0.0 : -0.0005);
}

// Zero stays zero: a surface of unknown slope is nowhere below a horizon, so it stays open.
vec3 unit(vec3 n) { return n * inversesqrt(max(dot(n, n), 1e-20)); }

// Reference: SNORM8 per axis. Scan: 10 bits per axis in the same 32, 512 standing for zero.
uint pack_normal(vec3 n) {
    n = clamp(n, -1.0, 1.0);
    if (scan != 0) {
        vec3 q = n * 511.0 + 512.0;
        return nearest_small(q.x) | nearest_small(q.y) << 10 | nearest_small(q.z) << 20;
    }
    uvec3 q = uvec3(ivec3(roundEven(n * 127.0))) & 255u;
    return q.x | q.y << 8 | q.z << 16;
}
// As it was stored: in scan 511 times the unit vector.
vec3 coded_normal(uint p) {
    if (scan != 0) {
        uvec3 q = uvec3(p, p >> 10, p >> 20) & 1023u;
#ifdef FOR_GPU // as small() does it, the 512 in the same subtraction
        return uintBitsToFloat(0x4b000000u | q) - (8388608.0 + 512.0);
#else
        return vec3(q) - 512.0;
#endif
    }
    int q = int(p);
    return max(vec3(q << 24 >> 24, q << 16 >> 24, q << 8 >> 24) * (1.0 / 127.0), vec3(-1.0));
}
const float normal_code = scan != 0 ? 1.0 / 511.0 : 1.0;
vec3 unpack_normal(uint p) { return coded_normal(p) * normal_code; }
