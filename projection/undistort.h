// Lens distortion, removed and applied: for single points, and as maps for whole images.
#pragma once

#include "projection/camera.h"

#include <Eigen/Core>
#include <memory>
#include <optional>

namespace scanshade {

/// Normalised coordinates bent by the lens (see distort()).
[[nodiscard]] Eigen::Vector2d distorted(const Distortion& distortion, const Eigen::Vector2d& straight);

/// Squared radius (x^2 + y^2 of straight coordinates) at which the lens model stops growing and folds back on itself;
/// infinity where it never does. A rational lens ends at its denominator's first zero, too. A fisheye ends just under
/// 90 degrees, where a pinhole does.
[[nodiscard]] double fold_r2(const Distortion& distortion);

/// The reverse, by Newton's method to 1e-10 (under 1e-6 px at any focal length in use). None where it does not converge
/// or where the lens folds back (fold_r2), so that two directions share one pixel.
[[nodiscard]] std::optional<Eigen::Vector2d> undistorted(const Distortion& distortion, const Eigen::Vector2d& bent);

/// The mapping between pixels of the recorded and the undistorted image. The undistorted image has the recorded one's
/// focal lengths. It is widened on each side to show the whole recorded image, by half the image's length at most.
/// Immutable: frames and threads share it.
class Undistortion {
  public:
    explicit Undistortion(const Camera& camera);

    /// Cached for the few cameras used last; safe from several threads.
    [[nodiscard]] static std::shared_ptr<const Undistortion> of(const Camera& camera);

    /// The undistorted image's camera.
    [[nodiscard]] const Pinhole& straight_camera() const { return straight_camera_; }
    /// For each undistorted pixel the index (row-major) of the recorded pixel; -1 where the lens saw nothing.
    [[nodiscard]] const cv::Mat1i& recorded_pixel() const { return recorded_pixel_; }
    /// For each undistorted pixel the position (column, row) of its centre in the recorded image; NaN where the lens
    /// saw nothing.
    [[nodiscard]] const cv::Mat2f& recorded_at() const { return recorded_at_; }
    /// For each recorded pixel the index of the undistorted pixel that shows it, or is nearest to it; -1 outside the
    /// image.
    [[nodiscard]] const cv::Mat1i& undistorted_pixel() const { return undistorted_pixel_; }
    /// For each recorded pixel its ray as x and y at z = 1; NaN where the lens has none.
    [[nodiscard]] const cv::Mat2f& direction() const { return direction_; }

  private:
    cv::Mat2f direction_, recorded_at_;
    Pinhole straight_camera_;
    cv::Mat1i recorded_pixel_, undistorted_pixel_;
};

} // namespace scanshade
