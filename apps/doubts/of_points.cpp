#include "apps/doubts/of_points.h"

#include "apps/doubts/coordinate_steps.h"
#include "apps/doubts/sentences.h"
#include "io/clouds/cloud_file.h"
#include "io/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

constexpr double least_radius_spacings = 2; ///< in a cloud

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

} // namespace

bool has_hollows(const Cloud& cloud, const PointVisibility& found) {
    constexpr std::size_t looking = 300, seen = 30000;
    constexpr double least_radii = 0.05, least_share_hollow = 0.02;
    if (found.normals.size() != cloud.points.size() || !(found.radius > 0))
        return true;
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

void check_radius_of_points(const Cloud& cloud, const PointVisibility& found, Findings& findings) {
    const double radius = found.radius, spacing = found.spacing;
    if (!(radius > 0))
        return;
    if (spacing > 0 && triangles_of(cloud).empty())
        at_least(findings, Check::radius_in_spacings, radius / spacing, least_radius_spacings, [&] {
            return fmt::format("the radius of {:.3g} is only {:.2g} times the points' spacing of {:.3g}: surfaces "
                               "within it are single points. Give a larger --radius.",
                               radius, radius / spacing, spacing);
        });
    const double extent = extent_of(cloud);
    at_least(findings, Check::radius_in_cloud, extent / radius, 1, [&] {
        return fmt::format("the radius of {:.3g} is larger than the cloud of {:.3g}: give a smaller --radius, or a "
                           "cloud of more than a few points.",
                           radius, extent);
    });
}

void check_points(const Cloud& cloud, Findings& findings) {
    constexpr std::size_t fewest = 10, enough = 100;
    const auto& points = cloud.points;
    const auto valid = static_cast<std::size_t>(
        std::ranges::count_if(points, [](const Eigen::Vector3d& point) { return point.allFinite(); }));
    const bool few = valid > 0 && valid < fewest;
    add_finding(findings, Check::few_points, static_cast<double>(valid), fewest, few && triangles_of(cloud).empty(),
                [&] { return counted(valid, "point") + " cannot show a surface."; });
    double next = points.empty() ? 0 : points.front().x();
    must_not(
        findings, Check::point_numbers,
        points.size() >= enough &&
            std::ranges::all_of(points, [&](const Eigen::Vector3d& point) { return point.x() == next++; }),
        [] {
            return "x is the number of the point: the file's first column counts them, and its coordinates follow.";
        });
}

void check_steps(const Cloud& cloud, const PointVisibility& found, Findings& findings) {
    const double spacing = found.spacing;
    const auto steps = coarse_steps(cloud.points, spacing);
    constexpr double enough_steps = 4; // in the radius: of a voxel grid, whose steps are alike everywhere
    constexpr std::array names{"x", "y", "z"};
    must_not(findings, Check::coordinate_steps, steps && !(steps->in_all && found.radius > enough_steps * steps->step),
             [&] {
                 return fmt::format("coordinates along {} are multiples of {:.3g}, and points stand {:.3g} apart: "
                                    "surfaces are steps. {}",
                                    names.at(static_cast<std::size_t>(steps->axis)), steps->step, spacing,
                                    steps->single_precision
                                        ? "Single precision holds coordinates of that size no better: write them in "
                                          "double precision, or without their offset."
                                        : "Write them with more digits, or give a larger --radius.");
             });
}

void check_unit(const Cloud& cloud, Findings& findings) {
    must_not(findings, Check::degrees, cloud.records && unit_of(*cloud.records).starts_with("degrees"), [] {
        return "the coordinates are in degrees, so distances between points mean nothing: project them first.";
    });
}

} // namespace scanshade
