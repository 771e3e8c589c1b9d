// The pinhole camera, one text for C++ and GLSL. Conventions are stated in projection/camera.h.
#ifndef SCANSHADE_SHARED_CAMERA_H
#define SCANSHADE_SHARED_CAMERA_H
#include "types.h"
SHARED_BEGIN

// Focal lengths and principal point in pixels; pixel centres at integers.
struct Pinhole {
    float fx, fy, cx, cy;
};

// Pixel (u, v) of a point in camera space, in front of the camera (point.z > 0).
SHARED_FN vec2 project(Pinhole camera, vec3 point) {
    return vec2(camera.fx * point.x / point.z + camera.cx, camera.fy * point.y / point.z + camera.cy);
}

// Point in camera space that pixel (u, v) sees at depth z (along +z, not along the ray).
SHARED_FN vec3 unproject(Pinhole camera, vec2 pixel, float z) {
    return vec3((pixel.x - camera.cx) / camera.fx * z, (pixel.y - camera.cy) / camera.fy * z, z);
}

SHARED_END
#endif
