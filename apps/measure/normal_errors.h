// How far normals and edges of prepared depth, which is what methods see, are from the generated scenes' exact
// geometry.
#pragma once

#include "ao/gpu/device.h"

#include <string>
#include <vector>

namespace scanshade {

/// A simulated sensor, and how wide the windows of its plane fits are.
struct NormalCase {
    std::string name; ///< "kinect, CACAO's windows"
    std::string sensor;
    double smoothing; ///< of FitPlaneOptions
    double aim;       ///< degrees: the median at 1 .. 3 m must not be above
};

/// CACAO's windows are those of a plain `run`, so its aim is close; methods that know the noise take narrower ones.
[[nodiscard]] const std::vector<NormalCase>& normal_cases();

/// Over two 640x480 views of each scene. Angles are in degrees to the exact normal.
struct NormalErrors {
    struct Angles {
        double median, percentile_95;
    };
    double share_with_normal; ///< of the pixels with recorded depth
    Angles all, near;         ///< of all pixels with a normal; of those at 1 .. 3 m
    /// Of the pixels beside a jump of true depth by 10 cm and 5 % or more, the share within a pixel of an edge
    /// (error_classes.h) of the depth that methods see. Pixels beside holes are left out.
    double edges_kept;
};

[[nodiscard]] NormalErrors normal_errors(gpu::Device& device, const NormalCase& which);

} // namespace scanshade
