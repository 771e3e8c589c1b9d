// Converts poses and pixels, and fits planes to recorded depth.
#include "projection/calibration/recording/geometry.h"

#include "projection/undistort.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <vector>

namespace scanshade::calibration {

void to_pose_parameters(const Eigen::Isometry3d& transform, double* pose) {
    const Eigen::AngleAxisd rotation(transform.linear());
    const Eigen::Vector3d axis_times_angle = rotation.angle() * rotation.axis();
    std::copy_n(axis_times_angle.data(), 3, pose);
    std::copy_n(transform.translation().data(), 3, pose + 3);
}

Eigen::Isometry3d pose_from_parameters(const double* pose) {
    const Eigen::Map<const Eigen::Vector3d> rotation(pose), translation(pose + 3);
    Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
    if (rotation.norm() > 0)
        transform.linear() = Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
    transform.translation() = translation;
    return transform;
}

double depth_at(const cv::Mat1f& depth_m, const Eigen::Vector2d& pixel) {
    constexpr double same_surface = 0.02; // of the depth, over two pixels
    const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
    if (u < 1 || v < 1 || u + 1 >= depth_m.cols || v + 1 >= depth_m.rows)
        return 0;
    double low = 1e9, high = 0, sum = 0, along_u = 0, along_v = 0; // of 1 / z, which is linear on a plane
    for (int dv = -1; dv <= 1; ++dv)
        for (int du = -1; du <= 1; ++du) {
            const double z = depth_m(v + dv, u + du);
            low = std::min(low, z);
            high = std::max(high, z);
            sum += 1 / z;
            along_u += du / z;
            along_v += dv / z;
        }
    if (!(low > 0 && high - low < same_surface * low))
        return 0;
    return 1 / (sum / 9 + (pixel.x() - u) * along_u / 6 + (pixel.y() - v) * along_v / 6);
}

Eigen::Vector2d undistorted_direction(const Camera& camera, const Eigen::Vector2d& pixel) {
    const Eigen::Vector2d distorted = camera.pinhole.ray(pixel.x(), pixel.y()).head<2>();
    return undistorted(camera.distortion, distorted).value_or(distorted);
}

Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& pixel) {
    return undistorted_direction(camera, pixel).homogeneous();
}

std::optional<SurfacePiece> surface_at(const cv::Mat1f& depth_m, const Pinhole& camera, const Eigen::Vector3d& point) {
    constexpr int reach = 3;
    constexpr double same_surface_m = 0.03;
    if (point.z() <= 0.1)
        return std::nullopt;
    const Eigen::Vector2d pixel = camera.pixel(point);
    const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
    if (u < reach || v < reach || u + reach >= depth_m.cols || v + reach >= depth_m.rows)
        return std::nullopt;
    const double middle = depth_m(v, u);
    std::vector<Eigen::Vector3d> points;
    for (int dv = -reach; dv <= reach; ++dv)
        for (int du = -reach; du <= reach; ++du) {
            const double z = depth_m(v + dv, u + du);
            if (!(z > 0) || std::abs(z - middle) > same_surface_m * middle)
                return std::nullopt;
            points.push_back(camera.point(u + du, v + dv, z));
        }
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const auto& p : points)
        centre += p / static_cast<double>(points.size());
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (const auto& p : points)
        moments += (p - centre) * (p - centre).transpose();
    return SurfacePiece{centre, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors().col(0)};
}

} // namespace scanshade::calibration
