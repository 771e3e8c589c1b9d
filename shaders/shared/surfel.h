// What host and shaders share of the surfel bitmask (shaders/surfel).
#ifndef SCANSHADE_SHARED_SURFEL_H
#define SCANSHADE_SHARED_SURFEL_H
#include "screen.h"
SHARED_BEGIN

const int surfel_group = 64;             // threads of the passes along lines
const int reprojected_rows = 4;          // 2x2 pixels of a column that one thread reprojects
const int surfel_run = 32;               // pixels whose edges share a word
const uint surfel_nowhere = 0xfffffffeu; // no edge before the border of the image

struct SurfelConstants {
    ScreenConstants screen;
    ivec2 words;              // of edges: along a row, along a column
    ivec2 plane;              // size of one of the 16 planes that the surfels are stored in
    ivec2 samples;            // pixels that slices are marched from: all, or every other one of every other row
    float thinnest, thickest; // half a surfel's thickness at least and at most, metres
    float alike;              // half a surfel's thickness where all are alike, metres
    float lengthen;           // factor on the half lengths of surfels: few samples leave gaps
    float jut;                // metres by which what hides a surface's continuation stands in front of it
    float longest;            // of what is added to a half length there, metres
    int fill_px;              // holes of a sensor are filled up to this width
    float fill;               // and up to this, metres
    float apart;              // metres that a layer lies behind the one before it at least
    int hidden_shape; // half the thickness of what other views saw behind this one's surfaces, as a surfel has it
};

// Specialization constants, besides those of the shared passes.
const int spec_slices = 10;
const int spec_steps = 11;   // on either side of a slice
const int spec_spacing = 12; // of the samples, pixels
const int spec_layers = 13;  // of surfaces a pixel: 1, or 3 with neighbours
const int spec_round = 14;   // of reproject
const int spec_packed = 15;  // 0: surfaces themselves are read as surfels, all alike in thickness

SHARED_END
#endif
