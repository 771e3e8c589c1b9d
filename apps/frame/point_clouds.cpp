// Clouds that no single camera sees.
#include "apps/frame/point_clouds.h"

#include "ao/cloud/surface/cloud_surface.h"
#include "io/clouds/cloud_edit.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/format.h"
#include "io/clouds/recorded_frames.h"
#include "projection/base/error.h"
#include "projection/pixel_cloud.h"
#include "projection/project.h"

#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace scanshade {

using Eigen::Vector3d;

bool takes_points(const Frame& frame, CloudWalk walk, std::vector<std::string>& notes) {
    if (walk == CloudWalk::view)
        return false;
    if (walk == CloudWalk::points)
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

bool is_one_view(const Frame& frame) {
    constexpr std::size_t fewest = 30000;
    constexpr double nearest_m = 0.1, farthest_m = 30;
    const std::vector<Vector3d>& points = frame.cloud->points;
    if (frame.cloud->organised() || points.size() < fewest || !splats_of(*frame.cloud).empty())
        return false;
    if (const double middle = middle_depth(*frame.cloud); middle < nearest_m || middle > farthest_m)
        return false;
    try {
        (void)camera_of(frame);
    } catch (const Error&) {
        return false;
    }
    const NormalOrientation seen = guessed_orientation(points, std::nullopt, false);
    return seen.kind == NormalOrientation::Kind::viewpoint && seen.point.isZero() && triangles_of(*frame.cloud).empty();
}

std::optional<Vector3d> scanner_of(const Frame& frame) {
    if (!frame.world_from_camera)
        return std::nullopt;
    const CloudRecords* records = frame.cloud->records.get();
    return records && records->viewpoint ? Vector3d(records->viewpoint->translation()) : Vector3d(Vector3d::Zero());
}

PointVisibility visibility_of_points(const Frame& frame, PointMethod& method) {
    const Cloud& cloud = *frame.cloud;
    const auto normals = recorded_normals(cloud);
    const auto triangles = triangles_of(cloud);
    // A sweep's pose is its scanner's. A viewpoint in a file is as often what the program writes that knows none.
    const bool from_scanner = frame.world_from_camera && !(cloud.records && cloud.records->viewpoint);
    const std::span<const Splat> splats = splats_of(cloud);
    const std::vector<Vector3d> with_haze = splats.empty() ? std::vector<Vector3d>() : points_with_haze(cloud);
    PointSet set{splats.empty() ? cloud.points : with_haze, normals, triangles, z_is_up(cloud), from_scanner};
    set.splats = splats;
    if (cloud.records)
        set.stations = cloud.records->stations;
    std::vector<std::string> disbelief;
    const std::vector<FoundFrame> frames = recorded_frames(cloud, disbelief);
    set.frames = splats.empty() ? std::span(frames) : std::span(cloud.records->cameras);
    PointVisibility found = method.compute(set, scanner_of(frame));
    std::ranges::move(disbelief, std::back_inserter(found.notes));
    if (!splats.empty())
        found.notes.insert(found.notes.begin(),
                           fmt::format("{} Gaussian splats ({}).", splats.size(), cloud.records->format->name));
    else if (normals.empty() && cloud.records && normal_fields(*cloud.records))
        found.notes.emplace_back("the file's normals are not used: fewer than nine in ten points have one.");
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
        const bool counts = has_value && cloud.points[i].allFinite(); // haze has a value, and is no point
        known += counts;
        sum += counts ? static_cast<double>(attached.per_point[i]) : 0;
    }
    attached.coverage = valid > 0 ? static_cast<double>(known) / static_cast<double>(valid) : 0;
    attached.mean_visibility = known > 0 ? sum / static_cast<double>(known) : std::numeric_limits<double>::quiet_NaN();
    return attached;
}

} // namespace scanshade
