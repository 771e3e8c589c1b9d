// A recording as the ladder sees it: fits, scores, and what the frames say of themselves.
#include "projection/calibration/recording/sequence.h"

#include "projection/calibration/recording/sequence_adjustment.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <fmt/format.h>

namespace scanshade::calibration {
namespace {

/// The cube of the world that a point lies in, as a number: what lies in one is on the same surfaces, and seen by the
/// same frames.
int neighbourhood_of(const Eigen::Vector3d& in_world, double side_m) {
    constexpr unsigned cubes = 1024; // along each axis before numbers come again
    unsigned number = 0;
    for (int axis = 0; axis < 3; ++axis)
        number = number * cubes + (static_cast<unsigned>(std::lround(in_world[axis] / side_m)) & (cubes - 1));
    return static_cast<int>(number);
}

} // namespace

Fit Sequence::start(const Model& model) const { return fit(initial(model), {}, Views(frames_.size(), true), false); }

Fit Sequence::fit(const Fit& from, const Free& free, const Views& used, bool covariance) const {
    Fit fit = from;
    fit.used = used;
    SequenceProblem adjustment(*this, fit);
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
        const auto sightings = std::count_if(tracks_[i].sightings.begin(), tracks_[i].sightings.end(),
                                             [&](const Sighting& s) { return used[s.frame]; });
        if (sightings < 2)
            continue;
        for (const Sighting& s : tracks_[i].sightings)
            if (used[s.frame])
                adjustment.add(i, s);
    }
    for (std::size_t i = 0; i < frames_.size(); ++i)
        if (used[i])
            adjustment.add_outlines(static_cast<int>(i));
    adjustment.hold_gap();
    adjustment.hold_poses(used);
    freeze(adjustment.problem, fit.model, free);
    solve(adjustment.problem, fit, true);
    if (covariance)
        add_covariance(adjustment, fit, free);
    return fit;
}

void Sequence::add_covariance(SequenceProblem& adjustment, Fit& fit, const Free& free) const {
    constexpr double share_of_depth = 0.6; // a piece of furniture: what is seen of it errs together
    const double side_m = share_of_depth * median_of(depths_m(fit));
    std::vector<double*> kept = {adjustment.gap()};
    Clusters clusters{.many = true};
    for (std::size_t i = 0; i < frames_.size(); ++i)
        kept.push_back(adjustment.pose(static_cast<int>(i)));
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
        const Eigen::Map<const Eigen::Vector3d> point(adjustment.point(i));
        clusters.points.push_back({adjustment.point(i), neighbourhood_of(point, side_m)});
    }
    for (const auto& [block, in_world] : adjustment.outlines)
        clusters.pointless[block] = neighbourhood_of(in_world, side_m);
    calibration::add_covariance(adjustment.problem, fit, free, kept, clusters);
    // Surfaces and edges were chosen by a fit and hold it there, which no residual shows (Censi 2007 of scans laid onto
    // each other): errors were 1.9 of the sigmas that residuals alone tell, as the test of honest sigmas measures.
    constexpr double by_choice = 2;
    if (!options_.registered)
        fit.covariance *= by_choice * by_choice;
}

std::vector<ViewScore> Sequence::score(const Fit& from, const Views& wanted) const {
    Fit fit = from;
    std::vector<bool> known(tracks_.size());
    for (std::size_t i = 0; i < tracks_.size(); ++i)
        known[i] = std::count_if(tracks_[i].sightings.begin(), tracks_[i].sightings.end(),
                                 [&](const Sighting& s) { return fit.used[s.frame]; }) >= 2;
    std::vector<ViewScore> scores(frames_.size());
    for (std::size_t frame = 0; frame < frames_.size(); ++frame) {
        if (!wanted[frame])
            continue;
        SequenceProblem adjustment(*this, fit);
        for (std::size_t i = 0; i < tracks_.size(); ++i)
            for (const Sighting& s : tracks_[i].sightings)
                if (s.frame == static_cast<int>(frame) && known[i]) {
                    adjustment.add(i, s);
                    adjustment.problem.SetParameterBlockConstant(adjustment.point(i));
                }
        if (adjustment.sightings.size() < 6)
            continue;
        adjustment.add_outlines(static_cast<int>(frame));
        if (adjustment.problem.HasParameterBlock(adjustment.gap()))
            adjustment.problem.SetParameterBlockConstant(adjustment.gap());
        freeze(adjustment.problem, fit.model, {});
        if (options_.refine_poses)
            adjustment.hold_near_recorded(static_cast<int>(frame));
        else if (adjustment.problem.HasParameterBlock(adjustment.pose(static_cast<int>(frame))))
            adjustment.problem.SetParameterBlockConstant(adjustment.pose(static_cast<int>(frame)));
        Fit alone = fit; // the pose is fitted in place; rss is this view's
        solve(adjustment.problem, alone, false);
        scores[frame] = {alone.rss, static_cast<int>(adjustment.sightings.size())};
    }
    return scores;
}

std::vector<cv::Point2d> Sequence::pixels_of(std::size_t view) const {
    std::vector<cv::Point2d> all;
    for (const Point& point : tracks_)
        for (const Sighting& s : point.sightings)
            if (s.frame == static_cast<int>(view))
                all.emplace_back(s.pixel.x(), s.pixel.y());
    return all;
}

std::vector<Eigen::Vector2d> Sequence::residuals(const Fit& from, std::size_t view) const {
    Fit fit = from;
    std::vector<Eigen::Vector2d> all;
    for (std::size_t i = 0; i < tracks_.size(); ++i)
        for (const Sighting& s : tracks_[i].sightings)
            if (s.frame == static_cast<int>(view)) {
                SequenceProblem single(*this, fit);
                single.add(i, s);
                std::vector<double> r;
                single.problem.Evaluate({}, nullptr, &r, nullptr, nullptr);
                all.emplace_back(r[0], r[1]);
            }
    return all;
}

std::vector<double> Sequence::depths_m(const Fit& fit) const {
    std::vector<double> depths;
    for (std::size_t i = 0; i < tracks_.size(); ++i)
        for (const Sighting& s : tracks_[i].sightings) {
            const Eigen::Map<const Eigen::Vector3d> point(
                &fit.nuisance[frames_.size() * pose_unknowns + i * point_unknowns]);
            depths.push_back((from_six(&fit.nuisance[s.frame * pose_unknowns]) * point).z());
        }
    return depths;
}

std::vector<Eigen::Isometry3d> Sequence::poses(const Fit& fit) const {
    std::vector<Eigen::Isometry3d> all;
    for (std::size_t i = 0; i < frames_.size(); ++i)
        all.push_back(from_six(&fit.nuisance[i * pose_unknowns]).inverse());
    return all;
}

std::size_t Sequence::outline_points() const {
    std::size_t sum = 0;
    for (const auto& pairs : pairs_)
        sum += pairs.size();
    return sum;
}

bool Sequence::tells_time() const {
    return !options_.refine_poses &&
           std::any_of(frames_.begin(), frames_.end(), [](const SequenceFrame& frame) { return frame.motion.any(); });
}

std::size_t Sequence::sightings() const {
    std::size_t sum = 0;
    for (const Point& point : tracks_)
        sum += point.sightings.size();
    return sum;
}

std::string Sequence::degeneracy(const Fit& fit) const {
    constexpr double least_turn_degrees = 2, least_shift = 0.02; // of the median depth
    const std::vector<Eigen::Isometry3d> all = poses(fit);
    const double depth_m = median_of(depths_m(fit));
    Eigen::Vector3d low = Eigen::Vector3d::Constant(1e9), high = -low;
    double turn = 0;
    for (const Eigen::Isometry3d& pose : all) {
        const Eigen::Isometry3d here = all.front().inverse() * pose;
        low = low.cwiseMin(here.translation());
        high = high.cwiseMax(here.translation());
        turn = std::max(turn, Eigen::AngleAxisd(here.linear()).angle() * 180 / CV_PI);
    }
    const Eigen::Vector3d reach = high - low;
    if (frames_.size() < 3)
        return fmt::format("{} frames, at least 3 expected", frames_.size());
    if (reach.norm() < least_shift * depth_m && turn < least_turn_degrees)
        return fmt::format("the camera hardly moves: {:.0f} mm and {:.1f} degrees before a scene {:.1f} m away",
                           1000 * reach.norm(), turn, depth_m);
    if (turn < least_turn_degrees && reach.head<2>().norm() < 0.2 * reach.z())
        return fmt::format(
            "the camera moves straight forward ({:.0f} mm along its axis, {:.0f} mm across, {:.1f} degrees): "
            "focal length and distance cannot be told apart",
            1000 * reach.z(), 1000 * reach.head<2>().norm(), turn);
    return {};
}

std::vector<cv::Mat1f> Sequence::depth_images() const {
    std::vector<cv::Mat1f> images;
    for (const SequenceFrame& frame : frames_)
        images.push_back(frame.depth_m);
    return images;
}

} // namespace scanshade::calibration
