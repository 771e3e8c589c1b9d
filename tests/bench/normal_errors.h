// Errors of the normals and edges of prepared depth, against the exact geometry of generated scenes.
#pragma once

#include "ao/gpu/device.h"

#include <string>
#include <vector>

namespace scanshade {

/// A simulated sensor, and the width of its plane fits' windows.
struct NormalCase {
    std::string name; ///< "kinect, CACAO's windows"
    std::string sensor;
    double smoothing; ///< of FitPlaneOptions
    double aim;       ///< degrees: the largest median allowed at 1 .. 3 m
};

/// CACAO's windows are those of a plain `run`, so its aim is tight. Methods that know the noise take narrower windows.
[[nodiscard]] const std::vector<NormalCase>& normal_cases();

/// Over two 640x480 views of each scene. Angles are in degrees to the exact normal.
struct NormalErrors {
    struct Angles {
        double median, percentile_95;
    };
    double share_with_normal; ///< of the pixels with recorded depth
    Angles all, near;         ///< of all pixels with a normal; of those at 1 .. 3 m
    /// Of the pixels at a jump of true depth by 10 cm and 5 % or more: the share within a pixel of an edge
    /// (error_classes.h) of prepared depth. Pixels next to holes are left out.
    double edges_kept;
};

[[nodiscard]] NormalErrors normal_errors(gpu::Device& device, const NormalCase& which);

} // namespace scanshade
