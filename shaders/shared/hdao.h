// What host and shader share of HDAO.
#ifndef SCANSHADE_SHARED_HDAO_H
#define SCANSHADE_SHARED_HDAO_H
#include "screen.h"
SHARED_BEGIN

struct HdaoConstants {
    ScreenConstants screen;
    int pairs;
    float turn_cosine, turn_sine; // of the golden angle
    float accept;                 // a: metres by which a tap must stand out, besides depth's own noise:
    float sigmas;                 // so many of its deviations
};

const int spec_test = 10;             // one of the kinds below
const int spec_normal_rejection = 11; // 1: where the normals around agree, nothing occludes

const int test_plane = 0; // above the tangent plane, each side by itself
const int test_angle = 1; // both sides make a valley: by the angle between them
const int test_z = 2;     // both sides make a valley: nearer than the centre, as published

SHARED_END
#endif
