// What host and shader share of HBAO.
#ifndef SCANSHADE_SHARED_HBAO_H
#define SCANSHADE_SHARED_HBAO_H
#include "screen.h"
SHARED_BEGIN

struct HbaoConstants {
    ScreenConstants screen;
    int directions, steps;
    float turn_cosine, turn_sine; // of 2 pi / directions
    float bias_cosine, bias_sine; // of the angle bias
    float attenuation;            // 1: by the distance squared, 0: none
    float contrast;
};

const int spec_interleaved = 10; // of HBAO+: 1: depth is in layers

// Size of a layer of every fourth pixel of every fourth row.
SHARED_FN ivec2 layer_size(ivec2 image) { return ivec2((image.x + 3) >> 2, (image.y + 3) >> 2); }

SHARED_END
#endif
