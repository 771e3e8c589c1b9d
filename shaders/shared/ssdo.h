// What host and shader share of SSDO.
#ifndef SCANSHADE_SHARED_SSDO_H
#define SCANSHADE_SHARED_SSDO_H
#include "screen.h"
SHARED_BEGIN

struct SsdoConstants {
    ScreenConstants screen;
    int directions;
};

const int spec_renormalise = 10; // 1: unknown samples count as the known ones, where at least half are known

SHARED_END
#endif
