// The residuals of cells and poses, put together.
#include "projection/calibration/recording/plane_adjustment.h"

#include "projection/calibration/recording/residuals.h"

namespace scanshade::calibration {

void Planes::Problem::add(std::size_t index, const Cell& cell, bool plane_is_known, ceres::LossFunction* loss) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PlaneResidual, 1, camera_unknowns, depth_unknowns,
                                                             pose_unknowns, point_unknowns>(new PlaneResidual{
                                 fit_.model.lens, cell.pixel, cell.depth_m, planes_.planes_[index].anchor,
                                 cell.weight * planes_.weights_[cell.frame]}),
                             loss, fit_.model.values.data(), fit_.model.values.data() + depth_scale, pose(cell.frame),
                             plane(index));
    if (plane_is_known)
        problem.SetParameterBlockConstant(plane(index));
}

void Planes::Problem::hold_poses() {
    constexpr double shift_sigma_m = 0.005, turn_sigma = 0.0035; // a good tracker's, as in SequenceOptions
    for (std::size_t i = 0; i < planes_.frames_.size(); ++i) {
        double* six = pose(static_cast<int>(i));
        if (!problem.HasParameterBlock(six))
            continue;
        if (!planes_.linked_) {
            problem.SetParameterBlockConstant(six);
            continue;
        }
        // The pose is camera to world here, and PoseResidual speaks of the way back: of the inverse it holds the same.
        const Eigen::Isometry3d back = planes_.frames_[i].world_from_camera->inverse();
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PoseResidual, 6, pose_unknowns>(new PoseResidual{
                                     Eigen::Quaterniond(back.linear()).inverse().normalized(), back.translation(),
                                     planes_.sigma_mm_ / turn_sigma, planes_.sigma_mm_ / shift_sigma_m}),
                                 nullptr, six);
    }
}

void Planes::Problem::add_covariance(const Free& free) {
    std::vector<double*> poses;
    Clusters planes;
    for (std::size_t i = 0; i < planes_.frames_.size(); ++i)
        poses.push_back(pose(static_cast<int>(i)));
    for (std::size_t i = 0; i < planes_.planes_.size(); ++i)
        planes.points.push_back({plane(i), static_cast<int>(i)});
    calibration::add_covariance(problem, fit_, free, poses, planes);
}

} // namespace scanshade::calibration
