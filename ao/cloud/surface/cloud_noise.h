// The noise of a cloud, measured from its points.
#pragma once

#include "ao/cloud/surface/neighbours.h"

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// How far noise is looked for, in the tree's unit.
struct NoiseLook {
    float widest;                                         ///< balls up to this radius may tell it
    float reach = std::numeric_limits<float>::infinity(); ///< no ball is wider
    static constexpr std::size_t most_points = 9216;      ///< that are looked at in one ball
};

/// Sigma across the surface round a point, where its neighbourhood tells it. `normals` is empty or holds one per point
/// of the cloud, as CloudNoise has them.
[[nodiscard]] std::optional<float> noise_round(const NeighbourTree& tree, std::span<const Eigen::Vector3d> normals,
                                               std::size_t index, const NoiseLook& look);

/// Sigma of the points across their surface, where the cloud tells it: on planes. A sample of about a thousand points,
/// evenly spread over the points, looks at balls of growing radius. A ball tells sigma if its points are flat: seven
/// times wider than sigma. Those of the next larger ball must be no thicker, as they are on curved surfaces and at
/// edges. And points side by side must differ as much as any two: structure is alike side by side.
/// Registration errors of a few sigma count as noise.
class CloudNoise {
  public:
    /// Looks at balls up to `widest`, in the tree's unit. `normals` is empty or holds one per point of the cloud:
    /// points that face away are another surface then. Without them, two sheets of equal weight are no noise.
    CloudNoise(const NeighbourTree& tree, float widest, std::span<const Eigen::Vector3d> normals = {});

    /// The same round these points of the tree only.
    CloudNoise(const NeighbourTree& tree, const NoiseLook& look, std::span<const Eigen::Vector3d> normals,
               std::span<const std::size_t> places);
    /// The same, found already: one for each place, where it is known.
    CloudNoise(std::span<const Eigen::Vector3f> places, std::span<const std::optional<float>> found);
    /// As it was found: positions are relative to the same middle.
    CloudNoise(std::vector<Eigen::Vector3f> positions, std::vector<float> sigmas);

    [[nodiscard]] const std::vector<Eigen::Vector3f>& positions() const { return positions_; }
    [[nodiscard]] const std::vector<float>& sigmas() const { return sigmas_; }
    /// The same for positions relative to another middle, which lies `apart` from the old one.
    [[nodiscard]] CloudNoise moved(const Eigen::Vector3d& apart) const;

    /// Whether enough points tell it: a fifth of the sample.
    [[nodiscard]] bool known() const { return !sigmas_.empty(); }
    /// The median of the points that tell it; 0 if unknown.
    [[nodiscard]] float median() const { return median_; }
    /// at() is nowhere more.
    [[nodiscard]] float largest() const { return largest_; }
    /// The lower quartile of the 16 nearest points that tell it, since what is wrong there is too large. At most four
    /// times the lower quartile of all: leaves are no noise. 0 if unknown.
    [[nodiscard]] float at(const Eigen::Vector3f& point) const;

  private:
    void summarize();

    std::vector<Eigen::Vector3f> positions_;
    std::vector<float> sigmas_; ///< at these positions
    float median_ = 0, largest_ = 0;
};

} // namespace scanshade
