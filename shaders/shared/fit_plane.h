// What host and shader share of the plane fit (shaders/fit_plane.comp).
#ifndef SCANSHADE_SHARED_FIT_PLANE_H
#define SCANSHADE_SHARED_FIT_PLANE_H
#include "types.h"
SHARED_BEGIN

struct FitPlaneConstants {
    ivec2 size;                       // of the image
    float fx, fy, cx, cy;             // pinhole, pixels
    float noise_floor, noise_per_z2;  // sigma(z) = floor + per_z2 z^2, metres
    float window;                     // its radius is sqrt(window sigma fx / z), pixels
    float largest_radius;             // but at most this
    int drop_flying;                  // 0 = keep them
};

SHARED_END
#endif
