// Lifts tracks, estimates missing poses, pairs outlines with colour edges, and removes outliers.
#include "projection/calibration/recording/sequence_setup.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/calibration/recording/sequence_adjustment.h"
#include "projection/calibration/recording/tracks.h"

#include <algorithm>
#include <Eigen/Dense>
#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

namespace scanshade::calibration {
namespace {

constexpr double unusable = -1; // an observation's depth that is an outlier

/// Sizes of an observation's residuals, in the residuals' unit.
struct ErrorSize {
    double pixels = 0, depth = 0;
};

/// Worth keeping: observed often enough, with a depth somewhere.
bool useful(const ScenePoint& point, const SequenceOptions& options) {
    const bool lifted =
        std::any_of(point.observations.begin(), point.observations.end(), [](const auto& s) { return s.depth_m > 0; });
    return point.observations.size() >= 3 && (lifted || !options.registered);
}

Eigen::Map<const Eigen::Vector3d> point_in_world(const SequenceObservations& all, const Fit& fit, std::size_t point) {
    return Eigen::Map<const Eigen::Vector3d>(&fit.nuisance[point_offset(all, point)]);
}

// ---------------------------------------------------------------------------------------------------- poses

/// The pose from which a frame sees the points that are already known (EPnP in RANSAC, then least squares).
Eigen::Isometry3d absolute_pose(const SequenceObservations& all, int frame, const Camera& camera,
                                const std::vector<std::optional<Eigen::Vector3d>>& world) {
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> rays;
    for (std::size_t i = 0; i < all.points.size(); ++i)
        for (const PointObservation& s : all.points[i].observations)
            if (s.frame == frame && world[i]) {
                points.emplace_back(world[i]->x(), world[i]->y(), world[i]->z());
                const Eigen::Vector2d direction = undistorted_direction(camera, s.pixel);
                rays.emplace_back(direction.x(), direction.y());
            }
    cv::Vec3d rotation, translation;
    std::vector<int> inliers;
    constexpr std::size_t least = 12;
    const auto reach = static_cast<float>(4 / camera.pinhole.fx);
    if (points.size() < least ||
        !cv::solvePnPRansac(points, rays, cv::Matx33d::eye(), cv::noArray(), rotation, translation, false, 300, reach,
                            0.999, inliers, cv::SOLVEPNP_EPNP) ||
        inliers.size() < least)
        throw Error(fmt::format("{}: its pose cannot be found: it shows {} points of earlier frames, {} of them fit; "
                                "at least {} expected",
                                all.frames[frame].name, points.size(), inliers.size(), least));
    cv::solvePnPRefineLM(points, rays, cv::Matx33d::eye(), cv::noArray(), rotation, translation);
    const double pose[pose_unknowns] = {rotation[0],    rotation[1],    rotation[2],
                                        translation[0], translation[1], translation[2]};
    return pose_from_parameters(pose).inverse();
}

/// Where poses were not recorded: each frame's pose from the points that earlier frames have lifted.
void estimate_missing_poses(SequenceObservations& all, const Model& first) {
    const bool recorded =
        std::all_of(all.frames.begin(), all.frames.end(), [](const auto& frame) { return frame.world_from_camera; });
    all.start_poses.assign(all.frames.size(), Eigen::Isometry3d::Identity());
    if (recorded) {
        for (std::size_t i = 0; i < all.frames.size(); ++i)
            all.start_poses[i] = *all.frames[i].world_from_camera;
        return;
    }
    if (!all.options.registered)
        throw Error("the frames have no poses, and colour and depth are not registered: one of both is needed");
    const Camera camera = camera_of(first);
    std::vector<std::optional<Eigen::Vector3d>> world(all.points.size());
    for (int frame = 0; frame < static_cast<int>(all.frames.size()); ++frame) {
        if (frame > 0)
            all.start_poses[frame] = absolute_pose(all, frame, camera, world);
        for (std::size_t i = 0; i < all.points.size(); ++i)
            for (const PointObservation& s : all.points[i].observations)
                if (s.frame == frame && s.depth_m > 0 && !world[i])
                    world[i] = all.start_poses[frame] * (s.depth_m * ray_of(camera, s.pixel));
    }
}

// ---------------------------------------------------------------------------------------------------- robust fits

/// Of unregistered frames: the piece of surface nearest to each point, along the depth camera's ray.
void find_surfaces(SequenceObservations& all, const Fit& fit) {
    constexpr double same_surface = 0.05; // of the depth: a surface farther off is not this point's
    for (std::size_t i = 0; i < all.points.size(); ++i) {
        const auto point = point_in_world(all, fit, i);
        for (PointObservation& s : all.points[i].observations) {
            const Eigen::Vector3d in_depth = pose_from_parameters(&fit.nuisance[s.frame * pose_unknowns]) * point;
            s.surface = {};
            if (s.depth_m != unusable)
                s.surface = surface_at(all.frames[s.frame].depth_m, all.depth_camera.pinhole, in_depth);
            if (s.surface &&
                std::abs(s.surface->normal.dot(in_depth - s.surface->centre)) > same_surface * in_depth.z())
                s.surface = {};
        }
    }
}

/// Frees the most likely errors: a wrong camera must not cost the corners of the image.
Fit robust_fit(SequenceObservations& all, const Fit& from, const Model& first) {
    constexpr double robust_px = 1;
    Fit fit = from;
    if (!all.options.registered)
        find_surfaces(all, fit);
    SequenceAdjustment adjustment(all, fit);
    for (std::size_t i = 0; i < all.points.size(); ++i)
        for (const PointObservation& s : all.points[i].observations)
            adjustment.add(i, s, new ceres::CauchyLoss(robust_px));
    for (std::size_t i = 0; i < all.frames.size(); ++i)
        adjustment.add_outlines(static_cast<int>(i), true);
    adjustment.add_gap_prior();
    adjustment.add_extrinsics_prior(first);
    Free free{};
    free[f] = free[k1] = true;
    free[cx] = free[cy] = all.options.registered; // a rotation of the camera compensates the principal point
    for (int i = rotation_x; i < time_offset; ++i)
        free[i] = !all.options.registered;
    free[time_offset] = all.determines_time();
    free[depth_scale] = free[depth_offset] = all.options.registered && !all.options.refine_poses;
    adjustment.add_pose_priors(fit.used);
    fix(adjustment.problem, fit.model, free);
    solve(adjustment.problem, fit, true);
    return fit;
}

/// Removes points that are not in front of each of their cameras, or absurdly far.
void remove_implausible_points(SequenceObservations& all, const Fit& fit) {
    std::vector<ScenePoint> kept;
    for (std::size_t i = 0; i < all.points.size(); ++i) {
        const auto point = point_in_world(all, fit, i);
        const std::vector<PointObservation>& observations = all.points[i].observations;
        const bool plausible = std::all_of(observations.begin(), observations.end(), [&](const PointObservation& s) {
            const double z = (pose_from_parameters(&fit.nuisance[s.frame * pose_unknowns]) * point).z();
            return z > 0.1 && z < 30;
        });
        if (plausible)
            kept.push_back(std::move(all.points[i]));
    }
    all.points = std::move(kept);
}

// ---------------------------------------------------------------------------------------------------- outlines

void pair_outlines(SequenceObservations& all, const Fit& fit, double reach_px) {
    all.pairs.assign(all.frames.size(), {});
    for (std::size_t i = 0; i < all.frames.size(); ++i)
        all.pairs[i] = paired(all.outlines[i], fit.nuisance.back(), all.edges[i], fit.model, reach_px);
}

/// Scales the outlines' sigma to their errors, and removes pairs beyond three of them.
void remove_outlying_pairs(SequenceObservations& all, const Fit& from) {
    constexpr double most_sigmas = 3;
    Fit fit = from;
    std::vector<std::vector<double>> errors(all.frames.size());
    std::vector<double> sizes;
    for (std::size_t i = 0; i < all.frames.size(); ++i) {
        SequenceAdjustment alone(all, fit);
        alone.add_outlines(static_cast<int>(i));
        alone.problem.Evaluate({}, nullptr, &errors[i], nullptr, nullptr);
        for (double& error : errors[i]) {
            error = std::abs(error) * all.outline_sigma_px /
                    (all.options.pixel_sigma_px * SequenceAdjustment::outline_share);
            sizes.push_back(error);
        }
    }
    if (sizes.empty())
        return;
    constexpr double edge_width_px = 0.3; // the sigma of a perfect edge
    all.outline_sigma_px = std::max(edge_width_px, median(sizes) / median_of_gaussian);
    for (std::size_t i = 0; i < all.frames.size(); ++i) {
        std::vector<OutlinePair> kept;
        for (std::size_t pair = 0; pair < all.pairs[i].size(); ++pair)
            if (errors[i][pair] <= most_sigmas * all.outline_sigma_px)
                kept.push_back(all.pairs[i][pair]);
        all.pairs[i] = std::move(kept);
    }
}

/// Starts from the extrinsics at which most outlines meet an edge. All extrinsics that tracks allow are searched,
/// because the nearest edge is often the wrong one.
Model start_from_outlines(SequenceObservations& all, const Model& first) {
    for (const SequenceFrame& frame : all.frames) {
        all.outlines.push_back(outline_of(frame.depth_m, all.depth_camera));
        all.edges.push_back(colour_edges_of(frame.grey));
    }
    remove_implausible_points(all, initial_fit(all, first));
    const Model near =
        extrinsics_from_outlines(all.outlines, all.edges, robust_fit(all, initial_fit(all, first), first).model, first);
    constexpr double reach_px = 8; // a step of the search plus the error of tracks
    pair_outlines(all, initial_fit(all, near), reach_px);
    return near;
}

/// Alternates between pairing and fitting, as ICP does. Points slide along their surfaces and edges along theirs, so
/// that convergence takes several rounds.
void pair_and_fit_outlines(SequenceObservations& all, const Model& near, const Model& first) {
    constexpr int rounds = 10;
    constexpr double nearest_px = 2;
    Fit fit = robust_fit(all, initial_fit(all, near), first);
    for (int round = 0; round < rounds; ++round) {
        pair_outlines(all, fit, std::max(nearest_px, 5.0 - round));
        fit = robust_fit(all, fit, first);
        remove_outlying_pairs(all, fit);
    }
}

// ---------------------------------------------------------------------------------------------------- outliers

std::vector<std::vector<ErrorSize>> errors_of(const SequenceObservations& all, const Fit& from) {
    Fit fit = from;
    std::vector<std::vector<ErrorSize>> errors(all.points.size());
    for (std::size_t i = 0; i < all.points.size(); ++i)
        for (const PointObservation& s : all.points[i].observations) {
            SequenceAdjustment single(all, fit);
            single.add(i, s);
            std::vector<double> r;
            single.problem.Evaluate({}, nullptr, &r, nullptr, nullptr);
            errors[i].push_back({std::hypot(r[0], r[1]), r.size() > 2 ? std::abs(r[2]) : std::nan("")});
        }
    return errors;
}

void remove_outliers(SequenceObservations& all, const std::vector<std::vector<ErrorSize>>& errors,
                     const ErrorSize& most) {
    std::vector<ScenePoint> kept;
    for (std::size_t i = 0; i < all.points.size(); ++i) {
        ScenePoint point;
        for (std::size_t s = 0; s < all.points[i].observations.size(); ++s) {
            if (errors[i][s].pixels > most.pixels)
                continue;
            point.observations.push_back(all.points[i].observations[s]);
            if (errors[i][s].depth > most.depth) {
                point.observations.back().depth_m = unusable;
                point.observations.back().surface = {};
            }
        }
        if (useful(point, all.options))
            kept.push_back(std::move(point));
    }
    all.points = std::move(kept);
}

/// Removes outliers of a robust fit, and scales the depths' sigma to that of the pixels by the residuals of each.
void prune(SequenceObservations& all, Model near, const Model& first) {
    constexpr double most_sigmas = 4;
    for (int round = 0; round < 3 && !all.points.empty(); ++round) {
        remove_implausible_points(all, initial_fit(all, near));
        const Fit fit = robust_fit(all, initial_fit(all, near), first);
        if (!all.options.registered) // so that each point finds the surface that it lies on
            near = fit.model;
        const std::vector<std::vector<ErrorSize>> errors = errors_of(all, fit);
        std::vector<double> pixels, depths;
        for (const auto& of_point : errors)
            for (const ErrorSize& error : of_point) {
                pixels.push_back(error.pixels);
                if (!std::isnan(error.depth))
                    depths.push_back(error.depth);
            }
        constexpr double median_of_gaussian_2d = 1.177; // of the distance, in sigmas
        const double pixel_sigma = median(pixels) / median_of_gaussian_2d,
                     depth_sigma = median(depths) / median_of_gaussian;
        remove_outliers(all, errors, {most_sigmas * pixel_sigma, most_sigmas * depth_sigma});
        if (depth_sigma > 0)
            all.depth_weight *= pixel_sigma / depth_sigma;
        if (all.options.refine_poses)
            for (std::size_t i = 0; i < all.frames.size(); ++i)
                all.start_poses[i] = pose_from_parameters(&fit.nuisance[i * pose_unknowns]).inverse();
    }
}

} // namespace

SequenceObservations observe_sequence(std::vector<SequenceFrame> frames, const Camera& depth_camera, const Model& first,
                                      const SequenceOptions& options) {
    SequenceObservations all{.frames = std::move(frames), .depth_camera = depth_camera, .options = options};
    all.weights.assign(all.frames.size(), 1.0);
    std::vector<cv::Mat1b> images;
    for (const SequenceFrame& frame : all.frames)
        images.push_back(frame.grey);
    for (const Track& track : find_tracks(images)) {
        ScenePoint point;
        for (const Track::Observation& s : track.observations) {
            const Eigen::Vector2d pixel(s.pixel.x, s.pixel.y);
            point.observations.push_back(
                {s.frame, pixel, options.registered ? depth_at(all.frames[s.frame].depth_m, pixel) : 0});
        }
        if (useful(point, options))
            all.points.push_back(std::move(point));
    }
    constexpr std::size_t least = 40;
    if (all.points.size() < least)
        throw Error(fmt::format("{} points are seen in 3 or more of {} images, at least {} expected: too little "
                                "texture, or frames too far apart",
                                all.points.size(), all.frames.size(), least));
    estimate_missing_poses(all, first);
    if (options.registered || !options.outlines) {
        prune(all, first, first);
    } else {
        const Model near = start_from_outlines(all, first);
        prune(all, near, first);
        pair_and_fit_outlines(all, near, first);
    }
    if (all.points.size() < least)
        throw Error(fmt::format("{} points fit together, at least {} expected: the poses, the depth unit or the camera "
                                "are far off",
                                all.points.size(), least));
    return all;
}

Fit initial_fit(const SequenceObservations& sequence, const Model& model) {
    Fit fit{.model = model, .used = Views(sequence.frames.size(), true)};
    fit.nuisance.resize(point_offset(sequence, sequence.points.size()) + 1);
    fit.nuisance.back() = expected_gap_px;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i)
        to_pose_parameters(sequence.start_poses[i].inverse(), &fit.nuisance[i * pose_unknowns]);
    const Camera camera = camera_of(model);
    const Eigen::Isometry3d depth_from_colour = pose_from_parameters(model.values.data() + rotation_x).inverse();
    for (std::size_t i = 0; i < sequence.points.size(); ++i) {
        Eigen::Vector3d lifted = Eigen::Vector3d::Zero(), centres = Eigen::Vector3d::Zero();
        Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
        int count = 0;
        for (const PointObservation& s : sequence.points[i].observations) {
            const Eigen::Isometry3d world_from_colour = sequence.start_poses[s.frame] * depth_from_colour;
            const Eigen::Vector3d ray = ray_of(camera, s.pixel);
            if (s.depth_m > 0) {
                lifted += sequence.start_poses[s.frame] * (ray * s.depth_m);
                ++count;
            }
            const Eigen::Vector3d direction = (world_from_colour.linear() * ray).normalized();
            const Eigen::Matrix3d across_ray = Eigen::Matrix3d::Identity() - direction * direction.transpose();
            across += across_ray;
            centres += across_ray * world_from_colour.translation();
        }
        const Eigen::Vector3d nearest_to_rays = across.ldlt().solve(centres);
        Eigen::Map<Eigen::Vector3d>(&fit.nuisance[point_offset(sequence, i)]) =
            count > 0 ? Eigen::Vector3d(lifted / count) : nearest_to_rays;
    }
    return fit;
}

} // namespace scanshade::calibration
