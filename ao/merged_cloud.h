// Clouds that were merged from depth frames: where the order of their points tells the frames, they are computed as the
// depth images that they were, and by rays; each value is the mean of both.
#pragma once

#include "ao/cloud/cloud_ao.h"
#include "ao/fit_plane/fit_plane.h"
#include "projection/found_frames.h"

#include <functional>

namespace scanshade {

/// How the frames of a merged cloud are computed as images.
struct MergedImages {
    std::function<gpu::Device&()> device; ///< asked for once frames are found; throws Error where there is none
    FitPlaneOptions preparation = {};
};

/// Rays from every point of any cloud. Where the cloud's file names its depth frames, or found_frames() explains 95 %
/// of the points and more, their cameras tell the sides of surfaces, and `surfel` computes the frames as those of a
/// recording (ao/sequence). Both estimates miss
/// other things: images what no frame saw and what is behind its surfaces, rays what noise hides. Their mean, each
/// weighted by its expected error, has less error than either.
class MergedCloudAo final : public PointMethod {
  public:
    /// Throws Misuse that names a setting out of its range.
    MergedCloudAo(const CloudAoOptions& options, gpu::Device* device, MergedImages images)
        : options_(options), rays_(options, device), images_(std::move(images)) {}

    PointVisibility compute(const PointSet& cloud, const std::optional<Eigen::Vector3d>& scanner = {}) override;

    [[nodiscard]] std::size_t most_at_once() const override { return rays_.most_at_once(); }
    [[nodiscard]] std::string fingerprint() const override { return rays_.fingerprint(); }
    PointVisibility compute_large(PointSource& source, TileStore& store, double shown,
                                  const std::function<bool()>& stop) override {
        return rays_.compute_large(source, store, shown, stop);
    }

  private:
    [[nodiscard]] bool looks_for_frames(const PointSet& cloud) const;
    struct Frames;
    [[nodiscard]] static std::optional<Frames> frames_of(const PointSet& cloud);
    [[nodiscard]] static std::string note_on(const Frames& frames, bool named);
    void add_images(PointVisibility& result, const PointSet& cloud, const Frames& frames) const;

    CloudAoOptions options_;
    CloudAo rays_;
    MergedImages images_;
};

} // namespace scanshade
