#include "apps/results/recording_cloud.h"

#include "apps/page/points.h"
#include "apps/picture.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/glb.h"
#include "io/clouds/recorded_frames.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;

double median_depth_m(const cv::Mat1f& z_m) {
    std::vector<float> known;
    std::copy_if(z_m.begin(), z_m.end(), std::back_inserter(known), [](float z) { return z > 0; });
    return median(std::move(known), 0);
}

} // namespace

std::size_t RecordingCloud::KeyHash::operator()(const Key& key) const {
    const auto part = [&](std::size_t i) { return static_cast<std::uint32_t>(key[i]); };
    return hash(hash(part(0), part(1)), part(2));
}

void RecordingCloud::add(const CloudFrame& frame) {
    const auto& [depth, visibility, confidence, colour, colour_known, pose] = frame;
    if (resolution_m_ <= 0)
        resolution_m_ = 1.5 * median_depth_m(depth.z_m) / depth.camera.fx;
    if (resolution_m_ <= 0)
        return; // nothing seen yet
    const Pinhole& camera = depth.camera;
    const std::size_t first = cells_.size();
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u) {
            const double z = depth.z_m(v, u);
            if (!(z > 0) || std::isnan(visibility(v, u)))
                continue;
            const float sure = std::isnan(confidence(v, u)) ? 0.0F : confidence(v, u);
            const bool coloured = !colour.empty() && (colour_known.empty() || colour_known(v, u) != 0);
            const cv::Vec3b bgr = coloured ? colour(v, u) : cv::Vec3b();
            add_point(pose * camera.point(u, v, z), static_cast<float>((0.05 + sure) / (z * z)), visibility(v, u), sure,
                      coloured ? &bgr : nullptr);
        }
    ++frames_;
    images_.push_back({camera, pose, first, cells_.size()});
}

void RecordingCloud::add(const CloudSweep& sweep) {
    if (resolution_m_ <= 0)
        resolution_m_ = sweep.spacing_m;
    if (resolution_m_ <= 0)
        throw Error("the points' spacing is not known: give --cloud-resolution");
    for (std::size_t i = 0; i < sweep.points.size(); ++i) {
        if (!sweep.points[i].allFinite() || std::isnan(sweep.visibility[i]))
            continue;
        const float sure = sweep.confidence.empty() || std::isnan(sweep.confidence[i]) ? 0.0F : sweep.confidence[i];
        add_point(sweep.world_from_scanner * sweep.points[i], 0.05F + sure, sweep.visibility[i], sure,
                  sweep.colours.empty() ? nullptr : &sweep.colours[i]);
    }
    ++frames_;
    has_sweeps_ = true;
}

void RecordingCloud::add_point(const Vector3d& point, float weight, float visibility, float confidence,
                               const cv::Vec3b* bgr) {
    const Vector3d place = (point / resolution_m_).array().floor();
    if (!(place.array().abs() < 2e9).all()) // unlike maxCoeff(), also for NaN
        throw Error(fmt::format("a point {} from the origin, in cubes of {}: farther than can be counted",
                                unit_.text(point.norm()), unit_.text(resolution_m_)));
    const auto whole = [&](Eigen::Index axis) { return static_cast<std::int32_t>(place[axis]); };
    const auto [known, is_new] = index_.try_emplace(Key{whole(0), whole(1), whole(2)}, cells_.size());
    if (is_new)
        cells_.emplace_back();
    Cell& cell = cells_[known->second];
    cell.weight += weight;
    cell.point += static_cast<double>(weight) * point;
    cell.visibility += weight * visibility;
    cell.confidence = std::max(cell.confidence, confidence);
    cell.views += cell.last_frame != frames_;
    cell.last_frame = frames_;
    if (!bgr)
        return;
    cell.colour_weight += weight;
    cell.colour += weight * Eigen::Vector3f((*bgr)[0], (*bgr)[1], (*bgr)[2]);
}

RecordingCloud::Columns RecordingCloud::columns() const {
    Columns all;
    auto& [points, colours, visibility, confidence, views] = all;
    const bool coloured = std::ranges::any_of(cells_, [](const Cell& cell) { return cell.colour_weight > 0; });
    for (const Cell& cell : cells_) {
        points.push_back(cell.point * (unit_.told(1) / cell.weight));
        visibility.push_back(cell.visibility / static_cast<float>(cell.weight));
        confidence.push_back(cell.confidence);
        views.push_back(static_cast<float>(cell.views));
        if (!coloured)
            continue;
        const Eigen::Vector3f bgr =
            cell.colour_weight > 0 ? Eigen::Vector3f(cell.colour / cell.colour_weight) : Eigen::Vector3f(128, 128, 128);
        colours.emplace_back(cv::saturate_cast<uchar>(bgr[0]), cv::saturate_cast<uchar>(bgr[1]),
                             cv::saturate_cast<uchar>(bgr[2]));
    }
    return all;
}

std::string RecordingCloud::merged_within() const {
    return unit_.arbitrary() ? unit_.text(resolution_m_) : fmt::format("{:.6f} m", resolution_m_);
}

void RecordingCloud::write_for_page(const std::filesystem::path& folder, const std::string& stem,
                                    std::size_t most) const {
    const Columns all = columns();
    (void)page::write_points(
        folder, stem,
        {.points = all.points, .colours = all.colours, .visibility = all.visibility, .confidence = all.confidence},
        most);
}

/// Of images, with all that a later run needs to see the points from where they were seen.
std::vector<std::string> RecordingCloud::comments(std::span<const Vector3d> points) const {
    std::vector<std::string> all{fmt::format("one cloud of {} frames, merged within {}", frames_, merged_within())};
    if (has_sweeps_)
        return all;
    std::vector<FoundFrame> images = images_;
    for (FoundFrame& image : images)
        image.world_from_camera.translation() *= unit_.told(1);
    std::ranges::move(frame_comments(images, points), std::back_inserter(all));
    return all;
}

void RecordingCloud::write(const std::filesystem::path& file) const {
    const auto [points, colours, visibility, confidence, views] = columns();
    if (lower_extension(file) == ".glb") {
        const std::vector<cv::Vec3b> grey = colours.empty() ? greys(visibility) : std::vector<cv::Vec3b>();
        (void)write_glb(
            file,
            {.name = file.stem().string(),
             .points = points,
             .triangles = {},
             .normals = {},
             .colours = colours.empty() ? grey : colours,
             .fields = {{"_AMBIENT_OCCLUSION", visibility}, {"_AO_CONFIDENCE", confidence}, {"_AO_VIEWS", views}}});
        return;
    }
    write_new_ply(file, points, colours,
                  {{"ambient_occlusion", visibility}, {"ao_confidence", confidence}, {"ao_views", views}},
                  comments(points));
}

} // namespace scanshade
