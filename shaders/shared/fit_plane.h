// What host and shader share of the plane fit (shaders/fit_plane.comp).
#ifndef SCANSHADE_SHARED_FIT_PLANE_H
#define SCANSHADE_SHARED_FIT_PLANE_H
#include "types.h"
SHARED_BEGIN

struct FitPlaneConstants {
    ivec2 size;                       // of the image
    float fx, fy, cx, cy;             // pinhole, pixels
    float noise_floor, noise_per_z2;  // sigma(z) = floor + per_z2 z^2, metres
    float largest_radius;             // of the window, pixels
};

SHARED_END
#endif
