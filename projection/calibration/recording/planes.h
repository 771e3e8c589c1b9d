// Depth alone as a problem: planes must stay planes, and the same ones in all frames.
#pragma once

#include "projection/calibration/problem.h"
#include "projection/calibration/recording/plane_cells.h"

namespace scanshade::calibration {

/// Depth images are cut into cells. Smooth cells are grouped into planes within a frame. Where all frames have poses,
/// planes are joined across frames. A cell's centre, lifted by camera and depth correction, must lie on its plane.
///
/// What that determines: a plane has 1/z linear in the image, whatever the focal length, the principal point and the
/// scale of depth. Planes in a single view therefore determine only lens distortion, depth offset and depth curve.
/// Focal length and scale need one plane in several views, with a known motion between them.
class Planes final : public Problem {
  public:
    /// Finds the planes under the first model, and removes outlying cells. Throws Error where hardly anything in the
    /// frames is plane.
    Planes(const std::vector<PlaneFrame>& frames, const Model& first);

    void set_weights(const std::vector<double>& weights) override { observations_.weights = weights; }
    [[nodiscard]] std::string_view unit() const override { return "mm"; }
    [[nodiscard]] std::size_t views() const override { return observations_.frames.size(); }
    [[nodiscard]] std::string view_name(std::size_t view) const override { return observations_.frames[view].name; }
    [[nodiscard]] Fit start(const Model& model) const override;
    [[nodiscard]] Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const override;
    [[nodiscard]] std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const override;
    [[nodiscard]] std::vector<cv::Point2d> pixels_of(std::size_t view) const override;
    [[nodiscard]] std::vector<Eigen::Vector2d> residuals(const Fit&, std::size_t) const override { return {}; }
    [[nodiscard]] std::vector<double> depths_m(const Fit& fit) const override;

    /// Whether all frames have poses, so that planes are the same ones across frames.
    [[nodiscard]] bool linked() const { return observations_.linked; }
    /// Only the groups that planes can determine, in each order to be tried. A wrong focal length looks much like a
    /// wrong depth scale, and the one that is freed first absorbs the other. The order with less held-out error is
    /// right.
    [[nodiscard]] std::vector<std::vector<ParameterGroup>> group_orders() const;
    /// Why these frames cannot determine anything: too few planes, one direction, hardly any motion. Empty = they may.
    [[nodiscard]] std::string degeneracy() const;
    [[nodiscard]] std::string summary() const;
    [[nodiscard]] std::vector<cv::Mat1f> depth_images() const;
    /// As recorded; linked() only.
    [[nodiscard]] std::vector<Eigen::Isometry3d> poses() const;

  private:
    Model prune(const Model& first);

    PlaneObservations observations_;
};

} // namespace scanshade::calibration
