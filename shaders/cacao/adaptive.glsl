// CACAO HIGHEST (section 8.5, G3): how many pairs of taps follow those of the base pass. The includer has the buffers `importance` and
// `load_counter`.
#include "cacao/filter.glsl"

const int base_taps = 5;
const float weight_range = 20.0; // the base pass stores its weight sum divided by this

// Importance, 0 to 1, at uv of the map.
float importance_at(vec2 uv) {
    ivec2 c = filter_coordinate(uv, k.importance);
    Footprint f = footprint(c, k.importance);
    return filtered(f, imageLoad(importance, f.low.y * k.importance.x + f.low.x).x, imageLoad(importance, f.low.y * k.importance.x + f.high.x).x,
                    imageLoad(importance, f.high.y * k.importance.x + f.low.x).x, imageLoad(importance, f.high.y * k.importance.x + f.high.x).x);
}

// The share of adjacent texels' shadows in the obscurance that all taps find.
float detail_share(float wanted) { return 5.0 / 32.0 + wanted * (27.0 / 32.0); }

// One past the last tap. Each texel gets fewer taps than it wants where the whole image wants too many.
int taps_end(float wanted) {
    float average = float(imageLoad(load_counter, 0).x) * k.load_counter_div;
    wanted *= clamp(k.adaptive_limit / average, 0.0, 1.0);
    return min(31, int(27.0 * wanted + 1.5) + base_taps);
}
