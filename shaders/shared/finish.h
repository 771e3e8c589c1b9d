// What host and shaders share of the last passes of a frame: expected errors, clay, and the bytes of maps and pictures.
#ifndef SCANSHADE_SHARED_FINISH_H
#define SCANSHADE_SHARED_FINISH_H
#include "camera.h"
#include "expected_error.h"
#include "light.h"
#include "types.h"
SHARED_BEGIN

struct FinishConstants {
    ivec2 size; // of the image
    Pinhole camera;
    float radius;                    // of the ball, metres
    float noise_floor, noise_per_z2; // sigma(z) = floor + per_z2 z^2, metres
    float strength;                  // of the visibility in pictures
    int words;                       // of four pixels each
    LightConstants light;            // that pictures are split by
    vec2 seeds[ball_seeds];          // evenly over the unit disc
    ErrorTable errors;               // of the method
};

// A work group: so many pixels of a row, or words of four pixels.
const int finish_row = 256;

// Of each pixel, to look for what sends light to it.
const int bounce_directions = 32;

// The colour where there is no surface, a dim one that no visibility has.
const int no_surface_blue = 64, no_surface_green = 40, no_surface_red = 28;
// Grey of clay, out of 255: of a surface seen edge-on, and how much is added for one that faces the camera.
const float clay_edge_on = 70, clay_facing = 165;

// Specialization constants.
const int spec_is_depth = 0;        // clay: 1 = the surface is given as z, 0 = as 1/z
const int spec_down = 1;            // smooth: 1 = along columns, 0 = along rows
const int spec_map_bits = 2;        // pack: of a value in the map, 16, 8 or 0 = no map
const int spec_confidence_bits = 3; // pack: 8 or 0
const int spec_picture = 4;         // pack: what the picture shows
const int spec_normals = 5;         // clay, light: 1 = there are normals of plane fits
const int spec_light = 6;           // pack: 1 = there is direct light
const int spec_ambient = 9;         // pack: 1 = visibility multiplies, or divides, ambient light alone
const int spec_unshaded = 7;        // pack: 1 = colour divided by visibility is made
const int spec_split = 8;           // pack: 1 = images of ambient and of direct light are made
const int spec_indirect = 10;       // pack: 1 = the image of one bounce of light is made
const int spec_known = 11;          // bounce: 1 = there are pixels without a known colour
const int spec_linear = 12;         // bounce: 1 = colours are given as linear light, 0 .. 1
const int spec_unbounded = 13;      // linear: 1 = colour divided by visibility may exceed white
const int picture_none = 0;
const int picture_colour = 1;
const int picture_clay = 2;
const int picture_both = 3; // colour where it is known, else clay

SHARED_END
#endif
