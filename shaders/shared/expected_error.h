// What host and shaders share of expected errors: the signs that a pixel shows, and where each finds its factor.
#ifndef SCANSHADE_SHARED_EXPECTED_ERROR_H
#define SCANSHADE_SHARED_EXPECTED_ERROR_H
#include "types.h"
SHARED_BEGIN

// Positions tested in each pixel's ball.
const int ball_seeds = 16;

// Pixels around each are compared with it at four distances, in two pairs of opposite ones each: along the axes at 1
// and 6 pixels, along the diagonals at 2.8 and 11.3.
const int error_rings = 4;
SHARED_FN int ring_across(int ring) { return ring == 0 ? 1 : ring == 1 ? 2 : ring == 2 ? 6 : 8; }
SHARED_FN bool ring_is_diagonal(int ring) { return ring == 1 || ring == 3; }
// Depth jumps between three pixels in a row where it is off from flat by more than this share of the radius, and by
// more than so many sigmas of the middle one.
const float jump_radii = 0.1f, jump_sigmas = 8.0f;

// The squared error is a product, so its logarithms add up. Between knots they are interpolated. Knots lie at
// - visibility 0, 0.31, 0.56, 0.75, 0.89, 0.97, 1: evenly in 1 - sqrt(1 - visibility), since errors fall fast towards
// 1;
//   times the share of the ball that was seen, 0, 0.25 ... 1
// - the nearest ring with a jump of depth, or none; the nearest one with a hole, or none
// - a radius in the image of 1, 4, 16 ... 1024 pixels
// - sigma / radius of 0, 1/64, 3/64, 7/64, 15/64
const int error_values = 7, error_shares = 5, error_reaches = 6, error_noises = 5;
const int error_edges_at = error_values * error_shares;
const int error_holes_at = error_edges_at + error_rings + 1;
const int error_reaches_at = error_holes_at + error_rings + 1;
const int error_noises_at = error_reaches_at + error_reaches;
const int error_factors = error_noises_at + error_noises;

// Binary logarithms of the factors of the squared error, in the order of the list above; visibility varies fastest.
// Nothing but zeros is an error of 1: nothing is known.
struct ErrorTable {
    float factors[error_factors];
};

// Confidence is 1 - expected error / this, at least 0.
const float hopeless_error = 0.3f;

SHARED_END
#endif
