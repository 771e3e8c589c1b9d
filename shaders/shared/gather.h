// What host and shader share of the mean over frames (shaders/sequence/gather.comp).
#ifndef SCANSHADE_SHARED_GATHER_H
#define SCANSHADE_SHARED_GATHER_H
#include "screen.h"
SHARED_BEGIN

const int most_gathered = 64;
const int gathered_rows = 4; // pixels of a column that one thread gathers for: they share what a place costs to load

struct GatherConstants {
    ScreenConstants screen;
    int frames;                       // to average with
    float tolerance, tolerance_per_z; // metres between two frames' points of one surface, sigma apart
    NeighbourPlace places[most_gathered];
};

SHARED_END
#endif
