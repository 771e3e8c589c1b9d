#include "apps/frame/frame_steps.h"

#include "apps/frame/point_clouds.h"
#include "apps/frame/sequence_steps.h"
#include "io/clouds/cloud_file.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"
#include "projection/project.h"
#include "projection/sensor/expected_error.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <iterator>

namespace scanshade {
namespace {

double share(std::ptrdiff_t part, std::size_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

/// Pixels or points that hold a depth / all of them.
double valid_share(const Frame& frame) {
    if (!frame.cloud)
        return share(cv::countNonZero(frame.depth_m > 0), frame.depth_m.total());
    const auto& points = frame.cloud->points;
    return share(std::count_if(points.begin(), points.end(), [](const auto& p) { return p.allFinite(); }),
                 points.size());
}

std::string why_no_point_is_seen(const Frame& frame, const ProjectOptions& range) {
    double nearest = std::numeric_limits<double>::infinity(), farthest = 0;
    for (const Eigen::Vector3d& point : frame.cloud->points)
        if (point.allFinite() && point.z() > 0) {
            nearest = std::min(nearest, point.z());
            farthest = std::max(farthest, point.z());
        }
    if (farthest > 0 && (nearest > range.far_m || farthest < range.near_m))
        return fmt::format("the points' z is {:.4g} to {:.4g}, taken for metres, of which {:g} to {:g} are used "
                           "(--depth-range). --clouds points computes clouds of any unit",
                           nearest, farthest, range.near_m, range.far_m);
    return fmt::format("the camera sees none of the recorded points ({}; {})", describe(frame.camera),
                       frame.camera.origin);
}

/// A camera that sees none of the points is an error, not an empty result. (No depth at all is a result.)
void refuse_blind_view(const Work& work, const ProjectOptions& range) {
    if (work.row.valid_share == 0 || cv::countNonZero(work.depth.z_m) > 0)
        return;
    const std::string reason = work.frame.cloud
                                   ? why_no_point_is_seen(work.frame, range)
                                   : fmt::format("no depth is within {:g} and {:g} m", range.near_m, range.far_m);
    const std::vector<std::string> doubts = doubts_in(work.frame.findings);
    throw Error(fmt::format("{}{}{}", reason, doubts.empty() ? "" : "; ", fmt::join(doubts, " ")));
}

void require_memory_for(const Cloud& cloud) {
    constexpr std::uint64_t bytes_per_point = 300; // surface, tree, rays and picture, beyond the cloud itself
    const std::size_t count = cloud.points.size();
    require_memory(count * bytes_per_point, fmt::format("visibility of {} points", count));
}

void take_points(Work& work, PointVisibility found) {
    work.of_points = std::move(found);
    std::ranges::copy(work.of_points.notes, std::back_inserter(work.row.notes));
    std::ranges::copy(work.of_points.findings, std::back_inserter(work.row.findings));
    work.confidence.per_point = confidence_of_points(work.of_points.error);
    work.error.per_point = std::move(work.of_points.error);
    work.row.passes = work.of_points.timings;
    work.attached = attached_points(*work.frame.cloud, work.of_points.visibility);
}

void compute_alone(Work& work, FrameAo& method, const DepthNoise& noise) {
    work.ao = method.compute(work.depth, noise);
    work.fitted = method.fitted_depth();
    work.fitted_normals = method.fitted_normals();
    work.row.passes = method.timings();
    std::ranges::copy(method.findings(), std::back_inserter(work.row.findings));
    std::ranges::copy(method.warnings(), std::back_inserter(work.row.warnings));
}

} // namespace

void describe_frame(Work& work) {
    const Frame& frame = work.frame;
    FrameRow& row = work.row;
    row.size = frame.cloud ? frame.cloud->grid : frame.depth_m.size();
    row.valid_share = valid_share(frame);
    row.warnings = frame.warnings;
    if (frame.registration == Registration::yes && !frame.cloud && !frame.colour.empty() &&
        frame.colour.size() != frame.depth_m.size())
        row.warnings.push_back(fmt::format("colour is {}x{}, depth {}x{}: shaded shows clay.", frame.colour.cols,
                                           frame.colour.rows, frame.depth_m.cols, frame.depth_m.rows));
}

void choose_points_or_view(Work& work, CloudWalk walk) {
    work.by_points = work.frame.cloud && takes_points(work.frame, walk, work.row.notes);
    if (work.frame.cloud && !work.by_points && !splats_of(*work.frame.cloud).empty())
        must_not(work.row.findings, Check::splats_in_view, true, [] {
            return "one camera's view takes Gaussian splats for solid points at their centres; --clouds points sees "
                   "their shapes and opacities.";
        });
}

void prepare_view(Work& work, const ProjectOptions& range) {
    work.frame.camera = work.row.camera = camera_of(work.frame);
    work.depth = project(work.frame, range);
    refuse_blind_view(work, range);
}

void compute_view(Work& work, FrameAo& method, const DepthNoise& noise, const Capture& capture, SequenceAo* sequence) {
    work.finishers = method.finishers();
    double gain = 0;
    if (sequence)
        gain = compute_in_sequence(work, capture, *sequence);
    else
        compute_alone(work, method, noise);
    work.errors = method.errors(noise, gain);
}

void compute_points(Work& work, PointMethod& points) {
    require_memory_for(*work.frame.cloud);
    take_points(work, visibility_of_points(work.frame, points));
}

void compute_points(Work& work, PointMethod& points, const PointSet& set,
                    const std::optional<Eigen::Vector3d>& scanner) {
    require_memory_for(*work.frame.cloud);
    take_points(work, points.compute(set, scanner));
}

ComputedFrame computed_frame(const Work& work) {
    return {work.frame,
            work.row.camera,
            work.row.valid_share,
            work.row.coverage,
            work.depth,
            work.ao.visibility,
            work.by_points ? &work.of_points : nullptr};
}

FrameImages attach_values(Work& work, const FrameOptions& options, const Outputs& outputs, bool every_error) {
    FrameImages images;
    FrameRow& row = work.row;
    if (work.by_points) {
        row.expected_error = work.of_points.expected_error.value_or(std::nan(""));
    } else {
        images = finish(work, options, outputs, every_error);
        row.expected_error =
            expected_rms_of(work.depth, work.ao.visibility, options.radius_m, options.noise, work.errors);
    }
    row.coverage = work.attached.coverage;
    row.mean_visibility = work.attached.mean_visibility;
    std::ranges::move(findings_about(computed_frame(work), options.radius_m, options.noise, options.outputs.unit),
                      std::back_inserter(row.findings));
    if (!work.by_points)
        std::ranges::copy(options.findings, std::back_inserter(row.findings));
    std::ranges::move(warnings_in(row.findings), std::back_inserter(row.warnings));
    return images;
}

} // namespace scanshade
