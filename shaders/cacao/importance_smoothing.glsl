// CACAO HIGHEST (section 8.6, IA and IB): the two filters that smooth the importance map, and its sum.
#include "cacao/filter.glsl"

// Mean of 2x2 texels in the filter's own 8-bit steps.
float box(uint a, uint b, uint c, uint d) { return filtered(Footprint(ivec2(0), ivec2(0), ivec2(128)), a, b, c, d); }

// Mean of four boxes around t, on one side of it or the other. READ(x, y) is a texel of the map, coordinates clamped.
// Exact quarters of 8-bit steps tie often; the order of these sums decides them, so no compiler may change it.
#define BOX(x, y) box(READ(x, y), READ(x + 1, y), READ(x, y + 1), READ(x + 1, y + 1))
#define FIRST_SMOOTHING(t) BOX(t.x - 2, t.y - 1) + BOX(t.x, t.y - 2) + BOX(t.x + 1, t.y) + BOX(t.x - 1, t.y + 1)
#define SECOND_SMOOTHING(t) BOX(t.x - 1, t.y - 2) + BOX(t.x + 1, t.y - 1) + BOX(t.x, t.y + 1) + BOX(t.x - 2, t.y)

// What texel t adds to the load counter: every ninth counts, those beyond the map up to AMD's work groups of 8x8 included.
bool counts(ivec2 t) { return t.x % 3 == 0 && t.y % 3 == 0 && all(lessThan(t, (k.importance + 7) & ~7)); }
uint load_of(float mean) { return uint(255.0 * clamp(mean, 0.0, 1.0) + 0.5); }
