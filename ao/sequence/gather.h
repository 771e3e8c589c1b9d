// The mean of several frames' visibility on one frame's pixels: sampling noise, the sensor's noise and single views'
// blind spots average out. Any method's visibility will do.
//
// Reverse reprojection caching (Nehab et al. 2007) without its recursion: offline, every frame can be asked itself.
#pragma once

#include "ao/base/method.h"
#include "ao/gpu/program.h"

#include <memory>

namespace scanshade {

/// One frame's visibility, a 32-bit float a pixel, and where it was found.
struct Seen {
    const PackedSurfaces* surfaces;
    std::shared_ptr<const gpu::DeviceBytes> visibility;
    Eigen::Isometry3d here_from_there = Eigen::Isometry3d::Identity();
};

struct GatherOptions {
    double radius_m; ///< of the visibility
    DepthNoise noise;
};

/// Not thread-safe: one frame at a time.
class Gather {
  public:
    explicit Gather(gpu::Device& device) : device_(device) {}

    /// Of frame `own`, whose pixels without visibility stay without.
    [[nodiscard]] AoMap compute(const Seen& own, std::span<const Seen> others, const GatherOptions& options);
    /// Where the time of the last compute() went.
    [[nodiscard]] const Timings& timings() const { return timings_; }
    /// Of the last compute(), pixel by pixel: how many frames went into the mean, and the deviation between them.
    [[nodiscard]] std::vector<Intermediate> intermediates();

  private:
    gpu::Device& device_;
    cv::Size size_;
    std::size_t most_ = 0;
    std::unique_ptr<gpu::Program> program_;
    Timings timings_;
};

} // namespace scanshade
