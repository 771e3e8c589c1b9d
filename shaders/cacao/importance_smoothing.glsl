// CACAO HIGHEST (section 8.6, IA and IB): the two filters that smooth the importance map, and its sum.
#include "cacao/filter.glsl"

// Mean of 2x2 texels in the filter's own 8-bit steps.
float box(uint a, uint b, uint c, uint d) { return filtered(Footprint(ivec2(0), ivec2(0), ivec2(128)), a, b, c, d); }

// Mean of four boxes around t, on one side of it or the other. READ(x, y) is a texel of the map, with clamped coordinates.
// Sums of exact quarters of 8-bit steps often tie. Their order decides the ties, so no compiler may change it.
#define BOX(x, y) box(READ(x, y), READ(x + 1, y), READ(x, y + 1), READ(x + 1, y + 1))
#define FIRST_SMOOTHING(t) BOX(t.x - 2, t.y - 1) + BOX(t.x, t.y - 2) + BOX(t.x + 1, t.y) + BOX(t.x - 1, t.y + 1)
#define SECOND_SMOOTHING(t) BOX(t.x - 1, t.y - 2) + BOX(t.x + 1, t.y - 1) + BOX(t.x, t.y + 1) + BOX(t.x - 2, t.y)

// Whether and what texel t adds to the load counter. Every ninth counts, even beyond the map, up to the end of AMD's 8x8 work groups.
bool counts(ivec2 t) { return t.x % 3 == 0 && t.y % 3 == 0 && all(lessThan(t, (k.importance + 7) & ~7)); }
uint load_of(float mean) { return uint(255.0 * clamp(mean, 0.0, 1.0) + 0.5); }
