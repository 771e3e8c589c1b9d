// What was recorded at one instant: colour with depth, or a cloud; the first value of the walk.
#pragma once

#include "projection/base/finding.h"
#include "projection/camera.h"

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// A cloud file's own bytes, fields and text, which only io understands (io/clouds/cloud_file.h); kept so that
/// everything not touched is written back bit for bit.
struct CloudRecords;

/// Points in camera space (x right, y down, z forward), in file order, metres.
struct Cloud {
    cv::Size grid;                       ///< width x height; height 1 = unorganised
    std::vector<Eigen::Vector3d> points; ///< grid.area() of them, row by row; NaN in all three where invalid
    std::vector<cv::Vec3b> colours;      ///< BGR, one per point, or empty
    std::shared_ptr<const CloudRecords> records;
    bool pixels_of_one_image = false; ///< an unorganised cloud: each point is a pixel of the frame's camera

    [[nodiscard]] bool organised() const { return grid.height > 1; }
};

/// Whether colour pixel (u, v) and depth pixel (u, v) see the same point. Only set where the data say so.
enum class Registration { unknown, yes, no };

/// The secondary camera, which took the colour images.
struct ColourCamera {
    Camera camera;
    Eigen::Isometry3d colour_from_depth = Eigen::Isometry3d::Identity(); ///< depth camera space to colour camera space
};

/// One recorded instant. Either `depth_m` or `cloud` is there.
struct Frame {
    std::string name;                          ///< names the outputs: unique in its capture, no path separators
    Camera camera;                             ///< of the depth image or the organised cloud's grid
    cv::Mat3b colour;                          ///< BGR, may be empty
    cv::Mat3w deep_colour = {};                ///< `colour` with 16 bits, where its file has them
    std::optional<ColourCamera> colour_camera; ///< where `colour` was taken, if it is known and not the depth camera's
    cv::Mat1f depth_m; ///< recorded (distorted geometry) depth, corrected, metres along +z; 0 = hole
    std::optional<Cloud> cloud;
    std::optional<Eigen::Isometry3d> world_from_camera;
    Registration registration = Registration::unknown;
    std::vector<std::string> warnings; ///< what was unusual and how it was handled; complete sentences
    Findings findings;                 ///< of what was read
};

} // namespace scanshade
