// The adjustment of a recording: residuals, first guesses, outliers, scores.
#include "projection/calibration/sequence.h"

#include "projection/calibration/solve.h"
#include "projection/error.h"
#include "projection/undistort.h"

#include <algorithm>
#include <Eigen/Dense>
#include <fmt/format.h>
#include <opencv2/calib3d.hpp>
#include <set>

namespace scanshade::calibration {
namespace {

constexpr int pose_unknowns = 6, point_unknowns = 3;
constexpr double unusable = -1; // a sighting's depth that does not fit

// ---------------------------------------------------------------------------------------------------- residuals

template <class Number>
bool seen_at(LensModel lens, const Number* camera, const Number* in_camera, const Eigen::Vector2d& pixel,
             Number* residual) {
    if (in_camera[2] < Number(0.01))
        return false; // at or behind the camera: the solver takes a shorter step
    pixel_of(lens, camera, in_camera, residual);
    residual[0] -= Number(pixel.x());
    residual[1] -= Number(pixel.y());
    return true;
}

/// One camera for colour and depth.
struct SightingResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* pose, const Number* point, Number* residual) const {
        Number in_camera[3];
        moved(pose, point, in_camera);
        const bool seen = seen_at(lens, camera, in_camera, pixel, residual);
        residual[0] *= Number(weight);
        residual[1] *= Number(weight);
        return seen;
    }
};

/// A colour camera beside the depth camera whose pose it is.
struct PlacedSightingResidual {
    LensModel lens;
    Eigen::Vector2d pixel;
    double weight;
    template <class Number>
    bool operator()(const Number* camera, const Number* place, const Number* pose, const Number* point,
                    Number* residual) const {
        Number in_depth[3], in_camera[3];
        moved(pose, point, in_depth);
        moved(place, in_depth, in_camera);
        const bool seen = seen_at(lens, camera, in_camera, pixel, residual);
        residual[0] *= Number(weight);
        residual[1] *= Number(weight);
        return seen;
    }
};

/// The depth recorded at the sighting is the point's.
struct DepthResidual {
    double depth_m, weight;
    template <class Number>
    bool operator()(const Number* depth, const Number* pose, const Number* point, Number* residual) const {
        Number in_camera[3];
        moved(pose, point, in_camera);
        const Number true_depth =
            depth[0] * Number(depth_m) + depth[1] + depth[2] * Number(depth_m * depth_m); // scale, offset, curve
        residual[0] = Number(weight) * (in_camera[2] - true_depth);
        return true;
    }
};

/// The point lies on a piece of the surface that the depth camera saw.
struct SurfaceResidual {
    Eigen::Vector3d on_surface, normal;
    double weight;
    template <class Number>
    bool operator()(const Number* pose, const Number* point, Number* residual) const {
        Number in_camera[3];
        moved(pose, point, in_camera);
        residual[0] = Number(0);
        for (int i = 0; i < 3; ++i)
            residual[0] += Number(normal[i]) * (in_camera[i] - Number(on_surface[i]));
        residual[0] *= Number(weight);
        return true;
    }
};

/// A recorded pose is near the truth: how far the camera has turned and moved from it, in sigmas.
struct PoseResidual {
    Eigen::Quaterniond camera_from_world;
    Eigen::Vector3d centre;
    double turn_weight, shift_weight;
    template <class Number>
    bool operator()(const Number* pose, Number* residual) const {
        const Number back[4] = {Number(camera_from_world.w()), Number(-camera_from_world.x()),
                                Number(-camera_from_world.y()), Number(-camera_from_world.z())};
        Number turn[4], difference[4], moved_by[3];
        ceres::AngleAxisToQuaternion(pose, turn);
        ceres::QuaternionProduct(turn, back, difference);
        ceres::QuaternionToAngleAxis(difference, residual);
        const Number against[3] = {-pose[0], -pose[1], -pose[2]};
        ceres::AngleAxisRotatePoint(against, pose + 3, moved_by); // minus the camera's centre
        for (int i = 0; i < 3; ++i) {
            residual[i] *= Number(turn_weight);
            residual[3 + i] = Number(shift_weight) * (moved_by[i] + Number(centre[i]));
        }
        return true;
    }
};

// ---------------------------------------------------------------------------------------------------- small geometry

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

/// The depth of a smooth piece of surface about a pixel: the mean of 3x3, 0 where they do not agree.
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

/// The direction in which a pixel looks, z = 1.
Eigen::Vector3d ray_of(const Camera& camera, const Eigen::Vector2d& pixel) {
    return straight_of(camera, pixel).homogeneous();
}

struct SurfacePiece {
    Eigen::Vector3d centre, normal;
};

/// The plane through the 7x7 depths about a point's pixel; none beside edges and holes.
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

/// A coarse raster of where points were first seen: neighbours there lie on the same surfaces.
int neighbourhood_of(const Eigen::Vector2d& pixel, cv::Size size) {
    constexpr int cells = 7;
    return static_cast<int>(pixel.y() * cells / size.height) * cells + static_cast<int>(pixel.x() * cells / size.width);
}

double median_of(std::vector<double> values) {
    if (values.empty())
        return std::nan("");
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

} // namespace

// ---------------------------------------------------------------------------------------------------- the problem

/// One adjustment: which residuals there are, and whose they are.
class SequenceProblem {
  public:
    SequenceProblem(const Sequence& sequence, Fit& fit) : sequence_(sequence), fit_(fit) {}

    double* pose(int frame) { return &fit_.nuisance[static_cast<std::size_t>(frame) * pose_unknowns]; }
    double* point(std::size_t index) {
        return &fit_.nuisance[sequence_.frames_.size() * pose_unknowns + index * point_unknowns];
    }
    double* place() { return fit_.model.values.data() + turn_x; }

    void add(std::size_t track, const Sequence::Sighting& sighting, ceres::LossFunction* loss = nullptr) {
        const Sequence::Sighting& s = sighting;
        const double weight = sequence_.weights_[s.frame];
        const LensModel lens = fit_.model.lens;
        if (sequence_.options_.registered)
            problem.AddResidualBlock(
                new ceres::AutoDiffCostFunction<SightingResidual, 2, camera_unknowns, pose_unknowns, point_unknowns>(
                    new SightingResidual{lens, s.pixel, weight}),
                loss, fit_.model.values.data(), pose(s.frame), point(track));
        else
            problem.AddResidualBlock(new ceres::AutoDiffCostFunction<PlacedSightingResidual, 2, camera_unknowns,
                                                                     place_unknowns, pose_unknowns, point_unknowns>(
                                         new PlacedSightingResidual{lens, s.pixel, weight}),
                                     loss, fit_.model.values.data(), place(), pose(s.frame), point(track));
        sightings.push_back(problem.NumResidualBlocks() - 1);
        add_depth(track, s, weight, loss);
    }

    /// Keeps poses near the recorded ones, or at them; without any, the first says where the world is.
    void hold_poses(const Views& used) {
        bool first = true;
        for (std::size_t i = 0; i < used.size(); ++i) {
            if (!problem.HasParameterBlock(pose(static_cast<int>(i))))
                continue;
            if (!sequence_.options_.refine_poses || (first && !sequence_.frames_[i].world_from_camera))
                problem.SetParameterBlockConstant(pose(static_cast<int>(i)));
            else
                hold_near_recorded(static_cast<int>(i));
            first = false;
        }
    }

    void hold_near_recorded(int frame) {
        const auto& recorded = sequence_.frames_[frame].world_from_camera;
        if (!recorded)
            return;
        const SequenceOptions& o = sequence_.options_;
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<PoseResidual, 6, pose_unknowns>(
                new PoseResidual{Eigen::Quaterniond(recorded->linear()).inverse().normalized(), recorded->translation(),
                                 o.pixel_sigma_px / o.pose_turn_sigma, o.pixel_sigma_px / o.pose_shift_sigma_m}),
            nullptr, pose(frame));
    }

    /// Sigma of a recorded depth, in the residuals' unit.
    [[nodiscard]] double depth_weight(double z_m) const {
        const SequenceOptions& o = sequence_.options_;
        return sequence_.depth_weight_ * o.pixel_sigma_px / (o.depth_floor_m + o.depth_per_z2 * z_m * z_m);
    }

    ceres::Problem problem;
    std::vector<int> sightings, depths; ///< residual blocks of either kind

  private:
    void add_depth(std::size_t track, const Sequence::Sighting& s, double weight, ceres::LossFunction* loss) {
        if (sequence_.options_.registered) {
            if (s.depth_m <= 0)
                return;
            problem.AddResidualBlock(
                new ceres::AutoDiffCostFunction<DepthResidual, 1, depth_unknowns, pose_unknowns, point_unknowns>(
                    new DepthResidual{s.depth_m, weight * depth_weight(s.depth_m)}),
                loss, fit_.model.values.data() + depth_scale, pose(s.frame), point(track));
        } else if (s.depth_m >= 0) {
            Eigen::Vector3d in_depth;
            moved(pose(s.frame), point(track), in_depth.data());
            const auto surface =
                surface_at(sequence_.frames_[s.frame].depth_m, sequence_.depth_camera_.pinhole, in_depth);
            // Farther off than that it is another surface, and says nothing of this point.
            if (!surface || std::abs(surface->normal.dot(in_depth - surface->centre)) > 0.05 * in_depth.z())
                return;
            problem.AddResidualBlock(
                new ceres::AutoDiffCostFunction<SurfaceResidual, 1, pose_unknowns, point_unknowns>(
                    new SurfaceResidual{surface->centre, surface->normal, weight * depth_weight(in_depth.z())}),
                loss, pose(s.frame), point(track));
        } else {
            return;
        }
        depths.push_back(problem.NumResidualBlocks() - 1);
    }

    const Sequence& sequence_;
    Fit& fit_;
};

// ---------------------------------------------------------------------------------------------------- setting up

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
        const bool lifted =
            std::any_of(point.sightings.begin(), point.sightings.end(), [](const auto& s) { return s.depth_m > 0; });
        if (lifted || !options_.registered)
            tracks_.push_back(std::move(point));
    }
    constexpr std::size_t least = 40;
    if (tracks_.size() < least)
        throw Error(
            fmt::format("{} points are seen in 3 or more of {} images, at least {} expected: too little texture, or "
                        "frames too far apart",
                        tracks_.size(), frames_.size(), least));
    follow_camera(first);
    prune(first);
    if (tracks_.size() < least)
        throw Error(
            fmt::format("{} points fit together, at least {} expected: the poses, the depth unit or the camera are far "
                        "off",
                        tracks_.size(), least));
}

/// Poses that were not recorded: each frame by what it sees of points lifted in frames before (EPnP in RANSAC).
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
    const auto lift = [&](int frame) {
        for (std::size_t i = 0; i < tracks_.size(); ++i)
            for (const Sighting& s : tracks_[i].sightings)
                if (s.frame == frame && s.depth_m > 0 && !world[i])
                    world[i] = start_poses_[frame] * (s.depth_m * ray_of(camera, s.pixel));
    };
    lift(0);
    for (int frame = 1; frame < static_cast<int>(frames_.size()); ++frame) {
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
        if (points.size() < least ||
            !cv::solvePnPRansac(points, straight, cv::Matx33d::eye(), cv::noArray(), turn, shift, false, 300,
                                static_cast<float>(4 / first[f]), 0.999, good, cv::SOLVEPNP_EPNP) ||
            good.size() < least)
            throw Error(
                fmt::format("{}: its place cannot be found: {} of its points are known from the frames before, {} fit; "
                            "at least {} expected",
                            frames_[frame].name, points.size(), good.size(), least));
        cv::solvePnPRefineLM(points, straight, cv::Matx33d::eye(), cv::noArray(), turn, shift);
        double six[pose_unknowns] = {turn[0], turn[1], turn[2], shift[0], shift[1], shift[2]};
        start_poses_[frame] = from_six(six).inverse();
        lift(frame);
    }
}

Fit Sequence::initial(const Model& model) const {
    Fit fit{.model = model, .used = Views(frames_.size(), true)};
    fit.nuisance.resize(frames_.size() * pose_unknowns + tracks_.size() * point_unknowns);
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

/// Leaves out what does not fit, judged by a robust fit with the usual suspects free: a wrong camera must not cost the
/// image's corners. Then scales the depths' sigma to the pixels', by the residuals of each.
void Sequence::prune(const Model& first) {
    constexpr double robust_px = 1, most_sigmas = 4;
    const auto by_camera = [&](std::size_t i, const Fit& fit) { // in front of each camera, not absurdly far
        for (const Sighting& s : tracks_[i].sightings) {
            const Eigen::Vector3d p =
                from_six(&fit.nuisance[s.frame * pose_unknowns]) *
                Eigen::Map<const Eigen::Vector3d>(&fit.nuisance[frames_.size() * pose_unknowns + i * point_unknowns]);
            if (!(p.z() > 0.1 && p.z() < 30))
                return false;
        }
        return true;
    };
    for (int round = 0; round < 3; ++round) {
        Fit fit = initial(first);
        std::vector<Point> kept;
        for (std::size_t i = 0; i < tracks_.size(); ++i)
            if (by_camera(i, fit))
                kept.push_back(tracks_[i]);
        tracks_ = std::move(kept);
        fit = initial(first);
        SequenceProblem adjustment(*this, fit);
        const auto loss = [&] { return new ceres::CauchyLoss(robust_px); };
        for (std::size_t i = 0; i < tracks_.size(); ++i)
            for (const Sighting& s : tracks_[i].sightings)
                adjustment.add(i, s, loss());
        Free free{};
        for (const Unknown unknown : {f, cx, cy, k1})
            free[unknown] = true;
        if (!options_.registered)
            for (int i = turn_x; i < unknown_count; ++i)
                free[i] = true;
        adjustment.hold_poses(fit.used);
        freeze(adjustment.problem, fit.model, free);
        solve(adjustment.problem, fit, true);

        std::vector<double> pixel_misses, depth_misses;
        std::vector<std::vector<double>> worst(tracks_.size());
        for (std::size_t i = 0; i < tracks_.size(); ++i)
            for (const Sighting& s : tracks_[i].sightings) {
                SequenceProblem single(*this, fit);
                single.add(i, s);
                std::vector<double> r;
                single.problem.Evaluate({}, nullptr, &r, nullptr, nullptr);
                pixel_misses.push_back(std::hypot(r[0], r[1]));
                worst[i].push_back(pixel_misses.back());
                if (r.size() > 2)
                    depth_misses.push_back(std::abs(r[2]));
                worst[i].push_back(r.size() > 2 ? std::abs(r[2]) : 0);
            }
        // Of a two-dimensional Gaussian the median distance is 1.18 sigma, of a one-dimensional one 0.674.
        const double pixel_sigma = median_of(pixel_misses) / 1.177, depth_sigma = median_of(depth_misses) / 0.674;
        kept.clear();
        for (std::size_t i = 0; i < tracks_.size(); ++i) {
            Point point;
            for (std::size_t s = 0; s < tracks_[i].sightings.size(); ++s) {
                Sighting sighting = tracks_[i].sightings[s];
                if (worst[i][2 * s] > most_sigmas * pixel_sigma)
                    continue;
                if (worst[i][2 * s + 1] > most_sigmas * depth_sigma)
                    sighting.depth_m = unusable;
                point.sightings.push_back(sighting);
            }
            const bool lifted = std::any_of(point.sightings.begin(), point.sightings.end(),
                                            [](const auto& s) { return s.depth_m > 0; });
            if (point.sightings.size() >= 3 && (lifted || !options_.registered))
                kept.push_back(std::move(point));
        }
        tracks_ = std::move(kept);
        if (depth_sigma > 0)
            depth_weight_ *= pixel_sigma / depth_sigma;
        if (options_.refine_poses)
            for (std::size_t i = 0; i < frames_.size(); ++i)
                start_poses_[i] = from_six(&fit.nuisance[i * pose_unknowns]).inverse();
        if (tracks_.empty())
            return;
    }
}

// ---------------------------------------------------------------------------------------------------- evidence

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
    adjustment.hold_poses(used);
    freeze(adjustment.problem, fit.model, free);
    solve(adjustment.problem, fit, true);
    if (covariance) {
        std::vector<double*> poses;
        std::vector<ClusteredPoint> points;
        for (std::size_t i = 0; i < frames_.size(); ++i)
            poses.push_back(adjustment.pose(static_cast<int>(i)));
        for (std::size_t i = 0; i < tracks_.size(); ++i)
            points.push_back(
                {adjustment.point(i), neighbourhood_of(tracks_[i].sightings.front().pixel, fit.model.size)});
        add_covariance(adjustment.problem, fit, free, poses, points);
    }
    return fit;
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
        freeze(adjustment.problem, fit.model, {});
        if (options_.refine_poses)
            adjustment.hold_near_recorded(static_cast<int>(frame));
        else
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

double Sequence::overlap_mm(const Model& depth_model, const std::vector<Eigen::Isometry3d>& poses) const {
    constexpr int stride = 8;
    constexpr double same_surface = 0.05; // of the depth: farther off is another surface
    const Camera camera = calibration::camera_of(depth_model);
    const auto metres = [&](double z) {
        return depth_model[depth_scale] * z + depth_model[depth_offset] + depth_model[depth_curve] * z * z;
    };
    std::vector<double> misses;
    for (std::size_t a = 0; a < frames_.size(); ++a)
        for (const std::size_t b : {a + 1, a + 4, a + 10}) {
            if (b >= frames_.size())
                continue;
            const Eigen::Isometry3d b_from_a = poses[b].inverse() * poses[a];
            const cv::Mat1f &depth_a = frames_[a].depth_m, &depth_b = frames_[b].depth_m;
            for (int v = stride; v < depth_a.rows - stride; v += stride)
                for (int u = stride; u < depth_a.cols - stride; u += stride) {
                    if (!(depth_a(v, u) > 0))
                        continue;
                    const Eigen::Vector3d point =
                        b_from_a * (metres(depth_a(v, u)) * ray_of(camera, Eigen::Vector2d(u, v)));
                    if (point.z() <= 0.1)
                        continue;
                    Eigen::Vector2d pixel;
                    pixel_of(depth_model.lens, depth_model.values.data(), point.data(), pixel.data());
                    const double z = depth_at(depth_b, pixel);
                    if (z > 0 && std::abs(metres(z) - point.z()) < same_surface * z)
                        misses.push_back(1000 * std::abs(metres(z) - point.z()));
                }
        }
    return median_of(misses);
}

} // namespace scanshade::calibration
