#include "apps/budget/fused_reference.h"

#include "ao/raycast/depth_surface.h"
#include "projection/attach.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "projection/base/spread.h"
#include "projection/project.h"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <tbb/parallel_for.h>
#include <unordered_map>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Sums of the points and normals in one cube of space.
struct Voxel {
    Vector3d point = Vector3d::Zero(), normal = Vector3d::Zero();
    double footprint_m = 0; ///< sum of the pixels' widths on the surface
    int count = 0;
};

using Cell = std::array<int, 3>;
struct CellHash {
    std::size_t operator()(const Cell& cell) const {
        const auto part = [&](std::size_t i) { return static_cast<std::uint32_t>(cell[i]); };
        return hash(hash(part(0), part(1)), part(2));
    }
};
using Voxels = std::unordered_map<Cell, Voxel, CellHash>;

Vector3d vector(const cv::Vec3f& v) { return {v[0], v[1], v[2]}; }

/// Calls use(row, column, point, normal) for the pixels with depth and normal, in camera space.
template <class Use>
void each_surface_pixel(const DepthImage& depth, const cv::Mat3f& normals, int row, Use&& use) {
    for (int u = 0; u < depth.z_m.cols; ++u) {
        const double z = depth.z_m(row, u);
        const Vector3d normal = vector(normals(row, u));
        if (z > 0 && normal.squaredNorm() > 0.5)
            use(u, depth.camera.point(u, row, z), normal);
    }
}

std::vector<Disc> discs_of(const Voxels& voxels, double voxel_m) {
    std::vector<Disc> discs;
    discs.reserve(voxels.size());
    for (const auto& [cell, voxel] : voxels)
        if (voxel.normal.norm() >
            0.5 * voxel.count) // the two faces of a thin surface must not become one disc between them
            discs.push_back({voxel.point / voxel.count, voxel.normal.normalized(),
                             0.75 * std::max(voxel_m, voxel.footprint_m / voxel.count)});
    return discs;
}

std::vector<std::size_t> posed(const Capture& capture) {
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < capture.entries.size(); ++i)
        if (capture.entries[i].world_from_camera && capture.entries[i].problem.empty())
            indices.push_back(i);
    return indices;
}

} // namespace

FusedReference::FusedReference(gpu::Device& device, const std::filesystem::path& path, const TrialCapture& trial,
                               const CaptureOptions& options)
    : noise_(trial.noise), radius_m_(trial.radius_m), voxel_m_(trial.radius_m / 25), directions_(rays, 1) {
    if (noise_.needs_preparation())
        fit_.emplace(device, noise_);
    const Capture capture = open_capture(path, options);
    require_metres(capture, "a reference");
    const std::vector<std::size_t> frames = posed(capture);
    if (frames.size() < 2)
        throw Error(
            fmt::format("{}: nothing to compare with: no truth/ao, and {} frames with poses (two or more make a "
                        "reference)",
                        path.string(), frames.size()));
    Voxels voxels;
    const std::vector<std::size_t> taken = spread(most_frames, frames.size());
    for (const std::size_t index : taken)
        during("frame " + capture.entries[frames[index]].name, [&] {
            Frame frame = capture.load(frames[index]);
            frame.camera = camera_of(frame);
            const Surface surface = surface_of(project(frame));
            const Isometry3d& pose = *frame.world_from_camera;
            for (int row = 0; row < surface.depth.z_m.rows; ++row)
                each_surface_pixel(
                    surface.depth, surface.normals.normals, row,
                    [&](int, const Vector3d& point, const Vector3d& normal) {
                        if (noise_.at(point.z()) > 0.1 * radius_m_)
                            return;
                        const Vector3d world = pose * point;
                        const Vector3d at = world / voxel_m_;
                        Voxel& voxel =
                            voxels[{static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())),
                                    static_cast<int>(std::floor(at.z()))}];
                        voxel.point += world;
                        voxel.normal += pose.linear() * normal;
                        voxel.footprint_m += point.z() / surface.depth.camera.fx;
                        ++voxel.count;
                    });
        });
    discs_ = discs_of(voxels, voxel_m_);
    surface_.emplace(discs_);
    description_ = fmt::format(
        "ray casting ({} rays) against the cloud fused of {} posed frames ({} discs): no truth: it contains "
        "the sensor's noise and the poses' errors",
        rays, taken.size(), discs_.size());
}

FusedReference::Surface FusedReference::surface_of(const DepthImage& depth) {
    if (!fit_)
        return {depth, normals_of(depth)};
    FittedDepth fitted = fit_->compute(depth);
    if (!fit_->planes())
        return {fitted.depth, normals_of(fitted.depth)};
    return {std::move(fitted.depth), std::move(fitted.normals)};
}

std::optional<RayStart> FusedReference::start(const Vector3d& eye, const Vector3d& seen, double sigma_m) const {
    const double range = (seen - eye).norm(), tolerance_m = 0.1 * radius_m_ + 2 * sigma_m;
    const Vector3d direction = (seen - eye) / range;
    const auto met = surface_->nearest(eye, direction, std::max(range - tolerance_m, 0.0));
    if (!met || met->distance > range + tolerance_m)
        return std::nullopt;
    const Disc& disc = discs_[static_cast<std::size_t>(met->primitive)];
    const Vector3d normal = disc.normal.dot(direction) > 0 ? Vector3d(-disc.normal) : disc.normal;
    const double lift_m = disc.radius_m * std::tan(std::numbers::pi / 18) + sigma_m;
    return RayStart{eye + met->distance * direction, normal, 0, lift_m, disc.radius_m, {}};
}

cv::Mat1f FusedReference::visibility(const TrialFrame& frame) const {
    AoMap ao{cv::Mat1f(frame.depth.z_m.size(), std::numeric_limits<float>::quiet_NaN())};
    if (frame.frame.world_from_camera) {
        const Isometry3d& pose = *frame.frame.world_from_camera;
        const RayHemisphere hemisphere(*surface_, directions_, radius_m_, false);
        tbb::parallel_for(0, ao.visibility.rows, [&](int row) {
            for (int u = 0; u < ao.visibility.cols; ++u) {
                const double z = frame.depth.z_m(row, u);
                if (z <= 0)
                    continue;
                auto from = start(pose.translation(), pose * frame.depth.camera.point(u, row, z), noise_.at(z));
                if (!from)
                    continue;
                from->key = hash(static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(u));
                ao.visibility(row, u) = hemisphere.at(*from).visibility[0];
            }
        });
    }
    return attach(frame.frame, frame.depth, ao).visibility;
}

} // namespace scanshade
