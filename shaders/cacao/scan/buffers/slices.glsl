// The four slices of AO in a buffer, for the resolve.
layout(binding = 0, r32ui) readonly uniform uimageBuffer ao;

Texel texel_or_hole(int slice, ivec2 t) {
    bool inside = all(lessThan(uvec2(t), uvec2(k.slice)));
    uint texel = imageLoad(ao, inside ? slice_index(slice, t) : 0).x;
    return Texel(inside && !is_hole(texel) ? float(texel & 0xffffu) : -1.0, texel >> 16);
}
