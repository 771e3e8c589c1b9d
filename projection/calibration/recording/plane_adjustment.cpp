// Builds the residuals of cells and poses.
#include "projection/calibration/recording/plane_adjustment.h"

#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/recording/residuals.h"

#include <algorithm>

namespace scanshade::calibration {

void PlaneAdjustment::add(std::size_t index, const PlaneCell& cell, bool plane_is_known, ceres::LossFunction* loss) {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PlaneResidual, 1, camera_unknowns, depth_unknowns,
                                                             pose_unknowns, point_unknowns>(new PlaneResidual{
                                 fit_.model.lens, cell.pixel, cell.depth_m, observations_.planes[index].anchor,
                                 cell.weight * observations_.weights[cell.frame]}),
                             loss, fit_.model.values.data(), fit_.model.values.data() + depth_scale, pose(cell.frame),
                             plane(index));
    if (plane_is_known)
        problem.SetParameterBlockConstant(plane(index));
}

void PlaneAdjustment::add_pose_priors() {
    constexpr double translation_sigma_m = 0.005, rotation_sigma = 0.0035; // a good tracker's, as in SequenceOptions
    // Beside exact depth these priors would weigh next to nothing, and hundreds of steps would go into motions of poses
    // and planes together, on which the camera does not depend. As if depth were good to a millimetre they still move a
    // pose by micrometres only.
    constexpr double exact_mm = 1;
    const double sigma_mm = std::max(exact_mm, observations_.sigma_mm);
    for (std::size_t i = 0; i < observations_.frames.size(); ++i) {
        double* numbers = pose(static_cast<int>(i));
        if (!problem.HasParameterBlock(numbers))
            continue;
        if (!observations_.linked) {
            problem.SetParameterBlockConstant(numbers);
            continue;
        }
        // PosePriorResidual takes camera_from_world; here the pose is its inverse, so both are inverted.
        const Eigen::Isometry3d camera_from_world = observations_.frames[i].world_from_camera->inverse();
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<PosePriorResidual, 6, pose_unknowns>(new PosePriorResidual{
                Eigen::Quaterniond(camera_from_world.linear()).inverse().normalized(), camera_from_world.translation(),
                sigma_mm / rotation_sigma, sigma_mm / translation_sigma_m}),
            nullptr, numbers);
    }
}

void PlaneAdjustment::add_covariance(const Free& free) {
    std::vector<double*> poses;
    Clusters planes;
    for (std::size_t i = 0; i < observations_.frames.size(); ++i)
        poses.push_back(pose(static_cast<int>(i)));
    for (std::size_t i = 0; i < observations_.planes.size(); ++i)
        planes.points.push_back({plane(i), static_cast<int>(i)});
    calibration::add_covariance(problem, fit_, free, poses, {planes});
}

} // namespace scanshade::calibration
