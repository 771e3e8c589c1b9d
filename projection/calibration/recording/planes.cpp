// Fits and scores of planes, and what the planes cannot determine.
#include "projection/calibration/recording/planes.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/recording/plane_adjustment.h"

#include <algorithm>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <utility>

namespace scanshade::calibration {
namespace {

constexpr int least_known = 4;             // cells of a plane; the plane itself takes three
constexpr double same_focal_length = 1e-3; // as a share: cells join alike
constexpr double other_focal_length = 0.2; // nothing determines it
constexpr double still_plane = 0.5;        // share of the cells

} // namespace

Planes::Planes(const std::vector<PlaneFrame>& frames, const Model& first) : observations_(find_planes(frames, first)) {
    constexpr int most_rounds = 3;
    Model here = first, there = prune(here);
    if (observations_.planes.empty())
        throw Error("no plane stays one: the poses, the depth unit or the camera are far off");
    // Which cells join to planes depends on the camera. So those of a wrong one are found again under what they say of
    // it, where they determine it, as long as most still join.
    for (int round = 1; round < most_rounds && observations_.linked && degeneracy().empty(); ++round) {
        const double change = std::abs(there.values[f] / here.values[f] - 1);
        if (change < same_focal_length || change > other_focal_length)
            break;
        PlaneObservations before = std::exchange(observations_, find_planes(frames, there));
        here = there;
        there = prune(here);
        if (static_cast<double>(observations_.cells()) < still_plane * static_cast<double>(before.cells())) {
            observations_ = std::move(before);
            break;
        }
    }
}

/// Removes cells that do not lie on their planes, judged by a robust fit. Some numbers of the camera are free in it: a
/// wrong camera must not cost the corners of the image. Returns that camera.
Model Planes::prune(const Model& first) {
    constexpr double most_sigmas = 4;
    Model model = first;
    for (int round = 0; round < 3 && !observations_.planes.empty(); ++round) {
        Fit fit = start(first);
        PlaneAdjustment adjustment(observations_, fit);
        for (std::size_t i = 0; i < observations_.planes.size(); ++i)
            for (const PlaneCell& cell : observations_.planes[i].cells)
                adjustment.add(i, cell, false, new ceres::CauchyLoss(observations_.sigma_mm));
        adjustment.add_pose_priors();
        Free free{};
        for (const Unknown unknown : {f, cx, cy})
            free[unknown] = observations_.linked;
        free[k1] = !observations_.linked;
        fix(adjustment.problem, fit.model, free);
        solve(adjustment.problem, fit, true);
        std::vector<double> residuals, errors;
        ceres::Problem::EvaluateOptions without_loss;
        without_loss.apply_loss_function = false;
        adjustment.problem.Evaluate(without_loss, nullptr, &residuals, nullptr, nullptr);
        residuals.resize(observations_.cells()); // those of poses come last
        for (const double residual : residuals)
            errors.push_back(std::abs(residual));
        observations_.sigma_mm = std::max(1e-6, median(errors) / median_of_gaussian);
        std::size_t next = 0;
        for (ScenePlane& plane : observations_.planes) {
            std::vector<PlaneCell> kept;
            for (const PlaneCell& cell : plane.cells)
                if (errors[next++] <= most_sigmas * observations_.sigma_mm)
                    kept.push_back(cell);
            plane.cells = std::move(kept);
        }
        observations_.remove_small_planes();
        model = fit.model;
    }
    return model;
}

Fit Planes::start(const Model& model) const {
    Fit fit{.model = model, .used = Views(observations_.frames.size(), true)};
    fit.nuisance.resize(observations_.frames.size() * pose_unknowns + observations_.planes.size() * point_unknowns);
    for (std::size_t i = 0; i < observations_.frames.size(); ++i)
        to_pose_parameters(observations_.pose(static_cast<int>(i)), &fit.nuisance[i * pose_unknowns]);
    for (std::size_t i = 0; i < observations_.planes.size(); ++i) {
        const ScenePlane& plane = observations_.planes[i];
        const double distance = plane.normal.dot(plane.point - plane.anchor);
        Eigen::Map<Eigen::Vector3d>(&fit.nuisance[observations_.frames.size() * pose_unknowns + i * point_unknowns]) =
            plane.normal / distance;
    }
    return this->fit(fit, {}, fit.used, false);
}

Fit Planes::fit(const Fit& from, const Free& free, const Views& used, bool covariance) const {
    Fit fit = from;
    fit.used = used;
    PlaneAdjustment adjustment(observations_, fit);
    for (std::size_t i = 0; i < observations_.planes.size(); ++i) {
        const auto seen = std::count_if(observations_.planes[i].cells.begin(), observations_.planes[i].cells.end(),
                                        [&](const PlaneCell& cell) { return used[cell.frame]; });
        if (seen < least_known)
            continue;
        for (const PlaneCell& cell : observations_.planes[i].cells)
            if (used[cell.frame])
                adjustment.add(i, cell);
    }
    adjustment.add_pose_priors();
    fix(adjustment.problem, fit.model, free);
    solve(adjustment.problem, fit, true);
    if (covariance)
        adjustment.add_covariance(free);
    return fit;
}

std::vector<ViewScore> Planes::score(const Fit& from, const Views& wanted) const {
    std::vector<ViewScore> scores(observations_.frames.size());
    for (std::size_t frame = 0; frame < observations_.frames.size(); ++frame) {
        if (!wanted[frame])
            continue;
        Fit alone = from;
        PlaneAdjustment adjustment(observations_, alone);
        for (std::size_t i = 0; i < observations_.planes.size(); ++i) {
            const auto seen = [&](auto&& where) {
                return std::count_if(observations_.planes[i].cells.begin(), observations_.planes[i].cells.end(),
                                     [&](const PlaneCell& cell) { return where(cell.frame); });
            };
            const bool known = seen([&](int other) { return from.used[other]; }) >= least_known;
            const bool in_this_view = seen([&](int other) { return other == static_cast<int>(frame); }) >= least_known;
            if (observations_.linked ? !known : !in_this_view)
                continue;
            for (const PlaneCell& cell : observations_.planes[i].cells)
                if (cell.frame == static_cast<int>(frame))
                    adjustment.add(i, cell, observations_.linked);
        }
        if (adjustment.problem.NumResidualBlocks() < pose_unknowns)
            continue;
        const int cells = adjustment.problem.NumResidualBlocks();
        adjustment.add_pose_priors();
        fix(adjustment.problem, alone.model, {});
        if (observations_.linked || adjustment.problem.NumParameterBlocks() > 0)
            solve(adjustment.problem, alone, false);
        scores[frame] = {alone.rss, cells};
    }
    return scores;
}

std::vector<cv::Point2d> Planes::pixels_of(std::size_t view) const {
    std::vector<cv::Point2d> all;
    for (const ScenePlane& plane : observations_.planes)
        for (const PlaneCell& cell : plane.cells)
            if (cell.frame == static_cast<int>(view))
                all.emplace_back(cell.pixel.x(), cell.pixel.y());
    return all;
}

std::vector<double> Planes::depths_m(const Fit& fit) const {
    std::vector<double> depths;
    for (const ScenePlane& plane : observations_.planes)
        for (const PlaneCell& cell : plane.cells)
            depths.push_back(corrected_m(fit.model, cell.depth_m));
    return depths;
}

/// Tangential distortion and k3 are left out: depth noise hides them.
std::vector<std::vector<ParameterGroup>> Planes::group_orders() const {
    const ParameterGroup focal{"f", {f}, depth_scale}, offset{"depth offset", {depth_offset}},
        scale{"depth scale", {depth_scale}, f}, curve{"depth curve", {depth_curve}}, second{"fx, fy", {aspect}},
        centre{"cx, cy", {cx, cy}}, lens{"k1", {k1}}, lens2{"k2", {k2}};
    if (!observations_.linked)
        return {{offset, lens, lens2, curve}};
    return {{focal, offset, scale, second, centre, lens, lens2, curve},
            {scale, offset, curve, focal, second, centre, lens, lens2}};
}

std::string Planes::degeneracy() const {
    constexpr std::size_t least_planes = 3;
    if (observations_.planes.size() < least_planes)
        return fmt::format("{} plane{} in the depth images, at least {} expected", observations_.planes.size(),
                           observations_.planes.size() == 1 ? "" : "s", least_planes);
    if (!observations_.linked)
        return {};
    Eigen::Matrix3d directions = Eigen::Matrix3d::Zero();
    for (const ScenePlane& plane : observations_.planes)
        directions += static_cast<double>(plane.cells.size()) * plane.normal * plane.normal.transpose();
    const Eigen::Vector3d spread = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(directions).eigenvalues();
    const double across = std::sqrt(std::max(0.0, spread(0) + spread(1)) / spread.sum()) * 180 / CV_PI;
    constexpr double least_degrees = 10;
    if (across < least_degrees)
        return fmt::format(
            "all planes face one way (to {:.0f} degrees): focal length, depth scale and the distance of the "
            "planes compensate each other",
            across);
    constexpr double least_rotation_degrees = 2, least_translation_m = 0.05;
    Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
    double rotation_degrees = 0;
    for (std::size_t i = 0; i < observations_.frames.size(); ++i) {
        const Eigen::Isometry3d here = observations_.pose(0).inverse() * observations_.pose(static_cast<int>(i));
        low = low.cwiseMin(here.translation());
        high = high.cwiseMax(here.translation());
        rotation_degrees = std::max(rotation_degrees, Eigen::AngleAxisd(here.linear()).angle() * 180 / CV_PI);
    }
    if (rotation_degrees < least_rotation_degrees && (high - low).norm() < least_translation_m)
        return fmt::format("the camera hardly moves: {:.0f} mm and {:.1f} degrees", 1000 * (high - low).norm(),
                           rotation_degrees);
    return {};
}

std::string Planes::summary() const {
    return fmt::format("{} planes in {} cells of {} depth images, {}", observations_.planes.size(),
                       observations_.cells(), observations_.frames.size(),
                       observations_.linked
                           ? "joined by recorded poses"
                           : "each image by itself: without poses planes do not determine focal length and scale");
}

std::vector<cv::Mat1f> Planes::depth_images() const {
    std::vector<cv::Mat1f> images;
    for (const PlaneFrame& frame : observations_.frames)
        images.push_back(frame.depth_m);
    return images;
}

std::vector<Eigen::Isometry3d> Planes::poses() const {
    std::vector<Eigen::Isometry3d> all;
    for (std::size_t i = 0; i < observations_.frames.size(); ++i)
        all.push_back(observations_.pose(static_cast<int>(i)));
    return all;
}

} // namespace scanshade::calibration
