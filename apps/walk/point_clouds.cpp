// Clouds that no single camera sees.
#include "apps/walk/point_clouds.h"

#include "apps/picture.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
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
    if (!options.points || options.cloud_walk == CloudWalk::view)
        return false;
    if (options.cloud_walk == CloudWalk::points)
        return true;
    if (frame.camera.pinhole.fx != 0)
        return false;
    if (!frame.cloud->organised()) {
        notes.push_back("unorganised cloud: rays from every point (--clouds view computes one camera's view).");
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

PointVisibility visibility_of_points(const Frame& frame, PointMethod& method) {
    const Cloud& cloud = *frame.cloud;
    const auto normals = recorded_normals(cloud);
    const auto triangles = triangles_of(cloud);
    std::optional<Vector3d> scanner;
    if (frame.world_from_camera)
        scanner = frame.world_from_camera->translation();
    PointVisibility found = method.compute({cloud.points, normals, triangles}, scanner);
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
    attached.mean_visibility = known > 0 ? sum / static_cast<double>(known) : std::numeric_limits<double>::quiet_NaN();
    return attached;
}

namespace {

constexpr int side_px = 900;

/// The box without the lowest and highest hundredth of the points along each axis, so that outliers do not shrink the
/// rest.
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
        box.min()[axis] = along[along.size() / 100];
        box.max()[axis] = along[along.size() - 1 - along.size() / 100];
    }
    return box;
}

/// An orthographic view: colour and visibility of the nearest point whose square covers the pixel.
struct SideView {
    cv::Mat3b colour = cv::Mat3b(side_px, side_px, nothing_there);
    cv::Mat1f visibility = cv::Mat1f(side_px, side_px, std::numeric_limits<float>::quiet_NaN());
    cv::Mat1f depth = cv::Mat1f(side_px, side_px, std::numeric_limits<float>::infinity());

    static inline const cv::Vec3b nothing_there{64, 40, 28}, clay{200, 205, 210};

    void put(int u, int v, float z, const cv::Vec3b& of_point, float value) {
        if (u < 0 || v < 0 || u >= side_px || v >= side_px || z >= depth(v, u))
            return;
        depth(v, u) = z;
        colour(v, u) = std::isnan(value) ? nothing_there : of_point;
        visibility(v, u) = value;
    }
};

SideView side_view(const Cloud& cloud, const PointVisibility& found, const Eigen::AlignedBox3d& box,
                   const Vector3d& forward) {
    const Vector3d right = Vector3d(forward.y(), -forward.x(), 0).normalized(), down = forward.cross(right);
    const double scale = 0.96 * side_px / std::max(box.diagonal().norm(), 1e-12);
    const int reach = std::clamp(static_cast<int>(std::lround(0.75 * found.spacing * scale)), 0, 4);
    SideView view;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
        const bool away = !found.normals.empty() && found.normals[i].dot(forward.cast<float>()) > 0.05F;
        if (!cloud.points[i].allFinite() || away)
            continue;
        const Vector3d offset = cloud.points[i] - box.center();
        const double x = side_px / 2.0 + scale * offset.dot(right), y = side_px / 2.0 + scale * offset.dot(down);
        if (!(std::abs(x) < 4 * side_px && std::abs(y) < 4 * side_px))
            continue;
        const int u = static_cast<int>(std::floor(x)), v = static_cast<int>(std::floor(y));
        for (int dv = -reach; dv <= reach; ++dv)
            for (int du = -reach; du <= reach; ++du)
                view.put(u + du, v + dv, static_cast<float>(offset.dot(forward)),
                         cloud.colours.empty() ? SideView::clay : cloud.colours[i], found.visibility[i]);
    }
    return view;
}

} // namespace

cv::Mat3b two_sides(const Cloud& cloud, const PointVisibility& found, double strength) {
    cv::Mat3b picture(2 * side_px, 2 * side_px, SideView::nothing_there);
    const Eigen::AlignedBox3d box = framed_box(cloud);
    if (box.isEmpty())
        return picture;
    for (int side = 0; side < 2; ++side) {
        const double turn = (side == 0 ? 0.15 : 1.15) * std::numbers::pi, tilt = 35 * std::numbers::pi / 180;
        const Vector3d forward(std::cos(tilt) * std::cos(turn), std::cos(tilt) * std::sin(turn), -std::sin(tilt));
        const SideView view = side_view(cloud, found, box, forward);
        const cv::Rect above(side * side_px, 0, side_px, side_px), below(side * side_px, side_px, side_px, side_px);
        shade(view.colour, view.visibility, strength).copyTo(picture(above));
        visibility_picture(view.visibility).copyTo(picture(below));
    }
    return picture;
}

} // namespace scanshade
