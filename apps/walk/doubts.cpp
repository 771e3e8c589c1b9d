// After a frame is computed: the reasons to doubt its result.
#include "apps/walk/doubts.h"

#include "apps/walk/coordinate_steps.h"
#include "io/clouds/cloud_file.h"
#include "io/text.h"
#include "projection/base/statistics.h"
#include "projection/depth_ends.h"
#include "projection/depth_kind.h"
#include "projection/undistort.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <span>

namespace scanshade {
namespace {

using Doubts = std::vector<std::string>;

constexpr double least_share = 0.2;         ///< of valid pixels, and of valid pixels or points with a value
constexpr double least_neighboured = 0.3;   ///< share of the valid pixels with a valid one next to them
constexpr double all_alike = 0.999;         ///< share of the values that are exactly 0, or exactly 1
constexpr std::size_t enough_values = 100;  ///< fewer may be alike by chance
constexpr double least_radius_px = 2;       ///< at the median depth
constexpr double least_radius_spacings = 2; ///< in a cloud
constexpr double largest_sigma = 0.25;      ///< of the radius; beyond, noise is what occludes
constexpr double most_noisy = 0.3;          ///< share of the valid pixels
constexpr double least_scene_radii = 2;     ///< extent of an image's scene, in radii
constexpr double farthest_centre = 0.2;     ///< of the principal point from the image's middle, in widths or heights
constexpr double near_centre = 0.05;        ///< likewise, of cameras as they are built
constexpr double narrowest_degrees = 0.5;   ///< of view, along the wider side
constexpr double widest_degrees = 175;
constexpr double largest_aspect = 2;       ///< fx / fy, either way
constexpr double most_blind = 0.02;        ///< share of the pixels beyond the radius at which the lens model folds back
constexpr double most_blind_fisheye = 0.5; ///< a fisheye's corners may be beyond 90 degrees

void add_if(bool doubtful, Doubts& doubts, const std::string& sentence) {
    if (doubtful)
        doubts.push_back(sentence);
}

/// Shares of the valid pixels with a valid one at most two to the left or right, and above or below.
std::array<double, 2> neighboured(const cv::Mat1f& z_m) {
    std::size_t valid = 0, beside = 0, above = 0;
    const auto holds = [&](int v, int u) { return z_m(v, u) > 0; };
    for (int v = 2; v + 2 < z_m.rows; ++v)
        for (int u = 2; u + 2 < z_m.cols; u += 3) {
            if (!holds(v, u))
                continue;
            ++valid;
            beside += holds(v, u - 1) || holds(v, u + 1) || holds(v, u - 2) || holds(v, u + 2);
            above += holds(v - 1, u) || holds(v + 1, u) || holds(v - 2, u) || holds(v + 2, u);
        }
    const auto all = static_cast<double>(std::max<std::size_t>(valid, 1));
    return {valid == 0 ? 1 : static_cast<double>(beside) / all, valid == 0 ? 1 : static_cast<double>(above) / all};
}

/// Whether the valid pixels are those of an object without its background: most of the box round them.
bool is_cut_out(const cv::Mat1f& z_m) {
    constexpr double most = 0.4, least = 0.001;
    if (z_m.empty())
        return false;
    const cv::Mat valid = z_m > 0;
    const cv::Rect box = cv::boundingRect(valid);
    const double inside = cv::countNonZero(valid);
    return inside > most * box.area() && inside > least * static_cast<double>(z_m.total());
}

void doubt_shares(const Work& work, Doubts& doubts) {
    const FrameRow& row = work.row;
    const bool image = !work.frame.cloud || (work.frame.cloud->organised() && !work.by_points);
    if (row.valid_share == 0) {
        add_if(work.frame.doubts.empty(), doubts,
               work.frame.cloud ? "no point is valid." : "no pixel holds a valid depth.");
        return;
    }
    add_if(image && row.valid_share < least_share && !is_cut_out(work.depth.z_m), doubts,
           fmt::format("only {:.1f} % of the pixels hold a depth: what hides in the holes cannot occlude.",
                       100 * row.valid_share));
    if (image && row.valid_share >= least_share && !work.depth.z_m.empty()) {
        const auto [beside, above] = neighboured(work.depth.z_m);
        add_if(std::min(beside, above) < least_neighboured, doubts,
               fmt::format("only {:.0f} % of the valid pixels have a valid one {}: what hides between them cannot "
                           "occlude.",
                           100 * std::min(beside, above), beside < above ? "beside them" : "above or below them"));
    }
    add_if(row.coverage < least_share, doubts,
           fmt::format("only {:.1f} % of the valid {} got a value.", 100 * row.coverage,
                       work.frame.cloud ? "points" : "pixels"));
}

/// Whether depth shows hollows well within the radius, such as corners and what stands before something: a share of
/// the pixels lies behind the line between neighbours.
bool has_hollows(const DepthImage& depth, double radius_m) {
    constexpr double least_radii = 0.05, least_share_hollow = 0.01;
    constexpr int farthest_px = 32;
    std::size_t valid = 0, hollow = 0;
    for (int v = 0; v < depth.z_m.rows; v += 3)
        for (int u = 0; u < depth.z_m.cols; u += 3) {
            const double z = depth.z_m(v, u);
            if (!(z > 0))
                continue;
            ++valid;
            const int lag = std::clamp(static_cast<int>(radius_m * depth.camera.fx / z / 2), 1, farthest_px);
            const auto behind = [&](int du, int dv) {
                const cv::Rect image(0, 0, depth.z_m.cols, depth.z_m.rows);
                if (!image.contains({u - du, v - dv}) || !image.contains({u + du, v + dv}))
                    return false;
                const double a = depth.z_m(v - dv, u - du), b = depth.z_m(v + dv, u + du);
                return a > 0 && b > 0 && std::abs(a - z) < radius_m && std::abs(b - z) < radius_m &&
                       z - 2 / (1 / a + 1 / b) > least_radii * radius_m; // 1 / z is linear along a plane
            };
            hollow += behind(lag, 0) || behind(0, lag);
        }
    return static_cast<double>(hollow) > least_share_hollow * static_cast<double>(valid);
}

/// The same of a cloud: a share of some points have others within the radius in front of their planes.
bool has_hollows(const Cloud& cloud, const PointVisibility& found) {
    constexpr std::size_t looking = 300, seen = 30000;
    constexpr double least_radii = 0.05, least_share_hollow = 0.02;
    if (found.normals.size() != cloud.points.size() || !(found.radius > 0))
        return true; // nothing is known
    const std::size_t count = cloud.points.size();
    const std::size_t each = std::max<std::size_t>(1, count / looking), other = std::max<std::size_t>(1, count / seen);
    std::size_t valid = 0, hollow = 0;
    for (std::size_t i = 0; i < count; i += each) {
        const Eigen::Vector3d at = cloud.points[i], normal = found.normals[i].cast<double>();
        if (std::isnan(found.visibility[i]))
            continue;
        ++valid;
        for (std::size_t j = 0; j < count; j += other)
            if (const Eigen::Vector3d apart = cloud.points[j] - at;
                apart.dot(normal) > least_radii * found.radius && apart.norm() < found.radius) {
                ++hollow;
                break;
            }
    }
    return static_cast<double>(hollow) > least_share_hollow * static_cast<double>(valid);
}

/// `may_be_open()`: all may be open, as of a convex surface.
template <class MayBeOpen>
void doubt_values(std::span<const float> values, const MayBeOpen& may_be_open, Doubts& doubts) {
    std::size_t known = 0, closed = 0, open = 0;
    for (const float value : values) {
        known += !std::isnan(value);
        closed += value == 0;
        open += value == 1;
    }
    if (known < enough_values)
        return;
    const auto most = static_cast<std::size_t>(all_alike * static_cast<double>(known));
    add_if(open > most && !may_be_open(), doubts,
           "every value is exactly 1, fully open: only flat and convex surfaces read so. Otherwise depth unit, camera "
           "or radius are wrong.");
    add_if(closed > most, doubts,
           "every value is exactly 0, fully closed: no real surface reads so. Depth unit, camera, normals or radius "
           "are wrong.");
}

/// The values below which 1 % and 99 % lie, and the median.
struct Spread {
    double low = 0, middle = 0, high = 0;
};

Spread spread_of(std::vector<double>& values) {
    return {quantile(values, 0.01), quantile(values, 0.5), quantile(values, 0.99)};
}

/// Of every third row and column, which is enough to judge by.
std::vector<double> depths_of(const cv::Mat1f& z_m) {
    std::vector<double> depths;
    for (int v = 0; v < z_m.rows; v += 3)
        for (int u = 0; u < z_m.cols; u += 3)
            if (z_m(v, u) > 0)
                depths.push_back(z_m(v, u));
    return depths;
}

void doubt_radius_in_view(const Work& work, double radius_m, const LengthUnit& unit, Doubts& doubts) {
    std::vector<double> depths = depths_of(work.depth.z_m);
    if (depths.size() < 3 || !(radius_m > 0)) // a method without a radius
        return;
    const auto [near, middle, far] = spread_of(depths);
    const Pinhole& camera = work.depth.camera;
    const double radius_px = radius_m * std::min(camera.fx, camera.fy) / middle;
    const double width = middle * camera.size.width / camera.fx, height = middle * camera.size.height / camera.fy;
    const double scene_m = std::hypot(width, height, far - near);
    const char* const advice = unit.arbitrary() ? "Give" : "Check the depth unit, or give";
    const char* const flag = unit.arbitrary() ? "--relative-radius" : "--radius";
    add_if(radius_px < least_radius_px, doubts,
           fmt::format("the radius of {} spans {:.2g} pixels at the median depth of {}: nothing within it can be seen. "
                       "{} a larger {}.",
                       unit.text(radius_m), radius_px, unit.text(middle), advice, flag));
    add_if(
        radius_m * least_scene_radii > scene_m, doubts,
        fmt::format("the radius of {} is larger than {} scene of {}, so most of what is within it was not seen. {} a "
                    "smaller {}.",
                    unit.text(radius_m), radius_m > scene_m ? "the" : "half the", unit.text(scene_m), advice, flag));
}

void doubt_noise_in_view(const Work& work, double radius_m, const DepthNoise& noise, const LengthUnit& unit,
                         Doubts& doubts) {
    std::vector<double> depths = depths_of(work.depth.z_m);
    if (depths.empty() || !(radius_m > 0) || !noise.any())
        return;
    const auto noisy = static_cast<double>(
        std::ranges::count_if(depths, [&](double z) { return noise.at(z) > largest_sigma * radius_m; }));
    const double share = noisy / static_cast<double>(depths.size()), far = quantile(depths, 0.9);
    add_if(share > most_noisy, doubts,
           fmt::format("noise is above a quarter of the radius at {:.0f} % of the pixels (sigma {} at {}): their "
                       "values say little. {}",
                       100 * share, unit.text(noise.at(far), 2), unit.text(far, 2),
                       unit.arbitrary() ? "Give a larger --relative-radius."
                                        : "Give a larger --radius, or leave them out with --depth-range."));
}

/// Planes that bend as those of ranges or of disparities do.
void doubt_kind(const DepthImage& depth, Doubts& doubts) {
    const DepthKind kind = depth_kind(depth);
    add_if(kind == DepthKind::inverse, doubts,
           "planes bend as if the image held disparities or inverse depths, larger where surfaces are nearer: convert "
           "them to depth.");
    add_if(kind == DepthKind::range, doubts,
           "planes bend as if the image held distances from the camera's centre, not depths along z: divide them by "
           "the length of each pixel's ray (x, y, 1), or check the camera.");
}

/// One value at either end of the depths that no surface explains.
void doubt_ends(const DepthImage& depth, const LengthUnit& unit, Doubts& doubts) {
    const DepthEnds ends = depth_ends(depth.z_m);
    const auto doubt = [&](const std::optional<DepthEnd>& end, const char* which, const char* beyond) {
        if (end)
            doubts.push_back(
                fmt::format("{:.1f} % of the valid pixels hold exactly {}, the {} depth, {}. They are taken "
                            "for a surface; --depth-range leaves them out.",
                            100 * end->share, unit.text(end->z_m, 4), which,
                            end->apart ? std::string("far from all others, as a file marks holes")
                                       : fmt::format("as if all {} had been cut off there", beyond)));
    };
    doubt(ends.nearest, "smallest", "nearer");
    doubt(ends.farthest, "largest", "farther away");
}

/// The diagonal of the box without the lowest and highest hundredth of the points along each axis.
double extent_of(const Cloud& cloud) {
    const std::size_t step = std::max<std::size_t>(1, cloud.points.size() / 50000);
    Eigen::Vector3d extent = Eigen::Vector3d::Zero();
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<double> along;
        for (std::size_t i = 0; i < cloud.points.size(); i += step)
            if (cloud.points[i].allFinite())
                along.push_back(cloud.points[i][axis]);
        if (along.empty())
            return 0;
        const Spread spread = spread_of(along);
        extent[axis] = spread.high - spread.low;
    }
    return extent.norm();
}

void doubt_radius_of_points(const Work& work, Doubts& doubts) {
    const double radius = work.of_points.radius, spacing = work.of_points.spacing;
    if (!(radius > 0))
        return;
    add_if(
        spacing > 0 && radius < least_radius_spacings * spacing, doubts,
        fmt::format("the radius of {:.3g} is only {:.2g} times the points' spacing of {:.3g}: surfaces within it are "
                    "single points. Give a larger --radius.",
                    radius, radius / spacing, spacing));
    const double extent = extent_of(*work.frame.cloud);
    add_if(
        radius > extent, doubts,
        fmt::format("the radius of {:.3g} is larger than the cloud of {:.3g}: give a smaller --radius, or a cloud of "
                    "more than a few points.",
                    radius, extent));
}

/// What is no cloud of surfaces: hardly any points, or the numbers of lines in place of x.
void doubt_points(const Cloud& cloud, Doubts& doubts) {
    constexpr std::size_t fewest = 10, enough = 100;
    const auto& points = cloud.points;
    const auto valid = static_cast<std::size_t>(
        std::ranges::count_if(points, [](const Eigen::Vector3d& point) { return point.allFinite(); }));
    const bool few = valid > 0 && valid < fewest;
    add_if(few && triangles_of(cloud).empty(), doubts, counted(valid, "point") + " cannot show a surface.");
    double next = points.empty() ? 0 : points.front().x();
    add_if(points.size() >= enough &&
               std::ranges::all_of(points, [&](const Eigen::Vector3d& point) { return point.x() == next++; }),
           doubts, "x is the number of the point: the file's first column counts them, and its coordinates follow.");
}

void doubt_steps(const Work& work, Doubts& doubts) {
    const double spacing = work.of_points.spacing;
    const auto steps = coarse_steps(work.frame.cloud->points, spacing);
    constexpr double enough_steps = 4; // in the radius: of a voxel grid, whose steps are alike everywhere
    if (!steps || (steps->in_all && work.of_points.radius > enough_steps * steps->step))
        return;
    constexpr std::array names{"x", "y", "z"};
    doubts.push_back(fmt::format(
        "coordinates along {} are multiples of {:.3g}, and points stand {:.3g} apart: surfaces are steps. {}",
        names.at(static_cast<std::size_t>(steps->axis)), steps->step, spacing,
        steps->single_precision ? "Single precision holds coordinates of that size no better: write them in double "
                                  "precision, or without their offset."
                                : "Write them with more digits, or give a larger --radius."));
}

void doubt_unit(const Cloud& cloud, Doubts& doubts) {
    add_if(cloud.records && unit_of(*cloud.records).starts_with("degrees"), doubts,
           "the coordinates are in degrees, so distances between points mean nothing: project them first.");
}

double view_degrees(double focal_length, int pixels) {
    return 2 * std::atan(pixels / (2 * focal_length)) * 180 / std::numbers::pi;
}

void doubt_camera(const Camera& camera, Doubts& doubts) {
    const Pinhole& pinhole = camera.pinhole;
    const double wide =
        std::max(view_degrees(pinhole.fx, pinhole.size.width), view_degrees(pinhole.fy, pinhole.size.height));
    const double aspect = std::max(pinhole.fx / pinhole.fy, pinhole.fy / pinhole.fx);
    add_if(wide < narrowest_degrees || wide > widest_degrees, doubts,
           fmt::format("the camera sees an angle of {:.2g} degrees, which no depth camera does ({}; {}).", wide,
                       describe(camera), camera.origin));
    add_if(aspect > largest_aspect, doubts,
           fmt::format("the camera's pixels are {:.3g} times as long as wide ({}; {}).", aspect, describe(camera),
                       camera.origin));
    const double middle_x = (pinhole.size.width - 1) / 2.0, middle_y = (pinhole.size.height - 1) / 2.0;
    const auto off = [&](double x, double y) {
        return std::max(std::abs(pinhole.cx - x) / pinhole.size.width, std::abs(pinhole.cy - y) / pinhole.size.height);
    };
    const double off_centre = off(middle_x, middle_y);
    const bool turned = off_centre > 2 * near_centre && off(middle_y, middle_x) < near_centre;
    add_if(turned, doubts,
           fmt::format("the principal point is the middle of a {}x{} image: the camera seems to be that of the image "
                       "before it was turned ({}; {}).",
                       pinhole.size.height, pinhole.size.width, describe(camera), camera.origin));
    add_if(!turned && off_centre > farthest_centre, doubts,
           fmt::format("the principal point is far from the middle of the image: the camera may be that of another "
                       "image size, or of the image before it was cropped ({}; {}).",
                       describe(camera), camera.origin));
    if (!camera.distortion.any())
        return;
    const cv::Mat2f& direction = Undistortion::of(camera)->direction();
    const auto blind =
        std::count_if(direction.begin(), direction.end(), [](const cv::Vec2f& d) { return std::isnan(d[0]); });
    const double share = static_cast<double>(blind) / static_cast<double>(std::max<std::size_t>(direction.total(), 1));
    const bool fisheye = camera.distortion.model == LensModel::kannala_brandt;
    add_if(share > (fisheye ? most_blind_fisheye : most_blind), doubts,
           fmt::format("the lens distortion folds back within the image: {:.0f} % of the pixels have no direction ({}; "
                       "{}).",
                       100 * share, describe(camera), camera.origin));
}

} // namespace

std::vector<std::string> doubts_about(const Camera& camera, const DepthImage& depth, const LengthUnit& unit) {
    Doubts doubts;
    doubt_camera(camera, doubts);
    doubt_kind(depth, doubts);
    doubt_ends(depth, unit, doubts);
    return doubts;
}

std::vector<std::string> doubts_about(const Work& work, double radius_m, const DepthNoise& noise,
                                      const LengthUnit& unit) {
    Doubts doubts = work.frame.doubts;
    doubt_shares(work, doubts);
    if (work.by_points) {
        doubt_unit(*work.frame.cloud, doubts);
        doubt_points(*work.frame.cloud, doubts);
        doubt_values(
            work.of_points.visibility, [&] { return !has_hollows(*work.frame.cloud, work.of_points); }, doubts);
        doubt_radius_of_points(work, doubts);
        doubt_steps(work, doubts);
        return doubts;
    }
    const cv::Mat1f& visibility = work.ao.visibility;
    if (visibility.isContinuous())
        doubt_values(
            {visibility.ptr<float>(), visibility.total()},
            [&] { return radius_m > 0 && !has_hollows(work.depth, radius_m); }, doubts);
    doubt_radius_in_view(work, radius_m, unit, doubts);
    doubt_noise_in_view(work, radius_m, noise, unit, doubts);
    if (!work.frame.cloud) // a cloud's camera is recovered or chosen, not given, unless --camera names it
        std::ranges::move(doubts_about(work.row.camera, work.depth, unit), std::back_inserter(doubts));
    return doubts;
}

} // namespace scanshade
