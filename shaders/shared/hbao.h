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

SHARED_END
#endif
