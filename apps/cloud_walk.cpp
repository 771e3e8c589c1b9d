// Clouds that no single camera sees.
#include "apps/cloud_walk.h"

#include "io/cloud_file.h"
#include "io/cloud_records.h"
#include "projection/error.h"
#include "projection/project.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>

namespace scanshade {

using Eigen::Vector3d;

bool takes_points(const Frame& frame, const BatchOptions& options, std::vector<std::string>& notes) {
    if (!options.cloud_ao || options.cloud_walk == CloudWalk::view)
        return false;
    if (options.cloud_walk == CloudWalk::points)
        return true;
    if (frame.camera.pinhole.fx != 0)
        return false;
    if (!frame.cloud->organised()) {
        notes.push_back("unorganised cloud: rays from every point (--clouds view would look at it with one camera).");
        return true;
    }
    try {
        (void)camera_of(frame);
        return false;
    } catch (const Error& none) {
        notes.push_back(fmt::format("{}: rays from every point.", none.what()));
        return true;
    }
}

CloudVisibility cloud_visibility(const Frame& frame, const CloudAo& method) {
    const Cloud& cloud = *frame.cloud;
    const auto normals = recorded_normals(cloud);
    const auto triangles = triangles_of(cloud);
    std::optional<Vector3d> scanner;
    if (frame.world_from_camera)
        scanner = frame.world_from_camera->translation();
    CloudVisibility found = method.compute({cloud.points, normals, triangles}, scanner);
    if (const std::string unit = cloud.records ? unit_of(*cloud.records) : ""; !unit.empty())
        found.notes.insert(found.notes.begin(), fmt::format("coordinates are in {}.", unit));
    return found;
}

Attached attached_points(const Cloud& cloud, std::vector<float> visibility) {
    Attached attached;
    attached.per_point = std::move(visibility);
    std::size_t known = 0, valid = 0;
    double sum = 0;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
        const bool has_value = !std::isnan(attached.per_point[i]);
        valid += cloud.points[i].allFinite();
        known += has_value;
        sum += has_value ? static_cast<double>(attached.per_point[i]) : 0;
    }
    attached.coverage = valid > 0 ? static_cast<double>(known) / static_cast<double>(valid) : 0;
    attached.mean_visibility =
        known > 0 ? sum / static_cast<double>(known) : std::numeric_limits<double>::quiet_NaN();
    return attached;
}

namespace {

constexpr int side_px = 900;

/// The box of all but the lowest and highest two in a thousand points along each axis: strays must not shrink the rest.
Eigen::AlignedBox3d framed_box(const Cloud& cloud) {
    Eigen::AlignedBox3d box;
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<double> along;
        const std::size_t step = std::max<std::size_t>(1, cloud.points.size() / 200000);
        for (std::size_t i = 0; i < cloud.points.size(); i += step)
            if (cloud.points[i].allFinite())
                along.push_back(cloud.points[i][axis]);
        if (along.empty())
            return {};
        std::sort(along.begin(), along.end());
        box.min()[axis] = along[along.size() / 500];
        box.max()[axis] = along[along.size() - 1 - along.size() / 500];
    }
    return box;
}

/// Where the points fall, looking along `forward`; the nearest wins.
cv::Mat1i nearest_points(const Cloud& cloud, const Eigen::AlignedBox3d& box, const Vector3d& forward, int px) {
    const Vector3d right = Vector3d(forward.y(), -forward.x(), 0).normalized(), down = forward.cross(right);
    const double scale = 0.96 * px / std::max(box.diagonal().norm(), 1e-12);
    cv::Mat1i shown(px, px, -1);
    cv::Mat1d depth(px, px, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
        if (!cloud.points[i].allFinite())
            continue;
        const Vector3d offset = cloud.points[i] - box.center();
        const int u = static_cast<int>(std::floor(px / 2.0 + scale * offset.dot(right)));
        const int v = static_cast<int>(std::floor(px / 2.0 + scale * offset.dot(down)));
        if (u < 0 || v < 0 || u >= px || v >= px || offset.dot(forward) >= depth(v, u))
            continue;
        depth(v, u) = offset.dot(forward);
        shown(v, u) = static_cast<int>(i);
    }
    return shown;
}

/// As many pixels as can show about two points each.
int picture_px(const Cloud& cloud) {
    const auto wanted = static_cast<int>(1.5 * std::sqrt(static_cast<double>(cloud.points.size())));
    return std::clamp(wanted, 64, side_px);
}

} // namespace

cv::Mat3b two_sides(const Cloud& cloud, const std::vector<float>& visibility, double strength) {
    const cv::Vec3b none(64, 40, 28), clay(200, 205, 210);
    const Eigen::AlignedBox3d box = framed_box(cloud);
    const int px = picture_px(cloud);
    cv::Mat3b picture(side_px, 2 * side_px, none);
    if (box.isEmpty())
        return picture;
    for (int side = 0; side < 2; ++side) {
        const double turn = (side == 0 ? 0.15 : 1.15) * std::numbers::pi, tilt = 35 * std::numbers::pi / 180;
        const Vector3d forward(std::cos(tilt) * std::cos(turn), std::cos(tilt) * std::sin(turn), -std::sin(tilt));
        const cv::Mat1i shown = nearest_points(cloud, box, forward, px);
        cv::Mat3b colour(px, px, none);
        cv::Mat1f seen(px, px, 1.0F);
        for (int v = 0; v < px; ++v)
            for (int u = 0; u < px; ++u)
                if (const int point = shown(v, u); point >= 0 && !std::isnan(visibility[static_cast<std::size_t>(point)])) {
                    colour(v, u) = cloud.colours.empty() ? clay : cloud.colours[static_cast<std::size_t>(point)];
                    seen(v, u) = visibility[static_cast<std::size_t>(point)];
                }
        const cv::Mat3b shaded = shade(colour, seen, strength);
        for (int v = 0; v < side_px; ++v)
            for (int u = 0; u < side_px; ++u)
                picture(v, side * side_px + u) = shaded(v * px / side_px, u * px / side_px);
    }
    return picture;
}

} // namespace scanshade
