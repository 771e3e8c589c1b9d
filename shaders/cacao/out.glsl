// Stores visibility for two adjacent pixels: in one store where rows have an even length.
layout(binding = 16, scalar) writeonly buffer Out { float visibility[]; };
layout(binding = 16, scalar) writeonly buffer OutPairs { vec2 visibility_pairs[]; };

// Stores pixel p, whose column is even, and the next one, if they are in the image.
void store_visibility(ivec2 p, vec2 v) {
    if (any(greaterThanEqual(p, k.image))) return;
    int here = p.y * k.image.x + p.x;
    if ((k.image.x & 1) == 0) {
        visibility_pairs[here >> 1] = v;
        return;
    }
    visibility[here] = v.x;
    if (p.x + 1 < k.image.x) visibility[here + 1] = v.y;
}
