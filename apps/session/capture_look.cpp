// Before a capture's first frame: radius, clouds, doubts.
#include "apps/session/capture_look.h"

#include "ao/cloud/cloud_ao.h"
#include "apps/doubts/pose_check.h"
#include "apps/frame/first_look.h"
#include "apps/frame/point_clouds.h"
#include "projection/base/statistics.h"
#include "projection/scene_extent.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace scanshade {
namespace {

/// The middle one of the views' extents; 0 where none shows anything.
double typical_extent(std::span<const DepthImage> views) {
    std::vector<double> extents;
    for (const DepthImage& view : views)
        if (const SceneExtent scene = scene_extent(view); scene.diagonal_m > 0)
            extents.push_back(scene.diagonal_m);
    return median(std::move(extents), 0);
}

/// A radius of half the scene looks mostly at what no view shows (doubts/of_view.cpp). Near that, since views differ,
/// it is the longest of 0.2, 0.1, 0.05, 0.02 ... m that is no more than a quarter of the scene: few values, so that
/// captures of one thing share theirs.
double suited_radius(double usual, double extent) {
    constexpr double least_radii = 2.5, least_scene_m = 0.02; // smaller ones are in a wrong unit
    if (extent >= least_radii * usual || extent < least_scene_m)
        return usual;
    const double most = extent / 4, decade = std::pow(10, std::floor(std::log10(most)));
    const double step = most >= 5 * decade ? 5 : most >= 2 * decade ? 2 : 1;
    return std::min(usual, step * decade);
}

/// Whether these are clouds without a grid that one camera took each.
bool are_single_views(std::span<const DepthImage> seen, const LoadedFrames& loaded) {
    const bool no_grid = std::ranges::none_of(loaded, [](const auto& each) {
        return !each.second.frame.cloud || each.second.frame.cloud->organised() ||
               each.second.frame.camera.pinhole.fx != 0;
    });
    return no_grid && std::ranges::none_of(seen, [](const DepthImage& view) { return view.z_m.empty(); });
}

bool measures_noise(const RunSettings& asked) { return asked.depth_noise == "auto"; }

} // namespace

bool needs_look(const RunSettings& asked) { return measures_noise(asked) || !asked.gives_radius(); }

CaptureLook look_at(std::span<const DepthImage> seen, const RunSettings& asked) {
    CaptureLook look;
    look.noise = measures_noise(asked) ? measure_noise(seen) : noise_from_text(asked.depth_noise);
    look.extent_m = typical_extent(seen);
    return look;
}

CaptureLook look_at(const Capture& capture, const std::vector<std::size_t>& frames, const RunSettings& asked,
                    LoadedFrames& loaded, bool with_colour) {
    const bool images = std::ranges::all_of(capture.entries, [](const auto& entry) { return entry.cloud.empty(); });
    if (!needs_look(asked) || (!measures_noise(asked) && !images))
        return look_at({}, asked);
    const bool by_points = asked.clouds != CloudWalk::view && !capture.camera;
    const std::vector<DepthImage> seen =
        first_look(capture, frames, &loaded, with_colour,
                   by_points ? CloudAo(asked.cloud_ao()).most_at_once() : std::numeric_limits<std::size_t>::max(),
                   measures_noise(asked) && asked.clouds != CloudWalk::points);
    CaptureLook look = look_at(seen, asked);
    if (capture.unit.arbitrary())
        look.extent_m = 0;
    // Rays from the points of noisy clouds read far walls as closed.
    if (by_points && measures_noise(asked) && !images && asked.clouds == CloudWalk::automatic &&
        are_single_views(seen, loaded)) {
        look.as_views = look.noise.any();
        if (!look.as_views)
            look.noise = {};
    }
    return look;
}

CloudWalk cloud_walk_for(const RunSettings& asked, const CaptureLook& look) {
    if (asked.chosen_setup().make_for_points())
        return CloudWalk::points;
    return look.as_views ? CloudWalk::view : asked.clouds;
}

bool computes_points(const Capture& capture, const LoadedFrames& loaded, CloudWalk walk) {
    if (capture.camera && walk != CloudWalk::points)
        return false;
    std::vector<std::string> unused;
    return std::ranges::none_of(capture.entries, [](const auto& entry) { return entry.cloud.empty(); }) &&
           walk != CloudWalk::view &&
           std::ranges::all_of(loaded, [&](const auto& each) { return takes_points(each.second.frame, walk, unused); });
}

double radius_for(const RunSettings& asked, const CaptureLook& look) {
    const double usual = asked.radius_m();
    return asked.gives_radius() || !(look.extent_m > 0) ? usual : suited_radius(usual, look.extent_m);
}

std::vector<std::string> warnings_about(const RunSettings& asked, const CaptureLook& look, double radius_m) {
    std::vector<std::string> warnings;
    if (radius_m != asked.radius_m())
        warnings.push_back(fmt::format(
            "the scene is only {:.2g} m large, so the radius is {} m; --radius sets another. If the scene is "
            "larger, check the depth unit.",
            look.extent_m, radius_m));
    if (look.as_views && cloud_walk_for(asked, look) == CloudWalk::view)
        warnings.emplace_back(
            "points seen by one camera at the origin, with a depth sensor's noise: they are computed as its image. "
            "--clouds points casts rays from every point.");
    return warnings;
}

std::string noise_origin(const RunSettings& asked) {
    return asked.depth_noise == "auto" ? "measured" : "--depth-noise";
}

std::string noise_sentence(const DepthNoise& noise, const RunSettings& asked, const LengthUnit& unit) {
    const std::string origin = noise_origin(asked);
    const std::string flying = !noise.flies()      ? ""
                               : asked.drop_flying ? "flying pixels are dropped; "
                                                   : "flying pixels are kept; ";
    const bool planes = noise.any() && asked.depth_smoothing > 0;
    return fmt::format("{} ({}); {}{}", describe(noise, unit), origin, flying,
                       planes ? "depth and normals come from plane fits" : "depth is used as recorded");
}

CaptureFindings findings_about(const Capture& capture, const std::vector<std::size_t>& frames, const RunSettings& asked,
                               const std::function<Frame(std::size_t)>& load) {
    CaptureFindings found;
    if (const PoseCheck poses = check_poses(capture, frames, load); !poses.warning.empty()) {
        found.warnings.push_back(poses.warning);
        must_not(found.findings, Check::pose_scale, poses.doubts_depths, [&] { return poses.warning; });
    }
    if (asked.sequence == SequenceUse::on && !asked.in_sequence(capture))
        found.warnings.emplace_back("--sequence on: fewer than two frames have a pose, so each is computed by itself.");
    return found;
}

} // namespace scanshade
