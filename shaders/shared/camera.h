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

// One coordinate of the ray through a pixel: x / z from u, fx, cx, or y / z from v, fy, cy.
SHARED_FN_OF(Number) Number ray_coordinate(Number pixel, Number focal_length, Number centre) {
    return (pixel - centre) / focal_length;
}

// The ray through a pixel, z = 1.
SHARED_FN vec3 ray_through(Pinhole camera, vec2 pixel) {
    return vec3(ray_coordinate(pixel.x, camera.fx, camera.cx), ray_coordinate(pixel.y, camera.fy, camera.cy), 1);
}

// Point in camera space that pixel (u, v) sees at depth z (along +z, not along the ray).
SHARED_FN vec3 unproject(Pinhole camera, vec2 pixel, float z) {
    vec3 ray = ray_through(camera, pixel);
    return vec3(ray.x * z, ray.y * z, z);
}

SHARED_END
#endif
