// Depth and normals of one frame, packed once for all the frames that look at it as a neighbour.
#pragma once

#include "ao/base/method.h"
#include "ao/gpu/program.h"

#include <memory>

namespace scanshade {

/// Not thread-safe: one frame at a time.
class PackSurfaces {
  public:
    explicit PackSurfaces(gpu::Device& device) : device_(device), pool_(device) {}

    /// Of surfaces on the host. Normals that are missing or zero are derived from the depth.
    [[nodiscard]] PackedSurfaces compute(const View& view);
    /// Where the time of the last compute() went.
    [[nodiscard]] const Timings& timings() const { return timings_; }

  private:
    gpu::Device& device_;
    gpu::DeviceBytesPool pool_;
    cv::Size size_;
    bool supplied_ = false;
    std::unique_ptr<gpu::Program> program_;
    Timings timings_;
};

} // namespace scanshade
