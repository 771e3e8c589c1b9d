// The adjustment of planes: residuals, fits, scores, and what the planes cannot tell.
#include "projection/calibration/recording/planes.h"

#include "projection/calibration/recording/overlap.h"
#include "projection/calibration/recording/plane_adjustment.h"
#include "projection/error.h"

#include <algorithm>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

namespace scanshade::calibration {

Fit Planes::start(const Model& model) const {
    Fit fit{.model = model, .used = Views(frames_.size(), true)};
    fit.nuisance.resize(frames_.size() * pose_unknowns + planes_.size() * point_unknowns);
    for (std::size_t i = 0; i < frames_.size(); ++i)
        to_six(pose(static_cast<int>(i)), &fit.nuisance[i * pose_unknowns]);
    for (std::size_t i = 0; i < planes_.size(); ++i) {
        const Plane& plane = planes_[i];
        const double distance = plane.normal.dot(plane.point - plane.anchor);
        Eigen::Map<Eigen::Vector3d>(&fit.nuisance[frames_.size() * pose_unknowns + i * point_unknowns]) =
            plane.normal / distance;
    }
    return this->fit(fit, {}, fit.used, false);
}

Fit Planes::fit(const Fit& from, const Free& free, const Views& used, bool covariance) const {
    Fit fit = from;
    fit.used = used;
    Problem adjustment(*this, fit);
    for (std::size_t i = 0; i < planes_.size(); ++i) {
        const auto seen = std::count_if(planes_[i].cells.begin(), planes_[i].cells.end(),
                                        [&](const Cell& cell) { return used[cell.frame]; });
        constexpr int least = 4; // a plane itself takes three
        if (seen < least)
            continue;
        for (const Cell& cell : planes_[i].cells)
            if (used[cell.frame])
                adjustment.add(i, cell);
    }
    adjustment.hold_poses();
    freeze(adjustment.problem, fit.model, free);
    solve(adjustment.problem, fit, true);
    if (covariance)
        adjustment.add_covariance(free);
    return fit;
}

std::vector<ViewScore> Planes::score(const Fit& from, const Views& wanted) const {
    std::vector<ViewScore> scores(frames_.size());
    for (std::size_t frame = 0; frame < frames_.size(); ++frame) {
        if (!wanted[frame])
            continue;
        Fit alone = from;
        Problem adjustment(*this, alone);
        for (std::size_t i = 0; i < planes_.size(); ++i) {
            const auto seen = [&](auto&& where) {
                return std::count_if(planes_[i].cells.begin(), planes_[i].cells.end(),
                                     [&](const Cell& cell) { return where(cell.frame); });
            };
            const bool known = seen([&](int other) { return from.used[other]; }) >= 4;
            const bool its_own = seen([&](int other) { return other == static_cast<int>(frame); }) >= 4;
            if (linked_ ? !known : !its_own)
                continue;
            for (const Cell& cell : planes_[i].cells)
                if (cell.frame == static_cast<int>(frame))
                    adjustment.add(i, cell, linked_);
        }
        if (adjustment.problem.NumResidualBlocks() < pose_unknowns)
            continue;
        const int cells = adjustment.problem.NumResidualBlocks();
        adjustment.hold_poses();
        freeze(adjustment.problem, alone.model, {});
        if (linked_ || adjustment.problem.NumParameterBlocks() > 0)
            solve(adjustment.problem, alone, false);
        scores[frame] = {alone.rss, cells};
    }
    return scores;
}

std::vector<cv::Point2d> Planes::pixels_of(std::size_t view) const {
    std::vector<cv::Point2d> all;
    for (const Plane& plane : planes_)
        for (const Cell& cell : plane.cells)
            if (cell.frame == static_cast<int>(view))
                all.emplace_back(cell.pixel.x(), cell.pixel.y());
    return all;
}

std::vector<double> Planes::depths_m(const Fit& fit) const {
    std::vector<double> depths;
    for (const Plane& plane : planes_)
        for (const Cell& cell : plane.cells)
            depths.push_back(corrected_m(fit.model, cell.depth_m));
    return depths;
}

/// Tangential distortion and k3 are below what depth noise shows.
std::vector<std::vector<Rung>> Planes::ladders() const {
    const Rung focal{"f", {f}, depth_scale}, offset{"depth offset", {depth_offset}},
        scale{"depth scale", {depth_scale}, f}, curve{"depth curve", {depth_curve}}, second{"fx, fy", {aspect}},
        centre{"cx, cy", {cx, cy}}, lens{"k1", {k1}}, lens2{"k2", {k2}};
    if (!linked_)
        return {{offset, lens, lens2, curve}};
    return {{focal, offset, scale, second, centre, lens, lens2, curve},
            {scale, offset, curve, focal, second, centre, lens, lens2}};
}

std::string Planes::degeneracy() const {
    constexpr std::size_t least_planes = 3;
    if (planes_.size() < least_planes)
        return fmt::format("{} plane{} in the depth images, at least {} expected", planes_.size(),
                           planes_.size() == 1 ? "" : "s", least_planes);
    if (!linked_)
        return {};
    Eigen::Matrix3d directions = Eigen::Matrix3d::Zero();
    for (const Plane& plane : planes_)
        directions += static_cast<double>(plane.cells.size()) * plane.normal * plane.normal.transpose();
    const Eigen::Vector3d spread = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(directions).eigenvalues();
    const double across = std::sqrt(std::max(0.0, spread(0) + spread(1)) / spread.sum()) * 180 / CV_PI;
    constexpr double least_degrees = 10;
    if (across < least_degrees)
        return fmt::format("all planes face one way (to {:.0f} degrees): focal length, depth scale and the planes' own "
                           "distance make up for each other",
                           across);
    constexpr double least_turn_degrees = 2, least_shift_m = 0.05;
    Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
    double turn = 0;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
        const Eigen::Isometry3d here = pose(0).inverse() * pose(static_cast<int>(i));
        low = low.cwiseMin(here.translation());
        high = high.cwiseMax(here.translation());
        turn = std::max(turn, Eigen::AngleAxisd(here.linear()).angle() * 180 / CV_PI);
    }
    if (turn < least_turn_degrees && (high - low).norm() < least_shift_m)
        return fmt::format("the camera hardly moves: {:.0f} mm and {:.1f} degrees", 1000 * (high - low).norm(), turn);
    return {};
}

std::string Planes::summary() const {
    return fmt::format("{} planes in {} cells of {} depth images, {}", planes_.size(), cells(), frames_.size(),
                       linked_ ? "tied together by recorded poses"
                               : "each image by itself: without poses planes tell nothing of focal length and scale");
}

std::vector<cv::Mat1f> Planes::depth_images() const {
    std::vector<cv::Mat1f> images;
    for (const PlaneFrame& frame : frames_)
        images.push_back(frame.depth_m);
    return images;
}

std::vector<Eigen::Isometry3d> Planes::poses() const {
    std::vector<Eigen::Isometry3d> all;
    for (std::size_t i = 0; i < frames_.size(); ++i)
        all.push_back(pose(static_cast<int>(i)));
    return all;
}

Eigen::Isometry3d Planes::pose(int frame) const {
    return linked_ ? *frames_[frame].world_from_camera : Eigen::Isometry3d::Identity();
}

std::size_t Planes::cells() const {
    std::size_t sum = 0;
    for (const Plane& plane : planes_)
        sum += plane.cells.size();
    return sum;
}

} // namespace scanshade::calibration
