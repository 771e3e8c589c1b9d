// One bundle adjustment of a recorded sequence: which residuals there are, and on which numbers.
#pragma once

#include "projection/calibration/recording/sequence_observations.h"
#include "projection/calibration/solve.h"

#include <utility>

namespace scanshade::calibration {

/// Residuals on the numbers of a Fit, which must outlive it.
class SequenceAdjustment {
  public:
    SequenceAdjustment(const SequenceObservations& sequence, Fit& fit) : sequence_(sequence), fit_(fit) {}

    [[nodiscard]] double* pose(int frame) { return &fit_.nuisance[static_cast<std::size_t>(frame) * pose_unknowns]; }
    [[nodiscard]] double* point(std::size_t index) { return &fit_.nuisance[point_offset(sequence_, index)]; }
    /// How far beyond its last point a surface ends, pixels of the depth image.
    [[nodiscard]] double* gap() { return &fit_.nuisance.back(); }

    /// The pixel at which a point was observed, and the depth there.
    void add(std::size_t point, const PointObservation& observation, ceres::LossFunction* loss = nullptr);
    /// The outlines of a frame, each on its colour edge; `robust` uses Cauchy's loss, one sigma wide.
    void add_outlines(int frame, bool robust = false);
    /// Neighbours on one outline have correlated errors, so each counts a sixteenth: this factor squared.
    static constexpr double outline_share = 0.25;
    /// Expects the gap near half a pixel.
    void add_gap_prior();
    /// Keeps poses near the recorded ones, or fixes them. Without recorded poses, the first frame defines the world.
    void add_pose_priors(const Views& used);
    void add_pose_prior(int frame);
    /// Both cameras share a housing: keeps the extrinsics within centimetres of `first`.
    void add_extrinsics_prior(const Model& first);

    ceres::Problem problem;
    std::vector<int> pixels, depths;                                          ///< residual blocks of either kind
    std::vector<std::pair<ceres::ResidualBlockId, Eigen::Vector3d>> outlines; ///< and their points in the world

  private:
    [[nodiscard]] double* extrinsics() { return fit_.model.values.data() + rotation_x; }
    [[nodiscard]] double* clock() { return fit_.model.values.data() + time_offset; }
    [[nodiscard]] std::pair<Motion, double> motion_of(int frame) const;
    /// From metres of depth to the residuals' unit.
    [[nodiscard]] double depth_weight(double z_m) const;
    void add_depth(std::size_t point, const PointObservation& observation, ceres::LossFunction* loss);
    void add_recorded_depth(std::size_t point, const PointObservation& observation, ceres::LossFunction* loss);
    void add_surface(std::size_t point, const PointObservation& observation, ceres::LossFunction* loss);

    const SequenceObservations& sequence_;
    Fit& fit_;
};

} // namespace scanshade::calibration
