// The noise of a cloud, measured round places of it: the same whether the cloud is in memory as a whole or passes by.
#pragma once

#include "ao/cloud/surface/cloud_noise.h"

#include <cstdint>
#include <Eigen/Core>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

namespace scanshade {

/// The noise as all tiles take it.
struct SharedNoise {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero(); ///< that the noise's positions are relative to
    CloudNoise noise;
    bool sides = false;           ///< recorded normals tell the two sides of a board apart
    bool exceeds_spacing = false; ///< as of merged depth frames; `noise` need not be known then
};

/// Where noise is looked for, whatever the memory: so many places, the points with the lowest hashes of their numbers.
struct NoisePlace {
    static constexpr std::size_t wanted = 256;
    std::uint32_t number; ///< of the point
    Eigen::Vector3d point;
};
/// No ball is wider than 38 spacings, so that a place on a plane needs 4600 points.
[[nodiscard]] NoiseLook look_for_noise(double radius, double spacing);

/// The noise of a cloud in memory. `normals` is empty or holds one per point. Nothing where the cloud does not tell.
[[nodiscard]] std::optional<SharedNoise> noise_at(std::span<const NoisePlace> places, const LocalCloud& cloud,
                                                  std::span<const Eigen::Vector3d> normals, const NoiseLook& look);

/// The same of points that pass by: gathers those near the places, of each the nearest NoiseLook::most_points at most.
class NoisePlaces {
  public:
    /// `look`: its reach is finite.
    NoisePlaces(std::span<const NoisePlace> places, const NoiseLook& look);

    /// `normal`: null where there is none.
    void add(std::uint32_t number, const Eigen::Vector3d& point, const Eigen::Vector3d* normal);
    [[nodiscard]] std::optional<SharedNoise> measured() const;

  private:
    /// The place's own point is the first. Positions are relative to it.
    struct Round {
        NoisePlace place;
        float reach2;
        bool complete = false; ///< the own point has passed by
        std::vector<Eigen::Vector3f> points, normals;
    };
    [[nodiscard]] std::int64_t cell(const Eigen::Vector3d& point, const Eigen::Vector3i& off) const;
    void keep_nearest(Round& round) const;

    NoiseLook look_;
    bool with_normals_ = false;
    std::vector<Round> rounds_;
    std::unordered_map<std::int64_t, std::vector<std::uint32_t>> near_; ///< by cell: the places within reach of it
};

} // namespace scanshade
