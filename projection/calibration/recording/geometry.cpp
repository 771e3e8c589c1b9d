// Poses, rays and pieces of surface of a recording's frames.
#include "projection/calibration/recording/geometry.h"

#include "projection/undistort.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <limits>

namespace scanshade::calibration {

void to_six(const Eigen::Isometry3d& transform, double* six) {
    const Eigen::AngleAxisd turn(transform.linear());
    const Eigen::Vector3d axis_times_angle = turn.angle() * turn.axis();
    std::copy_n(axis_times_angle.data(), 3, six);
    std::copy_n(transform.translation().data(), 3, six + 3);
}

Eigen::Isometry3d from_six(const double* six) {
    const Eigen::Map<const Eigen::Vector3d> turn(six), shift(six + 3);
    Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
    if (turn.norm() > 0)
        transform.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    transform.translation() = shift;
    return transform;
}

double depth_at(const cv::Mat1f& depth_m, const Eigen::Vector2d& pixel) {
    constexpr double same_surface = 0.02; // of the depth, over two pixels
    const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
    if (u < 1 || v < 1 || u + 1 >= depth_m.cols || v + 1 >= depth_m.rows)
        return 0;
    double low = 1e9, high = 0, sum = 0;
    for (int dv = -1; dv <= 1; ++dv)
        for (int du = -1; du <= 1; ++du) {
            const double z = depth_m(v + dv, u + du);
            low = std::min(low, z);
            high = std::max(high, z);
            sum += z;
        }
    return low > 0 && high - low < same_surface * low ? sum / 9 : 0;
}

Eigen::Vector2d straight_of(const Camera& camera, const Eigen::Vector2d& pixel) {
    const Pinhole& p = camera.pinhole;
    const Eigen::Vector2d bent((pixel.x() - p.cx) / p.fx, (pixel.y() - p.cy) / p.fy);
    return undistorted(camera.distortion, bent).value_or(bent);
}

Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& pixel) {
    return straight_of(camera, pixel).homogeneous();
}

std::optional<SurfacePiece> surface_at(const cv::Mat1f& depth_m, const Pinhole& camera, const Eigen::Vector3d& point) {
    constexpr int reach = 3;
    constexpr double same_surface_m = 0.03;
    if (point.z() <= 0.1)
        return std::nullopt;
    const int u = static_cast<int>(std::lround(camera.fx * point.x() / point.z() + camera.cx));
    const int v = static_cast<int>(std::lround(camera.fy * point.y() / point.z() + camera.cy));
    if (u < reach || v < reach || u + reach >= depth_m.cols || v + reach >= depth_m.rows)
        return std::nullopt;
    const double middle = depth_m(v, u);
    std::vector<Eigen::Vector3d> points;
    for (int dv = -reach; dv <= reach; ++dv)
        for (int du = -reach; du <= reach; ++du) {
            const double z = depth_m(v + dv, u + du);
            if (!(z > 0) || std::abs(z - middle) > same_surface_m * middle)
                return std::nullopt;
            points.emplace_back((u + du - camera.cx) / camera.fx * z, (v + dv - camera.cy) / camera.fy * z, z);
        }
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const auto& p : points)
        centre += p / static_cast<double>(points.size());
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (const auto& p : points)
        moments += (p - centre) * (p - centre).transpose();
    return SurfacePiece{centre, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors().col(0)};
}

double median_of(std::vector<double> values) {
    if (values.empty())
        return std::nan("");
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

} // namespace scanshade::calibration
