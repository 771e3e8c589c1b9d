// CACAO `scan`, resolve (section 8.8, A-smart): one AO value per pixel of the AO grid out of the four slices, whatever the quality.
// The weights are AMD's, but centred on the pixel: AMD's samples lie half a pixel off. The includer has texel_or_hole().

// A slice's texel, or a hole where there is none.
Texel texel_or_hole(int slice, ivec2 t);

struct Known {
    float value;  // visibility in the texel's own units, 0 at holes
    float weight; // 1, or 0 at holes and outside
};

Known known_of(Texel texel) {
    float weight = one_if_known(texel.value);
    return Known(texel.value * weight, weight);
}
Known known(int slice, ivec2 t) { return known_of(texel_or_hole(slice, t)); }

// Weights of left, right, above and below, and of the diagonals, row by row. The edges divide the weight of each pair.
struct Weights {
    vec4 beside, across;
};
Weights smart_weights(uint edges) {
    vec4 e = unpack_edges(edges);
    float wh = (e.x + e.y) * 0.5, wv = (e.z + e.w) * 0.5, wd = (wh + wv) * 0.5;
    vec2 pull = vec2(e.y - e.x, e.w - e.z) * 0.5;
    float wl = 0.5 - pull.x, wr = 0.5 + pull.x, wt = 0.5 - pull.y, wb = 0.5 + pull.y;
    return Weights(vec4(wh * wl, wh * wr, wv * wt, wv * wb), wd * vec4(wt * wl, wt * wr, wb * wl, wb * wr));
}

// The weighted mean of a texel and its neighbours. Returns visibility, or -1 at a hole.
float smart(Texel c, Known l, Known r, Known t, Known b, Known lt, Known rt, Known lb, Known rb) {
    Weights w = smart_weights(c.edges);
    float sum = c.value + dot(w.beside, vec4(l.value, r.value, t.value, b.value)) + dot(w.across, vec4(lt.value, rt.value, lb.value, rb.value));
    float total = 1.0 + dot(w.beside, vec4(l.weight, r.weight, t.weight, b.weight)) + dot(w.across, vec4(lt.weight, rt.weight, lb.weight, rb.weight));
    bool filled = spacing == 1 && (c.edges & filled_texel >> 16) != 0u; // the upsampler leaves these out itself
    return c.value >= 0.0 && !filled ? sum / (total * 65535.0) : -1.0;
}

// LOWEST computes no value at every second pixel: it takes the four neighbours' values, weighted by their edges towards it.
float from_neighbours(Texel l, Texel r, Texel t, Texel b) {
    Known nl = known_of(l), nr = known_of(r), nt = known_of(t), nb = known_of(b);
    vec4 w = vec4(unpack_edges(l.edges).y, unpack_edges(r.edges).x, unpack_edges(t.edges).w, unpack_edges(b.edges).z) + 1e-3;
    w *= vec4(nl.weight, nr.weight, nt.weight, nb.weight);
    float total = w.x + w.y + w.z + w.w;
    float sum = dot(w, vec4(nl.value, nr.value, nt.value, nb.value));
    return total > 0.0 ? sum / (total * 65535.0) : 1.0; // among holes only, no occluder is known
}

// Visibility of grid pixels (2t, 2t + (1, 0), 2t + (0, 1), 2t + (1, 1)); -1 at holes.
vec4 resolved_block(ivec2 t) {
    const ivec2 x = ivec2(1, 0), y = ivec2(0, 1);
    Texel c0 = texel_or_hole(0, t), c3 = texel_or_hole(3, t);
    if (two_slices != 0) { // odd pixels have no hole flag of their own: the caller knows their depth
        const Known none = Known(0.0, 0.0);
        Known k0 = known(0, t), k3 = known(3, t);
        return vec4(smart(c0, none, none, none, none, known(3, t - x - y), known(3, t - y), known(3, t - x), k3),
                    from_neighbours(c0, texel_or_hole(0, t + x), texel_or_hole(3, t - y), c3),
                    from_neighbours(texel_or_hole(3, t - x), c3, c0, texel_or_hole(0, t + y)),
                    smart(c3, none, none, none, none, k0, known(0, t + x), known(0, t + y), known(0, t + x + y)));
    }
    Texel c1 = texel_or_hole(1, t), c2 = texel_or_hole(2, t);
    Known k00 = known(3, t - x - y), k10 = known(2, t - y), k20 = known(3, t - y), k30 = known(2, t + x - y);
    Known k01 = known(1, t - x), k11 = known(0, t), k21 = known(1, t), k31 = known(0, t + x);
    Known k02 = known(3, t - x), k12 = known(2, t), k22 = known(3, t), k32 = known(2, t + x);
    Known k03 = known(1, t - x + y), k13 = known(0, t + y), k23 = known(1, t + y), k33 = known(0, t + x + y);
    return vec4(smart(c0, k01, k21, k10, k12, k00, k20, k02, k22), smart(c1, k11, k31, k20, k22, k10, k30, k12, k32),
                smart(c2, k02, k22, k11, k13, k01, k21, k03, k23), smart(c3, k12, k32, k21, k23, k11, k31, k13, k33));
}
