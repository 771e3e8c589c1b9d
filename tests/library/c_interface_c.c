/* The C interface from C: the header is C, and one image goes through it. Returns 0, or the line that failed. */
#include <scanshade/scanshade.h>

#include <math.h>

#define REQUIRE(condition)                                                                                             \
    if (!(condition))                                                                                                  \
        return __LINE__;

int one_image_in_c(void) {
    enum { width = 64, height = 48 };
    float z[width * height];
    for (int i = 0; i < width * height; ++i)
        z[i] = i == 0 ? 0.0F : 2.0F;
    scanshade_camera camera = SCANSHADE_CAMERA_INIT;
    camera.fx = camera.fy = 50;
    camera.cx = 31.5;
    camera.cy = 23.5;
    scanshade_depth depth = SCANSHADE_DEPTH_INIT;
    depth.values = z;
    depth.type = SCANSHADE_FLOAT32;
    depth.width = width;
    depth.height = height;
    depth.camera = &camera;
    const scanshade_setting settings[] = {{"method", "surfel"}, {"depth-noise", "none"}};
    scanshade_session* session = NULL;
    scanshade_result* result = NULL;
    scanshade_arrays arrays = SCANSHADE_ARRAYS_INIT;
    REQUIRE(scanshade_session_open(settings, 2, &session) == SCANSHADE_OK)
    REQUIRE(scanshade_compute_depth(session, &depth, SCANSHADE_CONFIDENCE | SCANSHADE_NORMALS, &result) == SCANSHADE_OK)
    REQUIRE(scanshade_result_arrays(result, &arrays) == SCANSHADE_OK)
    REQUIRE(arrays.count == 1 && arrays.width == width && arrays.height == height)
    REQUIRE(isnan(arrays.visibility[0]) && isnan(arrays.confidence[0]) && isnan(arrays.normals[0]))
    REQUIRE(arrays.visibility[24 * width + 32] > 0.99F)         /* a plane is open */
    REQUIRE(arrays.normals[3 * (24 * width + 32) + 2] < -0.99F) /* and faces the camera */
    scanshade_result_free(result);
    scanshade_session_close(session);
    return 0;
}
