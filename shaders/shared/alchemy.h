// What host and shader share of Alchemy ambient obscurance and its successor SAO.
#ifndef SCANSHADE_SHARED_ALCHEMY_H
#define SCANSHADE_SHARED_ALCHEMY_H
#include "screen.h"
SHARED_BEGIN

struct AlchemyConstants {
    ScreenConstants screen;
    int taps;
    float turn_cosine, turn_sine; // of the angle from tap to tap
    float turns;                  // of the spiral, over all taps
    float contact2;               // epsilon squared, square metres: how near a contact is told apart
    float bias;                   // b of SAO: metres above the tangent plane that do not count
    float pyramid_px;             // where the radius is wider than this, far taps read the pyramid
};

const int spec_sao = 10;         // 1: SAO's falloff and spacing of taps
const int spec_pyramid = 11;     // 1: there is a pyramid of depths
const int spec_level = 12;       // of the pyramid's passes: the level written
const int spec_renormalise = 13; // 1: unknown taps count as the known ones do, where at least half are known

// Levels above the depth image itself. A texel of level m stands for 2^m x 2^m pixels and holds one of them.
const int pyramid_levels = 5;

// Size of a level, and the texel at which it begins: all levels share one buffer.
SHARED_FN ivec2 pyramid_size(ivec2 image, int level) {
    int round_up = (1 << level) - 1;
    return ivec2((image.x + round_up) >> level, (image.y + round_up) >> level);
}
SHARED_FN int pyramid_start(ivec2 image, int level) {
    int start = 0;
    for (int i = 1; i < level; ++i) {
        ivec2 size = pyramid_size(image, i);
        start += size.x * size.y;
    }
    return start;
}

SHARED_END
#endif
