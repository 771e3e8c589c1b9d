// Images that share a pinhole camera, and the value of a hole in each.
#pragma once

#include "projection/camera.h"

#include <opencv2/core.hpp>

namespace scanshade {

/// Depth as the methods see it: distortion removed.
struct DepthImage {
    Pinhole camera;
    cv::Mat1f z_m;    ///< metres along +z; 0 = hole; always finite, never negative
    cv::Mat1i source; ///< index of the point each pixel shows, -1 for none; empty when the sensor gave an image
    cv::Mat1f recorded_m =
        {}; ///< where a lens bent the image: the recorded one that `z_m` was made from, metres; else empty
};

/// Unit normals in camera space, facing the camera; (0, 0, 0) where there is none.
struct NormalImage {
    cv::Mat3f normals;
};

/// Ambient occlusion as visibility: 1 open, 0 closed, NaN where there is no surface.
struct AoMap {
    cv::Mat1f visibility;
};

} // namespace scanshade
