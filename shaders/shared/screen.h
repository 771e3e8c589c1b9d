// What host and shaders share of every screen-space room but CACAO's: the view, the radius, and how the result is
// shown.
#ifndef SCANSHADE_SHARED_SCREEN_H
#define SCANSHADE_SHARED_SCREEN_H
#include "neighbour.h"
SHARED_BEGIN

// A room's own constant block begins with this one, so that the passes all rooms share can read it there.
struct ScreenConstants {
    Pinhole camera;
    ivec2 size;              // of the image, with its guard band where there is one
    ivec2 origin, window;    // what was recorded lies in it from here on, so large; all of it but for a guard band
    vec2 turn;               // added to the noise table's numbers: differs from instant to instant
    vec2 ray_step, ray_base; // the ray of pixel p is (p ray_step + ray_base, 1): divisions are dear
    float radius;            // R, metres
    float noise_floor, noise_per_z2; // sigma(z) = floor + per_z2 z^2 of the depth looked at, metres
    float tangent_sine;              // beta_t: samples lower above the tangent plane than this do not count (sine)
    float tangent_sigmas;            // kappa: nor do those within so many sigma(z) of it
    float curve;                     // k of exp(-k (1 - V)), which is shown in place of V; 0: V itself
    float strength, power;           // of what is shown of that: (1 - strength (1 - V))^power
    int neighbours;                  // other views there are of this one
    float alignment_error;           // metres that their surfaces may lie off
    NeighbourPlace places[most_neighbours];
};

// Pixels of the noise table's side, and of a work group's.
const int noise_side = 64;
const int screen_tile = 8;

// Specialization constants of the shared passes.
const int spec_supplied = 0;    // normals: 1 = the view brings some
const int spec_denoise = 1;     // denoise: 0 = only the tone curve is applied
const int spec_blur_radius = 3; // blur: taps to either side
const int spec_blur_down = 4;   // blur: 1 = along columns, 0 = along rows

SHARED_END
#endif
