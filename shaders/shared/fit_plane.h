// What host and shader share of the plane fit (shaders/fit_plane).
#ifndef SCANSHADE_SHARED_FIT_PLANE_H
#define SCANSHADE_SHARED_FIT_PLANE_H
#include "neighbour.h"
SHARED_BEGIN

struct FitPlaneConstants {
    ivec2 size; // of the image
    Pinhole camera;
    float noise_floor, noise_per_z2; // sigma(z) = floor + per_z2 z^2, metres
    float window;                    // its radius is sqrt(window sigma fx / z), pixels
    float largest_radius;            // but at most this
    float wide_sigmas;               // a window twice as wide serves where values lie so near to one plane
    int drop_flying;                 // 0 = keep them
    int fill_px;                     // holes of a row up to this width are filled; 0 = none
    int neighbours;                  // other frames to average with
    NeighbourPlace places[most_neighbours];
};

// Specialization constants; a uniform here would be compiled in anew for every capture. 1 = samples have been averaged
// over frames, and tell by how much less they err. 1 = they err in waves (disparity), and a wider window is tried.
// 1 = each errs by itself, or is an average of frames: 3x3 of them are averaged, not 5x5.
const int spec_fused = 0, spec_waves = 1, spec_small = 2;

// In place of 1/z where there is none: so far behind all surfaces that no fit gives it weight, and its square still is
// a number.
const float nowhere = -1e17f;

// Threads of a group of the pass that marks filled pixels, each for a word of as many bits.
const int mark_group = 64, marks_a_word = 32;

// Pixels of a column that one thread averages around, and that it fuses: as many as a vec4 has.
const int average_rows = 4, fused_rows = 4;

SHARED_END
#endif
