// What host and shaders share of VXAO (shaders/vxao): a sparse grid of voxels, in bricks.
#ifndef SCANSHADE_SHARED_VXAO_H
#define SCANSHADE_SHARED_VXAO_H
#include "screen.h"
SHARED_BEGIN

// A brick has 8 voxels a side, and one more for interpolation: copies of the next bricks' first ones.
const int vxao_side = 8;
const int vxao_rimmed = vxao_side + 1;
const int vxao_inner = vxao_side * vxao_side * vxao_side;
const int vxao_stored = vxao_rimmed * vxao_rimmed * vxao_rimmed;

// Levels of voxels, each of twice the edge of the one before: up to the radius, from 1/32 of it.
const int vxao_levels = 6;
// The cells that surfaces within the radius of a pixel lie in are a table of their own, after those of the levels.
const int vxao_reach = vxao_levels;
const int vxao_tables = vxao_levels + 1;

// Numbers that the passes count with: bricks of each level, and the view that is splatted.
const int vxao_view = vxao_levels;
const int vxao_counters = vxao_levels + 1;

const int vxao_threads = 64;  // of a work group that takes bricks
const int vxao_groups = 1024; // of them

struct VxaoConstants {
    ScreenConstants screen;
    vec3 grid_x, grid_y, grid_z; // of the grid, in this view's space, unit
    vec3 shift;                  // of its origin, voxels
    float voxel, per_voxel;      // edge at level 0, metres, and its inverse
    float sampled;               // pixels that a voxel must be wide
    float sigmas;                // and deviations of depth
    int levels;                  // in use
    int slots_log2;              // of each table
    int bricks;                  // there is room for
    int cones;
    float tangent;           // of a cone's half angle
    float gain;              // on opacity: sheets of one voxel are sampled between their centres
    float open[vxao_levels]; // V of an open plane, where voxels are of this level
};

// Specialization constants.
const int spec_first = 10; // merge: 1 = of this view's own surfaces, which come first
const int spec_level = 11; // mip: the level that is made

SHARED_END
#endif
