// Fits and scores of a recorded sequence, and what its frames cannot determine.
#include "projection/calibration/recording/sequence.h"

#include "projection/base/statistics.h"
#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/recording/sequence_adjustment.h"
#include "projection/calibration/recording/sequence_setup.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <fmt/format.h>

namespace scanshade::calibration {
namespace {

/// The number of the cube of the world that a point lies in. Points of one cube are on the same surfaces, and in the
/// same frames.
int neighbourhood_of(const Eigen::Vector3d& in_world, double side_m) {
    constexpr unsigned cubes = 1024; // along each axis before numbers repeat
    unsigned number = 0;
    for (int axis = 0; axis < 3; ++axis)
        number = number * cubes + (static_cast<unsigned>(std::lround(in_world[axis] / side_m)) & (cubes - 1));
    return static_cast<int>(number);
}

} // namespace

Sequence::Sequence(std::vector<SequenceFrame> frames, const Camera& depth_camera, const Model& first,
                   const SequenceOptions& options)
    : observations_(observe_sequence(std::move(frames), depth_camera, first, options)) {}

Fit Sequence::start(const Model& model) const {
    return fit(initial_fit(observations_, model), {}, Views(observations_.frames.size(), true), false);
}

Fit Sequence::fit(const Fit& from, const Free& free, const Views& used, bool covariance) const {
    Fit fit = from;
    fit.used = used;
    SequenceAdjustment adjustment(observations_, fit);
    for (std::size_t i = 0; i < observations_.points.size(); ++i) {
        const auto count =
            std::count_if(observations_.points[i].observations.begin(), observations_.points[i].observations.end(),
                          [&](const PointObservation& s) { return used[s.frame]; });
        if (count < 2)
            continue;
        for (const PointObservation& s : observations_.points[i].observations)
            if (used[s.frame])
                adjustment.add(i, s);
    }
    for (std::size_t i = 0; i < observations_.frames.size(); ++i)
        if (used[i])
            adjustment.add_outlines(static_cast<int>(i));
    adjustment.add_gap_prior();
    adjustment.add_pose_priors(used);
    fix(adjustment.problem, fit.model, free);
    solve(adjustment.problem, fit, true);
    if (covariance)
        add_covariance(adjustment, fit, free);
    return fit;
}

void Sequence::add_covariance(SequenceAdjustment& adjustment, Fit& fit, const Free& free) const {
    constexpr double share_of_depth = 0.6; // about a piece of furniture, whose errors are correlated
    const double side_m = share_of_depth * median(depths_m(fit));
    std::vector<double*> kept = {adjustment.gap()};
    for (std::size_t i = 0; i < observations_.frames.size(); ++i)
        kept.push_back(adjustment.pose(static_cast<int>(i)));
    // Where the cubes begin is arbitrary, and in a short walk much depends on it: sigmas of 0.14 and 1.1 px were met
    // for one focal length. So the mean over several grids counts.
    std::vector<Clusters> grids;
    for (const Eigen::Vector3d& corner :
         std::initializer_list<Eigen::Vector3d>{{0, 0, 0}, {0.5, 0.5, 0}, {0.5, 0, 0.5}, {0, 0.5, 0.5}}) {
        const Eigen::Vector3d shift = side_m * corner;
        Clusters& clusters = grids.emplace_back(Clusters{.many = true});
        for (std::size_t i = 0; i < observations_.points.size(); ++i) {
            const Eigen::Map<const Eigen::Vector3d> point(adjustment.point(i));
            clusters.points.push_back({adjustment.point(i), neighbourhood_of(point + shift, side_m)});
        }
        for (const auto& [block, in_world] : adjustment.outlines)
            clusters.residuals[block] = neighbourhood_of(in_world + shift, side_m);
    }
    calibration::add_covariance(adjustment.problem, fit, free, kept, grids);
    if (fit.covariance.size() == 0)
        return;
    // Refined poses follow the features where these drift over surfaces from frame to frame, which no residual shows:
    // true errors were 1.4 times the sigmas, over 48 walks. With recorded poses they were 0.7 times.
    constexpr double by_drift = 1.6;
    if (observations_.options.refine_poses)
        fit.covariance *= by_drift * by_drift;
}

bool Sequence::is_known(const ScenePoint& point, const Views& used) const {
    const auto seen = std::count_if(point.observations.begin(), point.observations.end(),
                                    [&](const PointObservation& s) { return used[s.frame]; });
    const bool measured = std::any_of(point.observations.begin(), point.observations.end(),
                                      [&](const PointObservation& s) { return used[s.frame] && s.depth_m > 0; });
    return seen >= 2 && (measured || !observations_.options.registered);
}

std::vector<ViewScore> Sequence::score(const Fit& from, const Views& wanted) const {
    Fit fit = from;
    std::vector<bool> known(observations_.points.size());
    for (std::size_t i = 0; i < observations_.points.size(); ++i)
        known[i] = is_known(observations_.points[i], fit.used);
    std::vector<ViewScore> scores(observations_.frames.size());
    for (std::size_t frame = 0; frame < observations_.frames.size(); ++frame) {
        if (!wanted[frame])
            continue;
        SequenceAdjustment adjustment(observations_, fit);
        for (std::size_t i = 0; i < observations_.points.size(); ++i)
            for (const PointObservation& s : observations_.points[i].observations)
                if (s.frame == static_cast<int>(frame) && known[i]) {
                    adjustment.add(i, s);
                    adjustment.problem.SetParameterBlockConstant(adjustment.point(i));
                }
        if (adjustment.pixels.size() < 6)
            continue;
        adjustment.add_outlines(static_cast<int>(frame));
        if (adjustment.problem.HasParameterBlock(adjustment.gap()))
            adjustment.problem.SetParameterBlockConstant(adjustment.gap());
        fix(adjustment.problem, fit.model, {});
        if (observations_.options.refine_poses)
            adjustment.add_pose_prior(static_cast<int>(frame));
        else if (adjustment.problem.HasParameterBlock(adjustment.pose(static_cast<int>(frame))))
            adjustment.problem.SetParameterBlockConstant(adjustment.pose(static_cast<int>(frame)));
        Fit alone = fit; // the pose is fitted inside `fit`; rss is this view's
        solve(adjustment.problem, alone, false);
        scores[frame] = {alone.rss, static_cast<int>(adjustment.pixels.size())};
    }
    return scores;
}

std::vector<cv::Point2d> Sequence::pixels_of(std::size_t view) const {
    std::vector<cv::Point2d> all;
    for (const ScenePoint& point : observations_.points)
        for (const PointObservation& s : point.observations)
            if (s.frame == static_cast<int>(view))
                all.emplace_back(s.pixel.x(), s.pixel.y());
    return all;
}

std::vector<Eigen::Vector2d> Sequence::residuals(const Fit& from, std::size_t view) const {
    Fit fit = from;
    std::vector<Eigen::Vector2d> all;
    for (std::size_t i = 0; i < observations_.points.size(); ++i)
        for (const PointObservation& s : observations_.points[i].observations)
            if (s.frame == static_cast<int>(view)) {
                SequenceAdjustment single(observations_, fit);
                single.add(i, s);
                std::vector<double> r;
                single.problem.Evaluate({}, nullptr, &r, nullptr, nullptr);
                all.emplace_back(r[0], r[1]);
            }
    return all;
}

std::vector<double> Sequence::depths_m(const Fit& fit) const {
    std::vector<double> depths;
    for (std::size_t i = 0; i < observations_.points.size(); ++i)
        for (const PointObservation& s : observations_.points[i].observations) {
            const Eigen::Map<const Eigen::Vector3d> point(&fit.nuisance[point_offset(observations_, i)]);
            depths.push_back((pose_from_parameters(&fit.nuisance[s.frame * pose_unknowns]) * point).z());
        }
    return depths;
}

std::vector<Eigen::Isometry3d> Sequence::poses(const Fit& fit) const {
    std::vector<Eigen::Isometry3d> all;
    for (std::size_t i = 0; i < observations_.frames.size(); ++i)
        all.push_back(pose_from_parameters(&fit.nuisance[i * pose_unknowns]).inverse());
    return all;
}

std::size_t Sequence::outline_points() const {
    std::size_t sum = 0;
    for (const auto& pairs : observations_.pairs)
        sum += pairs.size();
    return sum;
}

std::size_t Sequence::observations() const {
    std::size_t sum = 0;
    for (const ScenePoint& point : observations_.points)
        sum += point.observations.size();
    return sum;
}

std::string Sequence::degeneracy(const Fit& fit) const {
    constexpr double least_rotation_degrees = 2, least_translation = 0.02; // of the median depth
    const std::vector<Eigen::Isometry3d> all = poses(fit);
    const double depth_m = median(depths_m(fit));
    Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
    double rotation_degrees = 0;
    for (const Eigen::Isometry3d& pose : all) {
        const Eigen::Isometry3d here = all.front().inverse() * pose;
        low = low.cwiseMin(here.translation());
        high = high.cwiseMax(here.translation());
        rotation_degrees = std::max(rotation_degrees, Eigen::AngleAxisd(here.linear()).angle() * 180 / CV_PI);
    }
    const Eigen::Vector3d reach = high - low;
    if (observations_.frames.size() < 3)
        return fmt::format("{} frames, at least 3 expected", observations_.frames.size());
    if (reach.norm() < least_translation * depth_m && rotation_degrees < least_rotation_degrees)
        return fmt::format("the camera hardly moves: {:.0f} mm and {:.1f} degrees before a scene {:.1f} m away",
                           1000 * reach.norm(), rotation_degrees, depth_m);
    if (rotation_degrees < least_rotation_degrees && reach.head<2>().norm() < 0.2 * reach.z())
        return fmt::format(
            "the camera moves straight forward ({:.0f} mm along its axis, {:.0f} mm across, {:.1f} degrees): "
            "focal length and distance cannot be told apart",
            1000 * reach.z(), 1000 * reach.head<2>().norm(), rotation_degrees);
    return {};
}

std::vector<cv::Mat1f> Sequence::depth_images() const {
    std::vector<cv::Mat1f> images;
    for (const SequenceFrame& frame : observations_.frames)
        images.push_back(frame.depth_m);
    return images;
}

} // namespace scanshade::calibration
