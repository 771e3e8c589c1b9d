// Where another view of the same scene stands, one text for C++ and GLSL.
#ifndef SCANSHADE_SHARED_NEIGHBOUR_H
#define SCANSHADE_SHARED_NEIGHBOUR_H
#include "camera.h"
SHARED_BEGIN

// Where a neighbour stands: a point of it is turned to (dot(x, p), dot(y, p), dot(z, p)) and shifted; its rays.
struct NeighbourPlace {
    vec3 x, y, z, shift;
    vec2 ray_step, ray_base;
};
const int most_neighbours = 16;

SHARED_END
#endif
