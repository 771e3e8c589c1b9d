// What host and shader share of ABAO.
#ifndef SCANSHADE_SHARED_ABAO_H
#define SCANSHADE_SHARED_ABAO_H
#include "screen.h"
SHARED_BEGIN

struct AbaoConstants {
    ScreenConstants screen;
    int lines, steps;             // steps to either side
    float turn_cosine, turn_sine; // of pi / lines
    float fade;                   // of elevations, per squared radius: 1, or 0 for a hard radius
};

const int spec_published =
    10; // 1: one step a line, at radii that differ from line to line, and weights by what is known

SHARED_END
#endif
