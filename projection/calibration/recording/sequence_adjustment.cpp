// Builds the residuals of tracks, depths, outlines and poses.
#include "projection/calibration/recording/sequence_adjustment.h"

#include "projection/calibration/recording/residuals.h"

namespace scanshade::calibration {

void SequenceAdjustment::add(std::size_t index, const PointObservation& s, ceres::LossFunction* loss) {
    const double weight = sequence_.weights[s.frame];
    const auto [motion, later_s] = motion_of(s.frame);
    const LensModel lens = fit_.model.lens;
    double* camera = fit_.model.values.data();
    if (sequence_.options.registered)
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<ObservationResidual, 2, camera_unknowns, 1, pose_unknowns, point_unknowns>(
                new ObservationResidual{lens, s.pixel, motion, later_s, weight}),
            loss, camera, clock(), pose(s.frame), point(index));
    else if (!sequence_.options.refine_poses)
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<FixedPoseObservationResidual, 2, camera_unknowns, extrinsic_unknowns, 1,
                                            point_unknowns>(new FixedPoseObservationResidual{
                lens, s.pixel, motion, later_s, weight, pose_from_parameters(pose(s.frame))}),
            loss, camera, extrinsics(), clock(), point(index));
    else
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SecondaryObservationResidual, 2, camera_unknowns,
                                                                 extrinsic_unknowns, 1, pose_unknowns, point_unknowns>(
                                     new SecondaryObservationResidual{lens, s.pixel, motion, later_s, weight}),
                                 loss, camera, extrinsics(), clock(), pose(s.frame), point(index));
    pixels.push_back(problem.NumResidualBlocks() - 1);
    add_depth(index, s, loss);
}

void SequenceAdjustment::add_outlines(int frame, bool robust) {
    if (sequence_.pairs.empty())
        return;
    const auto [motion, later_s] = motion_of(frame);
    const double weight =
        outline_share * sequence_.weights[frame] * sequence_.options.pixel_sigma_px / sequence_.outline_sigma_px;
    const Eigen::Isometry3d world_from_depth = pose_from_parameters(pose(frame)).inverse();
    for (const OutlinePair& pair : sequence_.pairs[frame]) {
        const ceres::ResidualBlockId block = problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<OutlineResidual, 1, camera_unknowns, extrinsic_unknowns, 1, 1>(
                new OutlineResidual{fit_.model.lens, pair.point.in_depth, pair.point.one_px_beyond, pair.on_edge,
                                    pair.across, motion, later_s, weight}),
            robust ? new ceres::CauchyLoss(weight * sequence_.outline_sigma_px) : nullptr, fit_.model.values.data(),
            extrinsics(), clock(), gap());
        outlines.emplace_back(block, world_from_depth * pair.point.in_depth);
    }
}

void SequenceAdjustment::add_extrinsics_prior(const Model& first) {
    constexpr double translation_sigma_m = 0.03, rotation_sigma = 0.1;
    if (!problem.HasParameterBlock(extrinsics()))
        return;
    const Eigen::Isometry3d expected = pose_from_parameters(first.values.data() + rotation_x);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PosePriorResidual, 6, extrinsic_unknowns>(new PosePriorResidual{
            Eigen::Quaterniond(expected.linear()).normalized(), expected.inverse().translation(),
            sequence_.options.pixel_sigma_px / rotation_sigma, sequence_.options.pixel_sigma_px / translation_sigma_m}),
        nullptr, extrinsics());
}

void SequenceAdjustment::add_gap_prior() {
    constexpr double sigma_px = 0.5;
    if (problem.HasParameterBlock(gap()))
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorResidual, 1, 1>(
                                     new PriorResidual{expected_gap_px, sequence_.options.pixel_sigma_px / sigma_px}),
                                 nullptr, gap());
}

/// Refined poses are those at the time of the colour image, so the motion around them does not count.
std::pair<Motion, double> SequenceAdjustment::motion_of(int frame) const {
    const SequenceFrame& part = sequence_.frames[frame];
    return sequence_.options.refine_poses ? std::pair(Motion(), 0.0) : std::pair(part.motion, part.colour_later_s);
}

void SequenceAdjustment::add_depth(std::size_t index, const PointObservation& s, ceres::LossFunction* loss) {
    const int before = problem.NumResidualBlocks();
    if (sequence_.options.registered && s.depth_m > 0)
        add_recorded_depth(index, s, loss);
    else if (s.surface)
        add_surface(index, s, loss);
    if (problem.NumResidualBlocks() > before)
        depths.push_back(before);
}

void SequenceAdjustment::add_recorded_depth(std::size_t index, const PointObservation& s, ceres::LossFunction* loss) {
    const double weight = sequence_.weights[s.frame] * depth_weight(s.depth_m);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<DepthResidual, 1, depth_unknowns, 1, pose_unknowns, point_unknowns>(
            new DepthResidual{s.depth_m, motion_of(s.frame).first, weight}),
        loss, fit_.model.values.data() + depth_scale, clock(), pose(s.frame), point(index));
}

void SequenceAdjustment::add_surface(std::size_t index, const PointObservation& s, ceres::LossFunction* loss) {
    const double weight = sequence_.weights[s.frame] * depth_weight(s.surface->centre.z());
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SurfaceResidual, 1, pose_unknowns, point_unknowns>(
                                 new SurfaceResidual{s.surface->centre, s.surface->normal, weight}),
                             loss, pose(s.frame), point(index));
}

double SequenceAdjustment::depth_weight(double z_m) const {
    const SequenceOptions& o = sequence_.options;
    return sequence_.depth_weight * o.pixel_sigma_px / (o.depth_floor_m + o.depth_per_z2 * z_m * z_m);
}

void SequenceAdjustment::add_pose_priors(const Views& used) {
    bool first = true;
    for (std::size_t i = 0; i < used.size(); ++i) {
        if (!problem.HasParameterBlock(pose(static_cast<int>(i))))
            continue;
        if (!sequence_.options.refine_poses || (first && !sequence_.frames[i].world_from_camera))
            problem.SetParameterBlockConstant(pose(static_cast<int>(i)));
        else
            add_pose_prior(static_cast<int>(i));
        first = false;
    }
}

void SequenceAdjustment::add_pose_prior(int frame) {
    const auto& recorded = sequence_.frames[frame].world_from_camera;
    if (!recorded)
        return;
    const SequenceOptions& o = sequence_.options;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<PosePriorResidual, 6, pose_unknowns>(new PosePriorResidual{
            Eigen::Quaterniond(recorded->linear()).inverse().normalized(), recorded->translation(),
            o.pixel_sigma_px / o.pose_rotation_sigma, o.pixel_sigma_px / o.pose_translation_sigma_m}),
        nullptr, pose(frame));
}

} // namespace scanshade::calibration
