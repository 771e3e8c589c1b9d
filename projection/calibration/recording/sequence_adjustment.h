// One adjustment of a recording: which residuals there are, and whose they are.
#pragma once

#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/recording/sequence.h"
#include "projection/calibration/solve.h"

#include <utility>

namespace scanshade::calibration {

/// Residuals on the numbers of a Fit, which must outlive it.
class SequenceProblem {
  public:
    SequenceProblem(const Sequence& sequence, Fit& fit) : sequence_(sequence), fit_(fit) {}

    [[nodiscard]] double* pose(int frame) { return &fit_.nuisance[static_cast<std::size_t>(frame) * pose_unknowns]; }
    [[nodiscard]] double* point(std::size_t index) {
        return &fit_.nuisance[sequence_.frames_.size() * pose_unknowns + index * point_unknowns];
    }

    /// How far beyond its last point a surface ends, pixels of the depth image.
    [[nodiscard]] double* gap() { return &fit_.nuisance.back(); }

    /// Where a track was seen, and the depth there.
    void add(std::size_t track, const Sequence::Sighting& sighting, ceres::LossFunction* loss = nullptr);
    /// The outlines of a frame, each on its colour edge; robustly with Cauchy's loss, one sigma wide.
    void add_outlines(int frame, bool robust = false);
    /// Neighbours on one outline err together, so that each counts a sixteenth of what it would alone: the root of
    /// that.
    static constexpr double outline_share = 0.25;
    /// Half a pixel, and what frays off is not much more.
    void hold_gap();
    /// Keeps poses near the recorded ones, or at them; without any, the first says where the world is.
    void hold_poses(const Views& used);
    void hold_near_recorded(int frame);
    /// Both cameras are in one housing: within centimetres of where the colour camera is thought to be.
    void hold_place(const Model& first);

    ceres::Problem problem;
    std::vector<int> sightings, depths;                                       ///< residual blocks of either kind
    std::vector<std::pair<ceres::ResidualBlockId, Eigen::Vector3d>> outlines; ///< and where in the world

  private:
    [[nodiscard]] double* place() { return fit_.model.values.data() + turn_x; }
    [[nodiscard]] double* clock() { return fit_.model.values.data() + time_offset; }
    [[nodiscard]] std::pair<Motion, double> motion_of(int frame) const;
    /// Sigma of a recorded depth, in the residuals' unit.
    [[nodiscard]] double depth_weight(double z_m) const;
    void add_depth(std::size_t track, const Sequence::Sighting& sighting, ceres::LossFunction* loss);
    void add_recorded_depth(std::size_t track, const Sequence::Sighting& sighting, ceres::LossFunction* loss);
    void add_surface(std::size_t track, const Sequence::Sighting& sighting, ceres::LossFunction* loss);

    const Sequence& sequence_;
    Fit& fit_;
};

} // namespace scanshade::calibration
