// A recorded RGB-D sequence as a problem: bundle adjustment of tracks, depths, poses and the camera.
#pragma once

#include "projection/calibration/recording/sequence_observations.h"

namespace scanshade::calibration {

class SequenceAdjustment;

/// Registered: one camera takes colour and depth. A track's point must project onto its observations, and lie at the
/// depth recorded there. Unregistered: the model is the colour camera and its extrinsics; `depth_camera` stays as it
/// is. The point must lie on the surface that the depth camera recorded, and outlines of near objects on edges of the
/// colour image.
class Sequence final : public Problem {
  public:
    /// As observe_sequence(): finds tracks and missing poses, removes outliers. Throws Error where too few points
    /// agree.
    Sequence(std::vector<SequenceFrame> frames, const Camera& depth_camera, const Model& first,
             const SequenceOptions& options);

    [[nodiscard]] std::size_t views() const override { return observations_.frames.size(); }
    [[nodiscard]] std::string view_name(std::size_t view) const override { return observations_.frames[view].name; }
    void set_weights(const std::vector<double>& weights) override { observations_.weights = weights; }
    [[nodiscard]] Fit start(const Model& model) const override;
    [[nodiscard]] Fit fit(const Fit& from, const Free& free, const Views& used, bool covariance) const override;
    [[nodiscard]] std::vector<ViewScore> score(const Fit& fit, const Views& wanted) const override;
    [[nodiscard]] std::vector<cv::Point2d> pixels_of(std::size_t view) const override;
    [[nodiscard]] std::vector<Eigen::Vector2d> residuals(const Fit& fit, std::size_t view) const override;
    [[nodiscard]] std::vector<double> depths_m(const Fit& fit) const override;

    /// Poses of the depth camera under a fit, world_from_camera.
    [[nodiscard]] std::vector<Eigen::Isometry3d> poses(const Fit& fit) const;
    /// How far beyond its last point a surface ends, pixels of the depth image.
    [[nodiscard]] static double gap_px(const Fit& fit) { return fit.nuisance.back(); }
    [[nodiscard]] std::size_t outline_points() const;
    /// Whether a time offset can be estimated, see SequenceObservations.
    [[nodiscard]] bool determines_time() const { return observations_.determines_time(); }
    [[nodiscard]] std::size_t points() const { return observations_.points.size(); }
    [[nodiscard]] std::size_t observations() const;
    /// Why these frames cannot determine a camera: too few, pure forward motion, hardly any motion. Empty = they may.
    [[nodiscard]] std::string degeneracy(const Fit& fit) const;
    [[nodiscard]] std::vector<cv::Mat1f> depth_images() const;

  private:
    /// Whether views outside `used` can be judged by the point. Two rays a hand apart do not tell how far away it is:
    /// a recorded depth must.
    [[nodiscard]] bool is_known(const ScenePoint& point, const Views& used) const;
    void add_covariance(SequenceAdjustment& adjustment, Fit& fit, const Free& free) const;

    SequenceObservations observations_;
};

} // namespace scanshade::calibration
