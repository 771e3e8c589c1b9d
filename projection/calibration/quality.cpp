// Coverage, uncertainty of pixels, effect in millimetres.
#include "projection/calibration/quality.h"

#include "projection/undistort.h"

#include <algorithm>
#include <ceres/jet.h>
#include <ceres/rotation.h>
#include <cmath>
#include <Eigen/Dense>
#include <limits>

namespace scanshade::calibration {
namespace {

/// Calls visit(u, v) at the centres of a grid of cells.
template <class Visit>
void for_each_cell(cv::Size image, cv::Size cells, Visit&& visit) {
    for (int row = 0; row < cells.height; ++row)
        for (int column = 0; column < cells.width; ++column)
            visit(row, column, (column + 0.5) * image.width / cells.width - 0.5,
                  (row + 0.5) * image.height / cells.height - 0.5);
}

std::optional<Eigen::Vector2d> direction(const Camera& camera, double u, double v) {
    return undistorted(camera.distortion, camera.pinhole.ray(u, v).head<2>());
}

/// Derivatives of the pixel by the camera's numbers, and by a small rotation of the camera.
using PixelJacobian = Eigen::Matrix<double, 2, camera_unknowns + 3>;
PixelJacobian pixel_jacobian(const Model& model, const Eigen::Vector2d& undistorted_ray) {
    using Jet = ceres::Jet<double, camera_unknowns + 3>;
    Jet camera[camera_unknowns], rotation[3], pixel[2], rotated[3];
    for (int i = 0; i < camera_unknowns; ++i)
        camera[i] = Jet(model.values[i], i);
    for (int i = 0; i < 3; ++i)
        rotation[i] = Jet(0.0, camera_unknowns + i);
    const Jet point[3] = {Jet(undistorted_ray.x()), Jet(undistorted_ray.y()), Jet(1.0)};
    ceres::AngleAxisRotatePoint(rotation, point, rotated);
    pixel_of(model.lens, camera, rotated, pixel);
    PixelJacobian jacobian;
    jacobian << pixel[0].v.transpose(), pixel[1].v.transpose();
    return jacobian;
}

} // namespace

Coverage coverage_of(const std::vector<cv::Point2d>& pixels, cv::Size size) {
    Coverage coverage{cv::Mat1i(6, 8, 0), 0};
    for (const cv::Point2d& pixel : pixels) {
        const int column = static_cast<int>((pixel.x + 0.5) * coverage.counts.cols / size.width);
        const int row = static_cast<int>((pixel.y + 0.5) * coverage.counts.rows / size.height);
        if (column >= 0 && row >= 0 && column < coverage.counts.cols && row < coverage.counts.rows)
            ++coverage.counts(row, column);
    }
    coverage.share = cv::countNonZero(coverage.counts) / static_cast<double>(coverage.counts.total());
    return coverage;
}

cv::Mat1d pixel_sigmas(const Fit& fit, cv::Size cells) {
    cv::Mat1d sigmas(cells, 0.0);
    if (fit.covariance.size() == 0)
        return sigmas;
    const Camera camera = camera_of(fit.model);
    std::vector<cv::Point> used;
    Eigen::MatrixXd by_camera(2 * cells.area(), camera_unknowns), by_rotation(2 * cells.area(), 3);
    for_each_cell(fit.model.size, cells, [&](int row, int column, double u, double v) {
        const auto ray = direction(camera, u, v);
        if (!ray) {
            sigmas(row, column) = std::numeric_limits<double>::quiet_NaN();
            return;
        }
        const PixelJacobian jacobian = pixel_jacobian(fit.model, *ray);
        const auto index = 2 * static_cast<Eigen::Index>(used.size());
        by_camera.middleRows<2>(index) = jacobian.leftCols<camera_unknowns>();
        by_rotation.middleRows<2>(index) = jacobian.rightCols<3>();
        used.emplace_back(column, row);
    });
    const auto rows = 2 * static_cast<Eigen::Index>(used.size());
    by_camera.conservativeResize(rows, Eigen::NoChange);
    by_rotation.conservativeResize(rows, Eigen::NoChange);
    if (rows < 6)
        return sigmas;
    // What remains of each change after the rotation of the camera that best compensates it.
    by_camera -= by_rotation * by_rotation.colPivHouseholderQr().solve(by_camera);
    const Eigen::MatrixXd spread = by_camera * fit.covariance.topLeftCorner(camera_unknowns, camera_unknowns);
    for (std::size_t i = 0; i < used.size(); ++i) {
        const auto row = 2 * static_cast<Eigen::Index>(i);
        sigmas(used[i]) =
            std::sqrt(std::max(0.0, (spread.middleRows<2>(row) * by_camera.middleRows<2>(row).transpose()).trace()));
    }
    return sigmas;
}

double mean_pixel_sigma(const Fit& fit) {
    double sum = 0;
    int count = 0;
    for (const double sigma : pixel_sigmas(fit))
        if (!std::isnan(sigma)) {
            sum += sigma;
            ++count;
        }
    return count > 0 ? sum / count : 0;
}

bool monotone(const Model& model) {
    const Camera camera = camera_of(model);
    const cv::Size size = model.size;
    for (const double u : {-0.5, size.width - 0.5})
        for (const double v : {-0.5, size.height - 0.5})
            if (!direction(camera, u, v))
                return false;
    return true;
}

Effect effect_at(const Camera& before, const Camera& after, double depth_m) {
    std::vector<Eigen::Vector3d> old_points, new_points;
    for_each_cell(after.pinhole.size, {32, 24}, [&](int, int, double u, double v) {
        const auto old_ray = direction(before, u, v), new_ray = direction(after, u, v);
        if (!old_ray || !new_ray)
            return;
        old_points.push_back(depth_m * old_ray->homogeneous());
        new_points.push_back(depth_m * new_ray->homogeneous());
    });
    Effect effect{depth_m, 0, 0};
    if (old_points.size() < 3)
        return effect;
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero(); // the best rotation between two bundles of rays (Kabsch 1976)
    for (std::size_t i = 0; i < old_points.size(); ++i)
        moments += new_points[i] * old_points[i].transpose();
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
    double squares = 0;
    for (std::size_t i = 0; i < old_points.size(); ++i) {
        const double moved_mm = 1000 * (new_points[i] - rotation * old_points[i]).norm();
        effect.worst_mm = std::max(effect.worst_mm, moved_mm);
        squares += moved_mm * moved_mm;
    }
    effect.rms_mm = std::sqrt(squares / static_cast<double>(old_points.size()));
    return effect;
}

std::vector<Effect> effects(const Camera& before, const Camera& after, std::vector<double> depths_m) {
    std::vector<Effect> all;
    if (depths_m.empty())
        return all;
    std::sort(depths_m.begin(), depths_m.end());
    for (const double share : {0.1, 0.5, 0.9})
        all.push_back(effect_at(before, after,
                                depths_m[static_cast<std::size_t>(share * static_cast<double>(depths_m.size() - 1))]));
    return all;
}

double sigma_fy(const Fit& fit) {
    const Eigen::Vector2d by(fit.model[aspect], fit.model[f]); // d (f aspect)
    return std::sqrt(by.dot(fit.covariance.topLeftCorner<2, 2>() * by));
}

} // namespace scanshade::calibration
