// CACAO HIGHEST (section 8.6, I0): how strongly a 4x4 block of the AO grid needs more taps. The includer has the buffer `base_result`,
// ao_value() and is_hole().

float base_visibility(float obscurance) { return pow(clamp(1.0 - k.shadow_strength * obscurance, 0.0, 1.0), k.shadow_power); }

// Contrast of the base pass over the 2x2 texels of each slice, in 255ths.
uint importance_of(ivec2 t) {
    float least = 2.0, most = -1.0;
    for (int slice = 0; slice < 4; ++slice)
        for (int i = 0; i < 4; ++i) {
            uint b = imageLoad(base_result, slice_index(slice, min(2 * t + ivec2(i & 1, i >> 1), k.slice - 1))).x;
            if (is_hole(b)) continue;
            least = min(least, ao_value(b));
            most = max(most, ao_value(b));
        }
    float contrast = most >= 0.0 ? base_visibility(least) - base_visibility(most) : 0.0;
    return quantised(pow(clamp(2.0 * contrast, 0.0, 1.0), 0.8), 255.0);
}
