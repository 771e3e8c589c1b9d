// The residuals of a recording's tracks, depths and poses, put together.
#include "projection/calibration/recording/sequence_adjustment.h"

#include "projection/calibration/recording/residuals.h"

namespace scanshade::calibration {

void SequenceProblem::add(std::size_t track, const Sequence::Sighting& s, ceres::LossFunction* loss) {
    const double weight = sequence_.weights_[s.frame];
    const auto [motion, later_s] = motion_of(s.frame);
    const LensModel lens = fit_.model.lens;
    double* camera = fit_.model.values.data();
    if (sequence_.options_.registered)
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<SightingResidual, 2, camera_unknowns, 1, pose_unknowns, point_unknowns>(
                new SightingResidual{lens, s.pixel, motion, later_s, weight}),
            loss, camera, clock(), pose(s.frame), point(track));
    else if (!sequence_.options_.refine_poses)
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<PosedSightingResidual, 2, camera_unknowns, place_unknowns, 1,
                                            point_unknowns>(
                new PosedSightingResidual{lens, s.pixel, motion, later_s, weight, from_six(pose(s.frame))}),
            loss, camera, place(), clock(), point(track));
    else
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PlacedSightingResidual, 2, camera_unknowns,
                                                                 place_unknowns, 1, pose_unknowns, point_unknowns>(
                                     new PlacedSightingResidual{lens, s.pixel, motion, later_s, weight}),
                                 loss, camera, place(), clock(), pose(s.frame), point(track));
    sightings.push_back(problem.NumResidualBlocks() - 1);
    add_depth(track, s, loss);
}

void SequenceProblem::add_outlines(int frame, bool robust) {
    if (sequence_.pairs_.empty())
        return;
    const auto [motion, later_s] = motion_of(frame);
    const double weight =
        outline_share * sequence_.weights_[frame] * sequence_.options_.pixel_sigma_px / sequence_.outline_sigma_px_;
    const Eigen::Isometry3d world_from_depth = from_six(pose(frame)).inverse();
    for (const OutlinePair& pair : sequence_.pairs_[frame]) {
        const ceres::ResidualBlockId block = problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<OutlineResidual, 1, camera_unknowns, place_unknowns, 1, 1>(
                new OutlineResidual{fit_.model.lens, pair.point.in_depth, pair.point.one_px_beyond, pair.on_edge,
                                    pair.across, motion, later_s, weight}),
            robust ? new ceres::CauchyLoss(weight * sequence_.outline_sigma_px_) : nullptr, fit_.model.values.data(),
            place(), clock(), gap());
        outlines.emplace_back(block, world_from_depth * pair.point.in_depth);
    }
}

void SequenceProblem::hold_place(const Model& first) {
    constexpr double shift_sigma_m = 0.03, turn_sigma = 0.1;
    if (!problem.HasParameterBlock(place()))
        return;
    const Eigen::Isometry3d there = from_six(first.values.data() + turn_x);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PoseResidual, 6, place_unknowns>(new PoseResidual{
            Eigen::Quaterniond(there.linear()).normalized(), there.inverse().translation(),
            sequence_.options_.pixel_sigma_px / turn_sigma, sequence_.options_.pixel_sigma_px / shift_sigma_m}),
        nullptr, place());
}

void SequenceProblem::hold_gap() {
    constexpr double sigma_px = 0.5;
    if (problem.HasParameterBlock(gap()))
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ExpectedResidual, 1, 1>(new ExpectedResidual{
                                     expected_gap_px, sequence_.options_.pixel_sigma_px / sigma_px}),
                                 nullptr, gap());
}

/// Where poses are refined they are those at which colour was taken, and what the camera did around them is left out.
std::pair<Motion, double> SequenceProblem::motion_of(int frame) const {
    const SequenceFrame& part = sequence_.frames_[frame];
    return sequence_.options_.refine_poses ? std::pair(Motion(), 0.0) : std::pair(part.motion, part.colour_later_s);
}

void SequenceProblem::add_depth(std::size_t track, const Sequence::Sighting& s, ceres::LossFunction* loss) {
    const int before = problem.NumResidualBlocks();
    if (sequence_.options_.registered && s.depth_m > 0)
        add_recorded_depth(track, s, loss);
    else if (s.surface)
        add_surface(track, s, loss);
    if (problem.NumResidualBlocks() > before)
        depths.push_back(before);
}

void SequenceProblem::add_recorded_depth(std::size_t track, const Sequence::Sighting& s, ceres::LossFunction* loss) {
    const double weight = sequence_.weights_[s.frame] * depth_weight(s.depth_m);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<DepthResidual, 1, depth_unknowns, 1, pose_unknowns, point_unknowns>(
            new DepthResidual{s.depth_m, motion_of(s.frame).first, weight}),
        loss, fit_.model.values.data() + depth_scale, clock(), pose(s.frame), point(track));
}

void SequenceProblem::add_surface(std::size_t track, const Sequence::Sighting& s, ceres::LossFunction* loss) {
    const double weight = sequence_.weights_[s.frame] * depth_weight(s.surface->centre.z());
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SurfaceResidual, 1, pose_unknowns, point_unknowns>(
                                 new SurfaceResidual{s.surface->centre, s.surface->normal, weight}),
                             loss, pose(s.frame), point(track));
}

double SequenceProblem::depth_weight(double z_m) const {
    const SequenceOptions& o = sequence_.options_;
    return sequence_.depth_weight_ * o.pixel_sigma_px / (o.depth_floor_m + o.depth_per_z2 * z_m * z_m);
}

void SequenceProblem::hold_poses(const Views& used) {
    bool first = true;
    for (std::size_t i = 0; i < used.size(); ++i) {
        if (!problem.HasParameterBlock(pose(static_cast<int>(i))))
            continue;
        if (!sequence_.options_.refine_poses || (first && !sequence_.frames_[i].world_from_camera))
            problem.SetParameterBlockConstant(pose(static_cast<int>(i)));
        else
            hold_near_recorded(static_cast<int>(i));
        first = false;
    }
}

void SequenceProblem::hold_near_recorded(int frame) {
    const auto& recorded = sequence_.frames_[frame].world_from_camera;
    if (!recorded)
        return;
    const SequenceOptions& o = sequence_.options_;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PoseResidual, 6, pose_unknowns>(new PoseResidual{
                                 Eigen::Quaterniond(recorded->linear()).inverse().normalized(), recorded->translation(),
                                 o.pixel_sigma_px / o.pose_turn_sigma, o.pixel_sigma_px / o.pose_shift_sigma_m}),
                             nullptr, pose(frame));
}

} // namespace scanshade::calibration
