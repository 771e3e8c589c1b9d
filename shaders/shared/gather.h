// What host and shader share of the mean over frames (shaders/sequence/gather.comp).
#ifndef SCANSHADE_SHARED_GATHER_H
#define SCANSHADE_SHARED_GATHER_H
#include "screen.h"
SHARED_BEGIN

const int most_gathered = 64;

struct GatherConstants {
    ScreenConstants screen;
    int frames;                  // to average with
    float tolerance, tolerance_per_z; // metres between two frames' points of one surface, sigma apart
    float clamp_to;              // others' visibility counts as no farther from the frame's own
    NeighbourPlace places[most_gathered];
    float shares[most_gathered]; // of a frame in the mean, before what its view of a point is worth
};

SHARED_END
#endif
