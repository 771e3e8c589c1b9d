// A recording made ready for adjustment: tracks lifted, poses found where none were recorded, outliers left out.
#include "projection/calibration/recording/sequence.h"
#include "projection/calibration/recording/sequence_adjustment.h"
#include "projection/error.h"

#include <algorithm>
#include <Eigen/Dense>
#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

namespace scanshade::calibration {

namespace {
constexpr double unusable = -1; // a sighting's depth that does not fit
}

Sequence::Sequence(std::vector<SequenceFrame> frames, const Camera& depth_camera, const Model& first,
                   const SequenceOptions& options)
    : frames_(std::move(frames)), depth_camera_(depth_camera), options_(options), weights_(frames_.size(), 1.0) {
    std::vector<cv::Mat1b> images;
    for (const SequenceFrame& frame : frames_)
        images.push_back(frame.grey);
    for (const Track& track : find_tracks(images)) {
        Point point;
        for (const Track::Sighting& seen : track.sightings) {
            const Eigen::Vector2d pixel(seen.pixel.x, seen.pixel.y);
            point.sightings.push_back(
                {seen.frame, pixel, options_.registered ? depth_at(frames_[seen.frame].depth_m, pixel) : 0});
        }
        if (useful(point))
            tracks_.push_back(std::move(point));
    }
    constexpr std::size_t least = 40;
    if (tracks_.size() < least)
        throw Error(
            fmt::format("{} points are seen in 3 or more of {} images, at least {} expected: too little texture, or "
                        "frames too far apart",
                        tracks_.size(), frames_.size(), least));
    follow_camera(first);
    if (options_.registered || !options_.outlines) {
        prune(first, first);
    } else {
        const Model near = place_by_outlines(first);
        prune(near, first);
        pair_ever_nearer(near, first);
    }
    if (tracks_.size() < least)
        throw Error(
            fmt::format("{} points fit together, at least {} expected: the poses, the depth unit or the camera are far "
                        "off",
                        tracks_.size(), least));
}

/// From where the most outlines find an edge: of all places that tracks allow, since the nearest edge is often another
/// one.
Model Sequence::place_by_outlines(const Model& first) {
    for (const SequenceFrame& frame : frames_) {
        outlines_.push_back(outline_of(frame.depth_m, depth_camera_));
        edges_.push_back(colour_edges_of(frame.grey));
    }
    leave_out_absurd(initial(first));
    const Model near = placed_by_outlines(outlines_, edges_, robust_fit(initial(first), first).model, first);
    constexpr double reach_px = 8; // a step of the search, and what tracks have wrong
    pair_outlines(initial(near), reach_px);
    return near;
}

/// As the nearest point of a surface is found, in turns with the place: points slide along their surfaces, edges along
/// theirs, so that it takes a few rounds.
void Sequence::pair_ever_nearer(const Model& near, const Model& first) {
    constexpr int rounds = 10;
    constexpr double nearest_px = 2;
    Fit fit = robust_fit(initial(near), first);
    for (int round = 0; round < rounds; ++round) {
        pair_outlines(fit, std::max(nearest_px, 5.0 - round));
        fit = robust_fit(fit, first);
        leave_out_far_outlines(fit);
    }
}

void Sequence::pair_outlines(const Fit& fit, double reach_px) {
    pairs_.assign(frames_.size(), {});
    for (std::size_t i = 0; i < frames_.size(); ++i)
        pairs_[i] = paired(outlines_[i], gap_px(fit), edges_[i], fit.model, reach_px);
}

/// Scales the outlines' sigma to what is seen, and leaves out what is farther off than three of them.
void Sequence::leave_out_far_outlines(const Fit& from) {
    constexpr double most_sigmas = 3;
    Fit fit = from;
    std::vector<std::vector<double>> misses(frames_.size());
    std::vector<double> all;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
        SequenceProblem alone(*this, fit);
        alone.add_outlines(static_cast<int>(i));
        alone.problem.Evaluate({}, nullptr, &misses[i], nullptr, nullptr);
        for (double& miss : misses[i]) {
            miss = std::abs(miss) * outline_sigma_px_ / (options_.pixel_sigma_px * SequenceProblem::outline_share);
            all.push_back(miss);
        }
    }
    if (all.empty())
        return;
    outline_sigma_px_ = std::max(0.3, median_of(all) / 0.674); // of a Gaussian; an edge has its pixel's width
    for (std::size_t i = 0; i < frames_.size(); ++i) {
        std::vector<OutlinePair> kept;
        for (std::size_t pair = 0; pair < pairs_[i].size(); ++pair)
            if (misses[i][pair] <= most_sigmas * outline_sigma_px_)
                kept.push_back(pairs_[i][pair]);
        pairs_[i] = std::move(kept);
    }
}

/// Poses that were not recorded: each frame by what it sees of points lifted in frames before.
void Sequence::follow_camera(const Model& first) {
    const bool all =
        std::all_of(frames_.begin(), frames_.end(), [](const auto& frame) { return frame.world_from_camera; });
    start_poses_.assign(frames_.size(), Eigen::Isometry3d::Identity());
    if (all) {
        for (std::size_t i = 0; i < frames_.size(); ++i)
            start_poses_[i] = *frames_[i].world_from_camera;
        return;
    }
    if (!options_.registered)
        throw Error("the frames have no poses, and colour and depth are not registered: one of both is needed");
    const Camera camera = camera_of(first);
    std::vector<std::optional<Eigen::Vector3d>> world(tracks_.size());
    for (int frame = 0; frame < static_cast<int>(frames_.size()); ++frame) {
        if (frame > 0)
            start_poses_[frame] = placed_by_points(frame, camera, world);
        for (std::size_t i = 0; i < tracks_.size(); ++i)
            for (const Sighting& s : tracks_[i].sightings)
                if (s.frame == frame && s.depth_m > 0 && !world[i])
                    world[i] = start_poses_[frame] * (s.depth_m * ray_of(camera, s.pixel));
    }
}

/// The pose from which a frame sees the points that are known already (EPnP in RANSAC, then least squares).
Eigen::Isometry3d Sequence::placed_by_points(int frame, const Camera& camera,
                                             const std::vector<std::optional<Eigen::Vector3d>>& world) const {
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> straight;
    for (std::size_t i = 0; i < tracks_.size(); ++i)
        for (const Sighting& s : tracks_[i].sightings)
            if (s.frame == frame && world[i]) {
                points.emplace_back(world[i]->x(), world[i]->y(), world[i]->z());
                const Eigen::Vector2d direction = straight_of(camera, s.pixel);
                straight.emplace_back(direction.x(), direction.y());
            }
    cv::Vec3d turn, shift;
    std::vector<int> good;
    constexpr std::size_t least = 12;
    const auto reach = static_cast<float>(4 / camera.pinhole.fx);
    if (points.size() < least ||
        !cv::solvePnPRansac(points, straight, cv::Matx33d::eye(), cv::noArray(), turn, shift, false, 300, reach, 0.999,
                            good, cv::SOLVEPNP_EPNP) ||
        good.size() < least)
        throw Error(
            fmt::format("{}: its place cannot be found: {} of its points are known from the frames before, {} fit; "
                        "at least {} expected",
                        frames_[frame].name, points.size(), good.size(), least));
    cv::solvePnPRefineLM(points, straight, cv::Matx33d::eye(), cv::noArray(), turn, shift);
    const double six[pose_unknowns] = {turn[0], turn[1], turn[2], shift[0], shift[1], shift[2]};
    return from_six(six).inverse();
}

Fit Sequence::initial(const Model& model) const {
    Fit fit{.model = model, .used = Views(frames_.size(), true)};
    fit.nuisance.resize(frames_.size() * pose_unknowns + tracks_.size() * point_unknowns + 1);
    fit.nuisance.back() = expected_gap_px;
    for (std::size_t i = 0; i < frames_.size(); ++i)
        to_six(start_poses_[i].inverse(), &fit.nuisance[i * pose_unknowns]);
    const Camera camera = calibration::camera_of(model);
    const Eigen::Isometry3d depth_from_colour = from_six(model.values.data() + turn_x).inverse();
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
        Eigen::Vector3d lifted = Eigen::Vector3d::Zero(), sides = Eigen::Vector3d::Zero();
        Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
        int count = 0;
        for (const Sighting& s : tracks_[i].sightings) {
            const Eigen::Isometry3d world_from_colour = start_poses_[s.frame] * depth_from_colour;
            const Eigen::Vector3d ray = ray_of(camera, s.pixel);
            if (s.depth_m > 0) {
                lifted += start_poses_[s.frame] * (ray * s.depth_m);
                ++count;
            }
            const Eigen::Vector3d direction = (world_from_colour.linear() * ray).normalized();
            const Eigen::Matrix3d side = Eigen::Matrix3d::Identity() - direction * direction.transpose();
            across += side;
            sides += side * world_from_colour.translation();
        }
        const Eigen::Vector3d meeting = across.ldlt().solve(sides); // nearest to all rays
        Eigen::Map<Eigen::Vector3d>(&fit.nuisance[frames_.size() * pose_unknowns + i * point_unknowns]) =
            count > 0 ? Eigen::Vector3d(lifted / count) : meeting;
    }
    return fit;
}

bool Sequence::useful(const Point& point) const {
    const bool lifted =
        std::any_of(point.sightings.begin(), point.sightings.end(), [](const auto& s) { return s.depth_m > 0; });
    return point.sightings.size() >= 3 && (lifted || !options_.registered);
}

/// Points must lie before each camera that sees them, and not absurdly far.
void Sequence::leave_out_absurd(const Fit& fit) {
    std::vector<Point> kept;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
        const Eigen::Map<const Eigen::Vector3d> point(
            &fit.nuisance[frames_.size() * pose_unknowns + i * point_unknowns]);
        const bool sound =
            std::all_of(tracks_[i].sightings.begin(), tracks_[i].sightings.end(), [&](const Sighting& s) {
                const double z = (from_six(&fit.nuisance[s.frame * pose_unknowns]) * point).z();
                return z > 0.1 && z < 30;
            });
        if (sound)
            kept.push_back(std::move(tracks_[i]));
    }
    tracks_ = std::move(kept);
}

/// Of unregistered frames: the piece of surface nearest to where each point is, along the depth camera's ray.
void Sequence::find_surfaces(const Fit& fit) {
    constexpr double same_surface = 0.05; // of the depth: farther off it is another one, and says nothing of this point
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
        const Eigen::Map<const Eigen::Vector3d> point(
            &fit.nuisance[frames_.size() * pose_unknowns + i * point_unknowns]);
        for (Sighting& s : tracks_[i].sightings) {
            const Eigen::Vector3d in_depth = from_six(&fit.nuisance[s.frame * pose_unknowns]) * point;
            s.surface = {};
            if (s.depth_m != unusable)
                s.surface = surface_at(frames_[s.frame].depth_m, depth_camera_.pinhole, in_depth);
            if (s.surface &&
                std::abs(s.surface->normal.dot(in_depth - s.surface->centre)) > same_surface * in_depth.z())
                s.surface = {};
        }
    }
}

/// With the usual suspects free: a wrong camera must not cost the image's corners.
Fit Sequence::robust_fit(const Fit& from, const Model& first) {
    constexpr double robust_px = 1;
    Fit fit = from;
    if (!options_.registered)
        find_surfaces(fit);
    SequenceProblem adjustment(*this, fit);
    for (std::size_t i = 0; i < tracks_.size(); ++i)
        for (const Sighting& s : tracks_[i].sightings)
            adjustment.add(i, s, new ceres::CauchyLoss(robust_px));
    for (std::size_t i = 0; i < frames_.size(); ++i)
        adjustment.add_outlines(static_cast<int>(i), true);
    adjustment.hold_gap();
    adjustment.hold_place(first);
    Free free{};
    free[f] = free[k1] = true;
    free[cx] = free[cy] = options_.registered; // beside a turn of the camera the principal point is hardly seen
    for (int i = turn_x; i < time_offset; ++i)
        free[i] = !options_.registered;
    free[time_offset] = tells_time();
    free[depth_scale] = free[depth_offset] = options_.registered && !options_.refine_poses;
    adjustment.hold_poses(fit.used);
    freeze(adjustment.problem, fit.model, free);
    solve(adjustment.problem, fit, true);
    return fit;
}

std::vector<std::vector<Sequence::Miss>> Sequence::misses_of(const Fit& from) const {
    Fit fit = from;
    std::vector<std::vector<Miss>> all(tracks_.size());
    for (std::size_t i = 0; i < tracks_.size(); ++i)
        for (const Sighting& s : tracks_[i].sightings) {
            SequenceProblem single(*this, fit);
            single.add(i, s);
            std::vector<double> r;
            single.problem.Evaluate({}, nullptr, &r, nullptr, nullptr);
            all[i].push_back({std::hypot(r[0], r[1]), r.size() > 2 ? std::abs(r[2]) : std::nan("")});
        }
    return all;
}

void Sequence::leave_out_beyond(const std::vector<std::vector<Miss>>& misses, const Miss& most) {
    std::vector<Point> kept;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
        Point point;
        for (std::size_t s = 0; s < tracks_[i].sightings.size(); ++s) {
            if (misses[i][s].pixels > most.pixels)
                continue;
            point.sightings.push_back(tracks_[i].sightings[s]);
            if (misses[i][s].depth > most.depth) {
                point.sightings.back().depth_m = unusable;
                point.sightings.back().surface = {};
            }
        }
        if (useful(point))
            kept.push_back(std::move(point));
    }
    tracks_ = std::move(kept);
}

/// Leaves out what does not fit, judged by a robust fit, and scales the depths' sigma to the pixels', by the residuals
/// of each.
void Sequence::prune(Model near, const Model& first) {
    constexpr double most_sigmas = 4;
    for (int round = 0; round < 3 && !tracks_.empty(); ++round) {
        leave_out_absurd(initial(near));
        const Fit fit = robust_fit(initial(near), first);
        if (!options_.registered) // so that each point is looked for on the surface that it lies on
            near = fit.model;
        const std::vector<std::vector<Miss>> misses = misses_of(fit);
        std::vector<double> pixels, depths;
        for (const auto& of_track : misses)
            for (const Miss& miss : of_track) {
                pixels.push_back(miss.pixels);
                if (!std::isnan(miss.depth))
                    depths.push_back(miss.depth);
            }
        // Of a two-dimensional Gaussian the median distance is 1.18 sigma, of a one-dimensional one 0.674.
        const double pixel_sigma = median_of(pixels) / 1.177, depth_sigma = median_of(depths) / 0.674;
        leave_out_beyond(misses, {most_sigmas * pixel_sigma, most_sigmas * depth_sigma});
        if (depth_sigma > 0)
            depth_weight_ *= pixel_sigma / depth_sigma;
        if (options_.refine_poses)
            for (std::size_t i = 0; i < frames_.size(); ++i)
                start_poses_[i] = from_six(&fit.nuisance[i * pose_unknowns]).inverse();
    }
}

} // namespace scanshade::calibration
