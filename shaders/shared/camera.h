// The pinhole camera, one text for C++ and GLSL. Conventions are stated in projection/camera.h.
#ifndef SCANSHADE_SHARED_CAMERA_H
#define SCANSHADE_SHARED_CAMERA_H
#include "types.h"
SHARED_BEGIN

// Focal lengths and principal point in pixels; pixel centres at integers.
struct Pinhole {
    float fx, fy, cx, cy;
};

// One axis of the two formulas below: the pixel of a coordinate at depth z, and x / z (or y / z) of the ray through a
// pixel. The host computes them in double precision, too.
SHARED_NUMBER_FN project_axis(Number focal, Number centre, Number coordinate, Number z) {
    return focal * coordinate / z + centre;
}
SHARED_NUMBER_FN ray_axis(Number focal, Number centre, Number pixel) { return (pixel - centre) / focal; }

// Pixel (u, v) of a point in camera space, in front of the camera (point.z > 0).
SHARED_FN vec2 project(Pinhole camera, vec3 point) {
    return vec2(project_axis(camera.fx, camera.cx, point.x, point.z),
                project_axis(camera.fy, camera.cy, point.y, point.z));
}

// The ray through a pixel, z = 1.
SHARED_FN vec3 ray_through(Pinhole camera, vec2 pixel) {
    return vec3(ray_axis(camera.fx, camera.cx, pixel.x), ray_axis(camera.fy, camera.cy, pixel.y), 1);
}

// Point in camera space that pixel (u, v) sees at depth z (along +z, not along the ray).
SHARED_FN vec3 unproject(Pinhole camera, vec2 pixel, float z) {
    vec3 ray = ray_through(camera, pixel);
    return vec3(ray.x * z, ray.y * z, z);
}

SHARED_END
#endif
