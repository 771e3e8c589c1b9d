// The bundle adjustment of boards, first guesses, and degenerate views.
#include "projection/calibration/boards/boards.h"

#include "projection/base/error.h"
#include "projection/calibration/solve.h"

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

namespace scanshade::calibration {
namespace {

struct CornerResidual {
    LensModel lens;
    Eigen::Vector3d point_m;
    Eigen::Vector2d observed;
    double weight;

    template <class Number>
    bool operator()(const Number* camera, const Number* pose, Number* residual) const {
        const Number on_board[3] = {Number(point_m.x()), Number(point_m.y()), Number(point_m.z())};
        Number point[3];
        transform_point(pose, on_board, point);
        if (point[2] < Number(1e-6))
            return false; // behind the camera: the solver then takes a shorter step
        pixel_of(lens, camera, point, residual);
        for (int i = 0; i < 2; ++i)
            residual[i] = Number(weight) * (residual[i] - Number(observed[i]));
        return true;
    }
};

void add_view(ceres::Problem& problem, Model& model, const BoardView& view, double weight, double* pose) {
    for (std::size_t i = 0; i < view.pixels.size(); ++i)
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CornerResidual, 2, camera_unknowns, pose_unknowns>(
                                     new CornerResidual{model.lens, view.points_m[i], view.pixels[i], weight}),
                                 nullptr, model.values.data(), pose);
}

/// The board's pose from its homography, on undistorted directions so that any lens will do.
void guess_pose(const Model& model, const BoardView& view, double* pose) {
    const Camera camera = calibration::camera_of(model);
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> undistorted_pixels, observed;
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
        const auto& [x, y, z] = std::tie(view.points_m[i].x(), view.points_m[i].y(), view.points_m[i].z());
        points.emplace_back(x, y, z);
        observed.emplace_back(view.pixels[i].x(), view.pixels[i].y());
    }
    const auto& [fx, fy, px, py, size] = camera.pinhole;
    const cv::Matx33d matrix(fx, 0, px, 0, fy, py, 0, 0, 1);
    if (model.lens == LensModel::kannala_brandt)
        cv::fisheye::undistortPoints(observed, undistorted_pixels, matrix,
                                     cv::Vec4d(model[k1], model[k2], model[k3], model[k4]));
    else
        cv::undistortPoints(
            observed, undistorted_pixels, matrix,
            cv::Vec<double, 8>(model[k1], model[k2], model[p1], model[p2], model[k3], model[k4], model[k5], model[k6]));
    cv::Vec3d rotation, translation;
    cv::solvePnP(points, undistorted_pixels, cv::Matx33d::eye(), cv::noArray(), rotation, translation, false,
                 cv::SOLVEPNP_ITERATIVE);
    std::copy_n(rotation.val, 3, pose);
    std::copy_n(translation.val, 3, pose + 3);
}

std::vector<Eigen::Vector2d> residuals_of(const Model& model, const BoardView& view, const double* pose) {
    std::vector<Eigen::Vector2d> all(view.pixels.size());
    for (std::size_t i = 0; i < all.size(); ++i)
        if (!CornerResidual{model.lens, view.points_m[i], view.pixels[i], 1}(model.values.data(), pose, all[i].data()))
            all[i].setConstant(std::numeric_limits<double>::infinity());
    return all;
}

} // namespace

Boards::Boards(std::vector<BoardView> views) : views_(std::move(views)), weights_(views_.size(), 1.0) {
    for (const BoardView& view : views_)
        if (view.pixels.size() < 6 || view.pixels.size() != view.points_m.size())
            throw Error(fmt::format("{}: {} points of the board, at least 6 expected", view.name, view.pixels.size()));
}

Fit Boards::start(const Model& model) const {
    Fit fit{.model = model, .nuisance = std::vector<double>(views_.size() * pose_unknowns), .covariance = {}};
    for (std::size_t i = 0; i < views_.size(); ++i)
        during(views_[i].name, [&] { guess_pose(model, views_[i], &fit.nuisance[i * pose_unknowns]); });
    return this->fit(fit, {}, Views(views_.size(), true), false);
}

Fit Boards::fit(const Fit& from, const Free& free, const Views& used, bool covariance) const {
    Fit fit = from;
    ceres::Problem problem;
    for (std::size_t i = 0; i < views_.size(); ++i)
        if (used[i])
            add_view(problem, fit.model, views_[i], weights_[i], &fit.nuisance[i * pose_unknowns]);
    fix(problem, fit.model, free);
    solve(problem, fit, false);
    if (covariance) {
        std::vector<double*> poses;
        for (std::size_t i = 0; i < views_.size(); ++i)
            poses.push_back(&fit.nuisance[i * pose_unknowns]);
        add_covariance(problem, fit, free, poses, {});
    }
    return fit;
}

std::vector<ViewScore> Boards::score(const Fit& from, const Views& wanted) const {
    Fit fit = from;
    std::vector<ViewScore> scores(views_.size());
    for (std::size_t i = 0; i < views_.size(); ++i) {
        if (!wanted[i])
            continue;
        double* pose = &fit.nuisance[i * pose_unknowns];
        ceres::Problem problem;
        add_view(problem, fit.model, views_[i], 1, pose);
        fix(problem, fit.model, {});
        solve(problem, fit, false);
        for (const Eigen::Vector2d& residual : residuals_of(fit.model, views_[i], pose))
            scores[i].squared += residual.squaredNorm();
        scores[i].points = static_cast<int>(views_[i].pixels.size());
    }
    return scores;
}

std::vector<cv::Point2d> Boards::pixels_of(std::size_t view) const {
    std::vector<cv::Point2d> all;
    for (const Eigen::Vector2d& pixel : views_[view].pixels)
        all.emplace_back(pixel.x(), pixel.y());
    return all;
}

std::vector<double> Boards::depths_m(const Fit& fit) const {
    std::vector<double> depths;
    for (std::size_t i = 0; i < views_.size(); ++i)
        for (const Eigen::Vector3d& on_board : views_[i].points_m) {
            Eigen::Vector3d point;
            transform_point(&fit.nuisance[i * pose_unknowns], on_board.data(), point.data());
            depths.push_back(point.z());
        }
    return depths;
}

std::vector<Eigen::Vector2d> Boards::residuals(const Fit& fit, std::size_t view) const {
    return residuals_of(fit.model, views_[view], &fit.nuisance[view * pose_unknowns]);
}

Camera guess_from_boards(const std::vector<BoardView>& views, cv::Size size) {
    std::vector<std::vector<cv::Point3f>> points;
    std::vector<std::vector<cv::Point2f>> pixels;
    for (const BoardView& view : views) {
        points.emplace_back();
        pixels.emplace_back();
        for (std::size_t i = 0; i < view.pixels.size(); ++i) {
            points.back().emplace_back(cv::Point3d(view.points_m[i].x(), view.points_m[i].y(), view.points_m[i].z()));
            pixels.back().emplace_back(cv::Point2d(view.pixels[i].x(), view.pixels[i].y()));
        }
    }
    const cv::Matx33d matrix = cv::initCameraMatrix2D(points, pixels, size, 1.0);
    // Views without perspective determine no focal length; a usual lens is then a better start than none.
    const double usual = 0.9 * size.width, found = matrix(0, 0);
    const double guess = std::isfinite(found) && found > 0.2 * usual && found < 10 * usual ? found : usual;
    return {{guess, guess, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size}, {}, "guessed from the board"};
}

namespace {

/// How far the board has moved between two images: the corners' distances, root mean square.
double distance_px(const BoardView& a, const BoardView& b) {
    if (a.pixels.size() != b.pixels.size())
        return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (std::size_t i = 0; i < a.pixels.size(); ++i)
        sum += (a.pixels[i] - b.pixels[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(a.pixels.size()));
}

int distinct(const std::vector<BoardView>& views) {
    constexpr double same_px = 2; // a shaking tripod gives no second view
    std::vector<const BoardView*> different;
    for (const BoardView& view : views)
        if (std::none_of(different.begin(), different.end(),
                         [&](const BoardView* known) { return distance_px(*known, view) < same_px; }))
            different.push_back(&view);
    return static_cast<int>(different.size());
}

Eigen::Vector3d normal_of(const double* pose) {
    const double along_z[3] = {0, 0, 1};
    Eigen::Vector3d normal;
    ceres::AngleAxisRotatePoint(pose, along_z, normal.data());
    return normal;
}

} // namespace

std::string degeneracy(const std::vector<BoardView>& views, const Fit& fit) {
    constexpr int least_views = 3;
    constexpr double least_tilt_degrees = 5;
    if (const int different = distinct(views); different < least_views)
        return fmt::format("{} different view{} of the board among {} images, at least {} expected", different,
                           different == 1 ? "" : "s", views.size(), least_views);
    double widest = 0;
    for (std::size_t i = 0; i < views.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            widest = std::max(
                widest,
                std::acos(std::clamp(
                    normal_of(&fit.nuisance[i * pose_unknowns]).dot(normal_of(&fit.nuisance[j * pose_unknowns])), -1.0,
                    1.0)));
    const double degrees = widest * 180 / CV_PI;
    if (degrees < least_tilt_degrees)
        return fmt::format(
            "the board has the same tilt in all {} views (within {:.1f} degrees): focal length and distance "
            "cannot be told apart; tilt it by 20 to 40 degrees either way",
            views.size(), degrees);
    return {};
}

} // namespace scanshade::calibration
