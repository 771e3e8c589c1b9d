#include "apps/doubts/of_view.h"

#include "apps/doubts/sentences.h"
#include "projection/scene_extent.h"
#include "projection/sensor/depth_buffer.h"
#include "projection/sensor/depth_ends.h"
#include "projection/sensor/depth_kind.h"
#include "projection/undistort.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>
#include <optional>

namespace scanshade {
namespace {

constexpr double least_radius_px = 2;     ///< at the median depth
constexpr double largest_sigma = 0.25;    ///< of the radius; beyond, noise is what occludes
constexpr double most_noisy = 0.3;        ///< share of the valid pixels
constexpr double largest_step = 0.022;    ///< of the radius; 0.02 costs exact depth nothing
constexpr double least_scene_radii = 2;   ///< extent of an image's scene, in radii
constexpr double farthest_centre = 0.2;   ///< of the principal point from the image's middle, in widths or heights
constexpr double near_centre = 0.05;      ///< likewise, of cameras as they are built
constexpr double narrowest_degrees = 0.5; ///< of view, along the wider side
constexpr double widest_degrees = 175;
constexpr double largest_aspect = 2;       ///< fx / fy, either way
constexpr double most_blind = 0.02;        ///< share of the pixels beyond the radius at which the lens model folds back
constexpr double most_blind_fisheye = 0.5; ///< a fisheye's corners may be beyond 90 degrees

double view_degrees(double focal_length, int pixels) {
    return 2 * std::atan(pixels / (2 * focal_length)) * 180 / std::numbers::pi;
}

} // namespace

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

void check_radius_in_view(const DepthImage& depth, double radius_m, const LengthUnit& unit, Findings& findings) {
    const SceneExtent scene = scene_extent(depth);
    const double scene_m = scene.diagonal_m, middle = scene.middle_m;
    if (!(scene_m > 0) || !(radius_m > 0)) // a method without a radius
        return;
    const double radius_px = radius_m * std::min(depth.camera.fx, depth.camera.fy) / middle;
    const char* const advice = unit.arbitrary() ? "Give" : "Check the depth unit, or give";
    const char* const flag = unit.arbitrary() ? "--relative-radius" : "--radius";
    at_least(findings, Check::radius_in_pixels, radius_px, least_radius_px, [&] {
        return fmt::format("the radius of {} spans {:.2g} pixels at the median depth of {}: nothing within it can be "
                           "seen. {} a larger {}.",
                           unit.text(radius_m), radius_px, unit.text(middle), advice, flag);
    });
    at_least(findings, Check::radius_in_scene, scene_m / radius_m, least_scene_radii, [&] {
        return fmt::format("the radius of {} is larger than {} scene of {}, so most of what is within it was not seen. "
                           "{} a smaller {}.",
                           unit.text(radius_m), radius_m > scene_m ? "the" : "half the", unit.text(scene_m), advice,
                           flag);
    });
}

void check_noise_in_view(const DepthImage& depth, double radius_m, const DepthNoise& noise, const LengthUnit& unit,
                         Findings& findings) {
    if (!(radius_m > 0) || !noise.any())
        return;
    std::vector<float> depths = sampled_depths(depth.z_m);
    const auto noisy = static_cast<double>(
        std::ranges::count_if(depths, [&](double z) { return noise.at(z) > largest_sigma * radius_m; }));
    const double share = noisy / static_cast<double>(std::max<std::size_t>(depths.size(), 1));
    at_most(findings, Check::depth_noise, share, most_noisy, [&] {
        const double far = quantile(depths, 0.9);
        return fmt::format("noise is above a quarter of the radius at {:.0f} % of the pixels (sigma {} at {}): their "
                           "values say little. {}",
                           100 * share, unit.text(noise.at(far), 2), unit.text(far, 2),
                           unit.arbitrary() ? "Give a larger --relative-radius."
                                            : "Give a larger --radius, or leave them out with --depth-range.");
    });
}

void check_steps_in_view(double radius_m, const DepthNoise& noise, const LengthUnit& unit, Findings& findings) {
    if (!(radius_m > 0))
        return;
    at_most(findings, Check::depth_steps, noise.step_m / radius_m, largest_step, [&] {
        return fmt::format("depths come in steps of {}, {:.0f} % of the radius, as images of 8 bits and lossy "
                           "compression leave them: surfaces are stairs. {}",
                           unit.text(noise.step_m, 2), 100 * noise.step_m / radius_m,
                           unit.arbitrary() ? "Give a larger --relative-radius."
                                            : "Take the depth as it was recorded, or give a larger --radius.");
    });
}

void check_kind(const DepthImage& depth, Findings& findings) {
    const bool buffer = is_depth_buffer(depth);
    must_not(findings, Check::depth_buffer, buffer, [] {
        return "planes bend as if the image held a renderer's depth buffer, 0 .. 1 between its near and its far plane: "
               "make it linear, z = near far / (far - value (far - near)).";
    });
    if (buffer)
        return;
    const DepthKind kind = depth_kind(depth);
    must_not(findings, Check::depth_kind, kind == DepthKind::inverse || kind == DepthKind::range, [&] {
        return kind == DepthKind::inverse
                   ? "planes bend as if the image held disparities or inverse depths, larger where surfaces are "
                     "nearer: "
                     "convert them to depth."
                   : "planes bend as if the image held distances from the camera's centre, not depths along z: divide "
                     "them by the length of each pixel's ray (x, y, 1), or check the camera.";
    });
}

void check_ends(const DepthImage& depth, const LengthUnit& unit, Findings& findings) {
    const DepthEnds ends = depth_ends(depth.z_m);
    const auto check = [&](Check id, const std::optional<DepthEnd>& end, const char* which, const char* beyond) {
        must_not(findings, id, end.has_value(), [&] {
            return fmt::format("{:.1f} % of the valid pixels hold exactly {}, the {} depth, {}. They are taken for a "
                               "surface; --depth-range leaves them out.",
                               100 * end->share, unit.text(end->z_m, 4), which,
                               end->apart ? std::string("far from all others, as a file marks holes")
                                          : fmt::format("as if all {} had been cut off there", beyond));
        });
    };
    check(Check::nearest_end, ends.nearest, "smallest", "nearer");
    check(Check::farthest_end, ends.farthest, "largest", "farther away");
}

void check_camera(const Camera& camera, Findings& findings) {
    const Pinhole& pinhole = camera.pinhole;
    const double wide =
        std::max(view_degrees(pinhole.fx, pinhole.size.width), view_degrees(pinhole.fy, pinhole.size.height));
    const double aspect = std::max(pinhole.fx / pinhole.fy, pinhole.fy / pinhole.fx);
    add_finding(findings, Check::view_angle, wide, wide < 1 ? narrowest_degrees : widest_degrees,
                wide < narrowest_degrees || wide > widest_degrees, [&] {
                    return fmt::format("the camera sees an angle of {:.2g} degrees, which no depth camera does ({}; "
                                       "{}).",
                                       wide, describe(camera), camera.origin);
                });
    at_most(findings, Check::pixel_aspect, aspect, largest_aspect, [&] {
        return fmt::format("the camera's pixels are {:.3g} times as long as wide ({}; {}).", aspect, describe(camera),
                           camera.origin);
    });
    const double middle_x = (pinhole.size.width - 1) / 2.0, middle_y = (pinhole.size.height - 1) / 2.0;
    const auto off = [&](double x, double y) {
        return std::max(std::abs(pinhole.cx - x) / pinhole.size.width, std::abs(pinhole.cy - y) / pinhole.size.height);
    };
    const double off_centre = off(middle_x, middle_y);
    const bool turned = off_centre > 2 * near_centre && off(middle_y, middle_x) < near_centre;
    must_not(findings, Check::turned_camera, turned, [&] {
        return fmt::format("the principal point is the middle of a {}x{} image: the camera seems to be that of the "
                           "image before it was turned ({}; {}).",
                           pinhole.size.height, pinhole.size.width, describe(camera), camera.origin);
    });
    add_finding(findings, Check::principal_point, off_centre, farthest_centre, !turned && off_centre > farthest_centre,
                [&] {
                    return fmt::format("the principal point is far from the middle of the image: the camera may be "
                                       "that of another image size, or of the image before it was cropped ({}; {}).",
                                       describe(camera), camera.origin);
                });
    if (!camera.distortion.any())
        return;
    const cv::Mat2f& direction = Undistortion::of(camera)->direction();
    const auto blind =
        std::count_if(direction.begin(), direction.end(), [](const cv::Vec2f& d) { return std::isnan(d[0]); });
    const double share = static_cast<double>(blind) / static_cast<double>(std::max<std::size_t>(direction.total(), 1));
    const bool fisheye = camera.distortion.model == LensModel::kannala_brandt;
    at_most(findings, Check::lens_fold, share, fisheye ? most_blind_fisheye : most_blind, [&] {
        return fmt::format("the lens distortion folds back within the image: {:.0f} % of the pixels have no direction "
                           "({}; {}).",
                           100 * share, describe(camera), camera.origin);
    });
}

} // namespace scanshade
