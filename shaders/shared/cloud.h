// Clouds, for host and shaders: constants, the neighbours of a point, and the start of rays.
#ifndef SCANSHADE_SHARED_CLOUD_H
#define SCANSHADE_SHARED_CLOUD_H
#include "types.h"
SHARED_BEGIN

// Lengths in the cloud's unit, indices in the order of its tree.
struct CloudConstants {
    uint points;
    uint levels;    // of the tree's nodes above its leaves
    uint rays;      // per point
    uint runs;      // after so many points rays repeat
    float radius;   // how far rays go
    float rounding; // of a coordinate anywhere on the cloud
    float falloff;  // means: a value's weight is e^(falloff distance^2)
    uint only_up;   // 1: rays that do not point to `up` are not free
    vec3 up;
};

// The plane through a point's neighbours.
struct CloudRound {
    vec3 normal;   // unit, not oriented; zero where there is no plane
    float sixth;   // distance of the sixth neighbour, or of the last
    vec3 variance; // along the normal, along the narrow side, along the wide side
    uint found;    // neighbours, of cloud_neighbours
};

const int cloud_group = 64;      // threads
const int cloud_neighbours = 16; // that make a plane
const int cloud_kept = 8;        // of them remembered
const int cloud_levels = 8;      // of boxes that a work group of 2^(this - 1) threads joins

const int spec_level = 0; // of the boxes that are joined first

SHARED_FN float larger(float a, float b) { return a > b ? a : b; }

// Rays start this far above their point: neighbouring discs rise that much at half of tan 10 degrees.
SHARED_FN float lift_of(float disc, float roughness, float rounding) {
    return larger(larger(0.088F * disc, roughness), rounding);
}
// Discs met within this distance belong to the surface that a ray starts from, if their planes pass its point closely.
SHARED_FN float own_reach(float disc) { return 2 * disc; }
SHARED_FN float own_depth(float disc, float roughness) { return larger(0.2F * disc, 2 * roughness); }
const float own_alike = 0.7F; // cosine between the planes, at least: the other wall of a corner is not its own

// Values that differ by this much are on two sides of an edge: the weight of a neighbour is 1 - (difference / this)^2.
const float mean_apart = 0.9F;

SHARED_END
#endif
