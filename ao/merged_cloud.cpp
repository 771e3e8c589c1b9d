// Clouds that were merged from depth frames.
#include "ao/merged_cloud.h"

#include "ao/cloud/cloud_error.h"
#include "ao/cloud/cloud_notes.h"
#include "ao/frame.h"
#include "projection/base/error.h"
#include "projection/base/spread.h"
#include "projection/base/statistics.h"
#include "projection/base/stopwatch.h"
#include "projection/project.h"
#include "projection/sensor/expected_error.h"
#include "projection/sensor/noise.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {

/// The frames of a cloud.
struct MergedCloudAo::Frames {
    FoundFrames found;
    bool merged = false; ///< points are means over several pixels and frames: each belongs to the first that saw it
};

namespace {

using Eigen::Isometry3d, Eigen::Vector3d;

/// The camera of every point; that of the point before it where it is on no pixel.
std::vector<Vector3d> cameras_of(const FoundFrames& found) {
    std::vector<Vector3d> cameras(found.frame.size());
    std::size_t frame = 0;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
        if (found.frame[i] >= 0)
            frame = static_cast<std::size_t>(found.frame[i]);
        cameras[i] = found.frames[frame].world_from_camera.translation();
    }
    return cameras;
}

std::vector<Vector3d> turned_to(const std::vector<Vector3d>& cameras, const PointSet& cloud) {
    std::vector<Vector3d> normals(cloud.normals.begin(), cloud.normals.end());
    for (std::size_t i = 0; i < normals.size(); ++i)
        if (normals[i].dot(cameras[i] - cloud.points[i]) < 0)
            normals[i] = -normals[i];
    return normals;
}

/// The median distance of points from their cameras, in the cloud's unit.
double usual_depth(const FoundFrames& found, const PointSet& cloud) {
    std::vector<double> depths;
    for (std::size_t i = 0; i < cloud.points.size(); i += 97)
        if (found.frame[i] >= 0)
            depths.push_back((cloud.points[i] -
                              found.frames[static_cast<std::size_t>(found.frame[i])].world_from_camera.translation())
                                 .norm());
    return median(std::move(depths), 0);
}

/// Metres per unit of the cloud, by how far depth cameras see: 0.1 to 30 m; what they see at 100 to 30,000 is in
/// millimetres. 0 = neither.
double metres_per_unit(double depth) {
    return depth >= 0.1 && depth <= 30 ? 1 : depth > 100 && depth <= 30000 ? 0.001 : 0;
}

/// Depth as it was recorded, in whole numbers of a unit: coordinates in a file and found cameras are off that by a
/// little, and a disparity's steps, which tell noise from relief, no longer show. Of depth that is not in such a unit,
/// a fifth is as near to whole numbers by chance.
void restore_steps(cv::Mat1f& z_m) {
    constexpr double near = 0.1, least_share = 0.95;
    for (const double per_metre : {1000.0, 4000.0, 5000.0, 6553.5, 10000.0}) {
        int all = 0, near_whole = 0;
        for (const float z : z_m)
            if (z > 0) {
                const double steps = per_metre * static_cast<double>(z);
                near_whole += std::abs(steps - std::round(steps)) < near;
                ++all;
            }
        if (near_whole < least_share * all)
            continue;
        for (float& z : z_m)
            z = static_cast<float>(std::round(per_metre * static_cast<double>(z)) / per_metre);
        return;
    }
}

/// A camera with pixels so many times as wide.
Pinhole coarser(const Pinhole& camera, double times) {
    return {camera.fx / times,
            camera.fy / times,
            (camera.cx + 0.5) / times - 0.5,
            (camera.cy + 0.5) / times - 0.5,
            {static_cast<int>(std::ceil(camera.size.width / times)),
             static_cast<int>(std::ceil(camera.size.height / times))}};
}

/// The frames as images of a recording, in metres.
class FrameImages {
  public:
    /// `wider`: of merged points, how many times as wide as the frames' the pixels are.
    FrameImages(const FoundFrames& found, bool merged, std::span<const Vector3d> points, double metres, double wider)
        : found_(found), points_(points), metres_(metres), merged_(merged), wider_(wider) {}

    [[nodiscard]] std::size_t size() const { return found_.frames.size(); }
    [[nodiscard]] DepthImage depth(std::size_t index) const {
        if (merged_)
            return seen(index);
        cv::Mat1f z_m = found_.depth(index, points_);
        z_m *= metres_;
        restore_steps(z_m);
        return {found_.frames[index].camera, z_m, {}};
    }
    /// The pixel of a point in the image of its frame, where it has one.
    [[nodiscard]] std::optional<cv::Point> pixel(std::size_t index, std::size_t point, const DepthImage& depth) const {
        if (found_.frame[point] != static_cast<std::int32_t>(index))
            return std::nullopt;
        if (!merged_)
            return cv::Point(found_.pixel[point] % depth.z_m.cols, found_.pixel[point] / depth.z_m.cols);
        const Vector3d there = pose(index).inverse() * (metres_ * points_[point]);
        const Eigen::Vector2d at = depth.camera.pixel(there).array().round();
        if (!(there.z() > 0 && at.x() >= 0 && at.x() < depth.z_m.cols && at.y() >= 0 && at.y() < depth.z_m.rows))
            return std::nullopt;
        const cv::Point pixel(static_cast<int>(at.x()), static_cast<int>(at.y()));
        const double z = static_cast<double>(depth.z_m(pixel));
        return std::abs(z - there.z()) < same_surface_m(depth.camera, z) ? std::optional(pixel) : std::nullopt;
    }
    [[nodiscard]] Isometry3d pose(std::size_t index) const {
        Isometry3d pose = found_.frames[index].world_from_camera;
        pose.translation() *= metres_;
        return pose;
    }
    [[nodiscard]] DepthNoise noise() const {
        constexpr std::size_t some = 5;
        std::vector<DepthImage> images;
        for (const std::size_t index : spread(some, size()))
            images.push_back(depth(index));
        return measure_noise(images);
    }
    [[nodiscard]] int reach(double radius_m) const {
        std::vector<std::optional<Isometry3d>> poses;
        for (std::size_t i = 0; i < size(); ++i)
            poses.emplace_back(pose(i));
        return reach_for(poses, radius_m);
    }

  private:
    /// All points that a frame's camera sees, of whatever frame.
    [[nodiscard]] DepthImage seen(std::size_t index) const {
        Frame frame;
        frame.camera.pinhole = coarser(found_.frames[index].camera, wider_);
        Cloud& cloud = frame.cloud.emplace();
        cloud.grid = cv::Size(static_cast<int>(points_.size()), 1);
        const Isometry3d camera_from_world = pose(index).inverse();
        cloud.points.reserve(points_.size());
        for (const Vector3d& point : points_)
            cloud.points.push_back(camera_from_world * (metres_ * point));
        DepthImage depth = project(frame);
        depth.source = {}; // of depth images alone are all pixels trusted alike
        return depth;
    }

    const FoundFrames& found_;
    std::span<const Vector3d> points_;
    double metres_;
    bool merged_;
    double wider_;
};

/// An estimate of visibility, and its expected error.
struct Estimate {
    float value, error;
};

/// By how much more than their tables say both ways err on merged clouds: rays from noisy points where wires and leaves
/// are many (found / expected 0.9 to 1.6), images of exact depth where strides make wires solid (1.0 to 1.8).
struct TooSure {
    double rays, images;
};
TooSure too_sure(bool noisy) { return noisy ? TooSure{1.3, 1} : TooSure{1, 1.5}; }

/// Whether depth has a sensor's noise; that of rounding to 0.2 mm is none.
bool is_noisy(const DepthNoise& noise) {
    constexpr double near_m = 2, sensor_m = 0.0005;
    return noise.at(near_m) > sensor_m;
}

/// Points / pixels of the frames.
double filled(const FoundFrames& found) {
    const auto points = std::ranges::count_if(found.pixel, [](std::int32_t pixel) { return pixel >= 0; });
    double pixels = 0;
    for (const FoundFrame& frame : found.frames)
        pixels += frame.camera.size.area();
    return static_cast<double>(points) / pixels;
}

/// The mean of both, weighted by their squared errors, which are alike to half: 0.2 to 0.65 of ten merged clouds.
Estimate mean_of(Estimate rays, Estimate image, const TooSure& factors) {
    constexpr double alike = 0.5, least = 0.01;
    const double a = factors.rays * std::max<double>(rays.error, least);
    const double b = factors.images * std::max<double>(image.error, least);
    const double of_a = 1 / (a * a), of_b = 1 / (b * b);
    const double value = of_a * static_cast<double>(rays.value) + of_b * static_cast<double>(image.value);
    return {static_cast<float>(value / (of_a + of_b)),
            static_cast<float>(std::sqrt(of_a + of_b + 2 * alike / (a * b)) / (of_a + of_b))};
}

/// What a frame says of a pixel. A flying pixel of noisy depth, which images drop, is worth the mean of those around
/// it. Nothing where there are none, or depth is exact: rays know such pixels.
std::optional<Estimate> estimate_at(const cv::Mat1f& visibility, const cv::Mat1f& errors, int v, int u, bool noisy) {
    constexpr int round = 2;
    constexpr float flying = 0.22F; // RMS of six merged clouds: 0.16 to 0.30
    if (!std::isnan(visibility(v, u)) && !std::isnan(errors(v, u)))
        return Estimate{visibility(v, u), errors(v, u)};
    if (!noisy)
        return std::nullopt;
    float sum = 0;
    int count = 0;
    for (int y = std::max(0, v - round); y <= std::min(visibility.rows - 1, v + round); ++y)
        for (int x = std::max(0, u - round); x <= std::min(visibility.cols - 1, u + round); ++x)
            if (!std::isnan(visibility(y, x))) {
                sum += visibility(y, x);
                ++count;
            }
    return count > 0 ? std::optional(Estimate{sum / static_cast<float>(count), flying}) : std::nullopt;
}

} // namespace

/// What a person decides about sides is not overruled; images know no sky.
bool MergedCloudAo::looks_for_frames(const PointSet& cloud) const {
    return !options_.sky && options_.outside == "auto" && options_.normals == CloudNormals::automatic &&
           cloud.triangles.empty() && cloud.splats.empty() && cloud.seen_from.empty() &&
           cloud.points.size() <= rays_.most_at_once();
}

/// Those that the file names, else those that the order of the points tells; nothing where there are none.
std::optional<MergedCloudAo::Frames> MergedCloudAo::frames_of(const PointSet& cloud) {
    constexpr double explained = 0.95;
    if (cloud.frames.empty()) {
        std::optional<FoundFrames> found = found_frames(cloud.points);
        if (!found || found->share < explained)
            return std::nullopt;
        return Frames{*std::move(found)};
    }
    Frames named{pixels_of(cloud.frames, cloud.points)};
    named.merged = named.found.share < explained;
    for (std::size_t i = 0; named.merged && i < cloud.frames.size(); ++i)
        std::fill(named.found.frame.begin() + static_cast<std::ptrdiff_t>(cloud.frames[i].first),
                  named.found.frame.begin() + static_cast<std::ptrdiff_t>(cloud.frames[i].last),
                  static_cast<std::int32_t>(i));
    return named;
}

std::string MergedCloudAo::note_on(const Frames& frames, bool named) {
    const FoundFrames& found = frames.found;
    const std::string are = named ? "are named by the file" : "were found in the order of the points";
    const std::string cameras = "cameras tell the sides of surfaces.";
    const cv::Size size = found.frames.front().camera.size;
    if (frames.merged)
        return fmt::format("{} depth frames {}, which merged their points; their {}", found.frames.size(), are,
                           cameras);
    return fmt::format("{} depth frames {}: {:.1f} % of these are pixels of {}x{} images, whose {}",
                       found.frames.size(), are, 100 * found.share, size.width, size.height, cameras);
}

PointVisibility MergedCloudAo::compute(const PointSet& cloud, const std::optional<Vector3d>& scanner) {
    const Stopwatch looking;
    const std::optional<Frames> frames = looks_for_frames(cloud) ? frames_of(cloud) : std::nullopt;
    if (!frames)
        return rays_.compute(cloud, scanner);
    const double looked_ms = looking.ms();
    const std::vector<Vector3d> cameras = cameras_of(frames->found), normals = turned_to(cameras, cloud);
    PointSet seen = cloud;
    seen.normals = normals;
    seen.seen_from = cameras;
    PointVisibility result = rays_.compute(seen, scanner);
    result.timings.emplace_back("frames found", looked_ms);
    result.notes.insert(result.notes.begin(), note_on(*frames, !cloud.frames.empty()));
    try {
        add_images(result, cloud, *frames);
    } catch (const Outage&) { // concerns more than this cloud
        throw;
    } catch (const Error& failure) {
        result.notes.push_back(fmt::format("frames are not computed as images: {}.", failure.what()));
    }
    return result;
}

void MergedCloudAo::add_images(PointVisibility& result, const PointSet& cloud, const Frames& frames) const {
    constexpr double wider = 1.25;       // pixels of merged points in their spacings: fewer are filled
    constexpr double least_filled = 0.4; // at 0.3, noise is not found, and images err by 1.7 times what they expect
    const FoundFrames& found = frames.found;
    const double depth = usual_depth(found, cloud), metres = metres_per_unit(depth), radius_m = result.radius * metres;
    if (metres == 0)
        throw Error("their depth is neither in metres nor in millimetres");
    if (const double share = filled(found); share < least_filled && !frames.merged)
        throw Error(fmt::format("only {:.0f} % of their pixels hold points, too few to tell depth noise", 100 * share));
    const Stopwatch stopwatch;
    const MethodRow& method = method_named("surfel");
    const std::unique_ptr<MethodSetup> setup = method.setup();
    set(*row_named(setup->parameters(), "radius"), radius_m);
    FrameAo frame_ao(images_.device(), method, *setup, images_.preparation);
    const double spacing_px = result.spacing / depth * found.frames.front().camera.fx;
    const FrameImages images(found, frames.merged, cloud.points, metres, std::max(1.0, wider * spacing_px));
    const DepthNoise noise = images.noise();
    const bool noisy = is_noisy(noise);
    const TooSure factors = too_sure(noisy);
    SequenceAo sequence = frame_ao.sequence(radius_m, noise, {.reach = images.reach(radius_m)});
    std::size_t added = 0, values = 0;
    for (std::size_t i = 0; i < images.size(); ++i) {
        for (; added < std::min(images.size(), i + sequence.reach() + 1); ++added)
            sequence.add(added, images.depth(added), images.pose(added));
        sequence.forget_before(i - std::min(i, sequence.reach()));
        const SequenceAoResult made = sequence.compute(i);
        const DepthImage depth_image = images.depth(i);
        const cv::Mat1f errors = expected_error_of(depth_image, made.ao.visibility, radius_m, noise,
                                                   frame_ao.errors(noise, share_of_gain(made.others())));
        const FoundFrame& frame = found.frames[i];
        for (std::size_t k = frame.first; k < frame.last; ++k) {
            const std::optional<cv::Point> at = images.pixel(i, k, depth_image);
            if (!at)
                continue;
            const std::optional<Estimate> image = estimate_at(made.ao.visibility, errors, at->y, at->x, noisy);
            if (!image)
                continue;
            const bool flies = std::isnan(made.ao.visibility(*at)) || std::isnan(result.visibility[k]);
            const Estimate best = flies ? *image : mean_of({result.visibility[k], result.error[k]}, *image, factors);
            result.visibility[k] = best.value;
            result.error[k] = best.error;
            ++values;
        }
    }
    if (result.expected_error)
        std::erase(result.notes, told_error(*result.expected_error, 0).note);
    ErrorSum errors;
    for (const float error : result.error)
        errors.add(error);
    result.expected_error = errors.rms();
    result.notes.push_back(
        fmt::format("the frames are computed as images, too, with each other's help: {:.1f} % of the "
                    "values are means of both. Depth noise: {}.",
                    100 * static_cast<double>(values) / static_cast<double>(cloud.points.size()), describe(noise)));
    if (result.expected_error)
        result.notes.push_back(told_error(*result.expected_error, 0).note);
    result.timings.emplace_back("frames as images", stopwatch.ms());
}

} // namespace scanshade
