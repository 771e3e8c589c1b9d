// What host and shader share of the methods that test points around the surface: luna and hemisphere.
#ifndef SCANSHADE_SHARED_POINT_SAMPLES_H
#define SCANSHADE_SHARED_POINT_SAMPLES_H
#include "screen.h"
SHARED_BEGIN

struct LunaConstants {
    ScreenConstants screen;
    int sets;                 // of `count` vectors, each reflected at a random vector of its own
    int count;                // vectors of a set: 14, or an even number of the first ones
    float epsilon;            // metres in front of the surface up to which nothing occludes
    float fade_from, fade_to; // metres in front over which occlusion ends
};

struct HemisphereConstants {
    ScreenConstants screen;
    int count;  // points of the kernel
    float bias; // published: metres in front of the surface up to which nothing occludes
};

const int spec_published = 10; // 1: as published, faults included

const int spec_renormalise = 11; // 1: unknown samples count as the known ones, where at least half are known

SHARED_END
#endif
