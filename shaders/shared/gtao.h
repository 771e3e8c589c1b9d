// What host and shader share of the two slice methods: horizons (gtao) and visibility bitmask (bitmask).
#ifndef SCANSHADE_SHARED_GTAO_H
#define SCANSHADE_SHARED_GTAO_H
#include "screen.h"
SHARED_BEGIN

struct GtaoConstants {
    ScreenConstants screen;
    int slices, steps;            // steps to either side
    float turn_cosine, turn_sine; // of pi / slices
    float falloff_scale,
        falloff_add;    // weight of a sample: clamp(add + scale x), x its distance (linear) or that squared
    float distribution; // exponent of the steps' distances
    float thickness;    // bitmask: metres
};

const int spec_bitmask = 10; // 1: visibility bitmask, 0: horizons
const int spec_falloff = 11; // one of the kinds below
const int spec_square = 12;  // 1: distribution is 2

const int falloff_hard = 0;
const int falloff_linear = 1;
const int falloff_quadratic = 2;

SHARED_END
#endif
