// The noise of a cloud that is never in memory as a whole: measured round places of it, and the same for all tiles.
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
    bool sides = false; ///< recorded normals tell the two sides of a board apart
};

/// Gathers the points near some places while all points of a cloud pass by.
class NoisePlaces {
  public:
    /// `places` are points of the cloud, with their numbers in it. Each gathers points within `reach`.
    struct Place {
        std::uint32_t number;
        Eigen::Vector3d point;
    };
    NoisePlaces(std::vector<Place> places, double reach);

    /// Points in the order of their numbers. `normal`: null where there is none.
    void add(std::uint32_t number, const Eigen::Vector3d& point, const Eigen::Vector3d* normal);
    /// Nothing where the cloud does not tell. As CloudNoise, looks at balls up to `widest`.
    [[nodiscard]] std::optional<SharedNoise> measured(double widest) const;
    /// Balls that measure() looks at are no wider than this many spacings.
    static constexpr double widest_in_spacings = 38;
    static constexpr std::size_t usual_points = 4600; ///< round a place: those of such a ball on a plane

  private:
    [[nodiscard]] std::int64_t cell(const Eigen::Vector3d& point, const Eigen::Vector3i& off) const;

    std::vector<Place> places_;
    double reach_;
    std::unordered_map<std::int64_t, std::vector<std::uint32_t>> near_; ///< by cell: the places within reach of it
    std::vector<std::uint32_t> gathered_;                               ///< by place
    std::vector<Eigen::Vector3d> points_, normals_;
    std::unordered_map<std::uint32_t, std::uint32_t> at_; ///< by a place's number: where its point is
    std::vector<std::uint32_t> sorted_;                   ///< the numbers of places
};

} // namespace scanshade
