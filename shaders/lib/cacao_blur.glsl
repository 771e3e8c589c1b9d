// CACAO blur of `scan`: one Jacobi step.

// A value mixed with those left, right, above and below by its edges. Edges to holes and to the outside are cut.
float blurred(float c, vec4 around, uint edges) {
    vec4 e = unpack_edges(edges);
    return (0.5 * c + dot(e, around)) / (0.5 + e.x + e.y + e.z + e.w);
}
