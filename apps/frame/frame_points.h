// The points of a computed frame with their values, as clouds in files and messages hold them.
#pragma once

#include "apps/frame/frame_images.h"

#include <Eigen/Core>
#include <span>
#include <vector>

namespace scanshade {

/// A value per point in each list; empty lists are not there. Moved only, since `points` may show `made`.
struct FramePoints {
    FramePoints() = default;
    FramePoints(const FramePoints&) = delete;
    FramePoints& operator=(const FramePoints&) = delete;
    FramePoints(FramePoints&&) = default;
    FramePoints& operator=(FramePoints&&) = default;

    std::span<const Eigen::Vector3d> points;
    std::vector<cv::Vec3b> colours;    ///< BGR, as Outputs::colour_cloud asks
    std::vector<float> visibility;     ///< NaN where it is not known
    std::vector<float> confidence;     ///< 0 where it is not known
    std::vector<float> error;          ///< expected, NaN where it is not known; only where asked for
    std::vector<float> colour_known;   ///< of a secondary camera: 1, or 0 where it did not see the point
    std::vector<Eigen::Vector3d> made; ///< from depth
};

/// A depth frame's surface in camera space and the recording's unit, without lens distortion, coloured where the colour
/// fits. Points that the secondary camera did not see are black. `shown` is the frame's scene.
[[nodiscard]] FramePoints points_of_depth(const Work& work, const Scene& shown, const Outputs& outputs);
/// A cloud's points, all of them, in file order. The colours are the cloud's own, changed as `outputs` asks.
[[nodiscard]] FramePoints points_of_cloud(const Work& work, const Outputs& outputs);

/// The colours of a written cloud; empty = none, or as they were.
[[nodiscard]] std::vector<cv::Vec3b> cloud_colours(const std::vector<cv::Vec3b>& own,
                                                   const std::vector<float>& visibility, const Outputs& outputs);

/// The image without lens distortion. Zero where the camera saw nothing.
[[nodiscard]] cv::Mat3b undistorted_image(const cv::Mat3b& image, const Camera& camera);
[[nodiscard]] cv::Mat1b undistorted_image(const cv::Mat1b& image, const Camera& camera);

} // namespace scanshade
