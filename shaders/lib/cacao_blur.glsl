// CACAO blur of `scan`: one Jacobi step.

// A texel mixed with those left, right, above and below by its edges. Edges to holes and to the outside are cut; a hole stays one.
uint blurred(uint c, uvec4 around) {
    vec4 e = unpack_edges(ao_edges(c));
    float sum = 0.5 * float(c & 0xffffu) + dot(e, vec4(around & 0xffffu));
    return uint(sum / (0.5 + e.x + e.y + e.z + e.w) + 0.5) | (c & 0xffff0000u);
}
