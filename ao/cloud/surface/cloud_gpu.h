// The heavy stages of a cloud's visibility on a Vulkan device: neighbours and their planes, rays, means.
#pragma once

#include "ao/cloud/surface/cloud_surface.h"
#include "ao/cloud/surface/direction_set.h"
#include "ao/gpu/program.h"
#include "shaders/shared/cloud.h"

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// The results are those of NeighbourTree, DiscRays and the mean over neighbours, except for rounding. One thread at a
/// time.
class CloudGpu {
  public:
    explicit CloudGpu(gpu::Device& device) : device_(device) {}

    /// Most points of one call; the device's largest buffer and half of its memory set the limit.
    [[nodiscard]] std::size_t most_points() const;

    /// Fills in the neighbours of each point, in the tree's order. Then visits what was found round them, part by part;
    /// `first` is the index of the first.
    void neighbourhoods(const NeighbourTree& tree, std::span<CloudSurface::Near> near,
                        const std::function<void(std::size_t first, std::span<const shared::CloudRound>)>& visit);

    /// The rays, and how often a value becomes the mean of its neighbours'.
    struct Task {
        float radius = 0; ///< the largest float for the sky
        std::optional<Eigen::Vector3f> up;
        float mean_falloff = 0; ///< weights are e^(falloff distance^2)
        int means = 0;
    };
    /// In the tree's order; NaN for points without a plane.
    [[nodiscard]] Untouched<float> visibility(const CloudSurface& surface, const DirectionSet& directions,
                                              const Task& task);

    /// Device milliseconds of all calls so far, by pass.
    [[nodiscard]] const Timings& timings() const { return timings_; }
    [[nodiscard]] const std::string& device_name() const { return device_.info().name; }

  private:
    void run(gpu::Program& program, const shared::CloudConstants& constants);

    gpu::Device& device_;
    Timings timings_;
};

} // namespace scanshade
