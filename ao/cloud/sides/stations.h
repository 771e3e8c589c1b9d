// Candidate stations of a scanner, and what they see of a cloud.
#pragma once

#include "ao/cloud/sides/sides.h"

#include <cstdint>
#include <optional>
#include <vector>

namespace scanshade {

using Signs = std::vector<std::int8_t>;

/// The size of a cloud as seen from its middle.
struct Reach {
    Eigen::Vector3f centre;
    float usual = 0, far = 0; ///< distances from the centre: the median, 98 %
};

[[nodiscard]] Reach reach_of(const CloudSurface& surface);

/// A ray that left one plane and met another.
struct RayHit {
    std::uint32_t from, to; ///< indices in the tree
    std::int8_t sign;       ///< +1: both sides are their normals', or neither is
    float distance;
    Eigen::Vector3f direction;
};

/// Eight rays from either side of so many points, spread over the cloud.
[[nodiscard]] std::vector<RayHit> shoot(const CloudSurface& surface, const DiscRays& rays, std::size_t points);

/// Candidate stations and what they see of some points.
class Stations {
  public:
    Stations(const CloudSurface& surface, const DiscRays& rays, const std::vector<RayHit>& hits, const Reach& reach,
             const std::optional<Eigen::Vector3f>& up, const SidesEffort& effort);

    [[nodiscard]] const std::vector<std::uint32_t>& tests() const { return tests_; }
    [[nodiscard]] std::size_t near() const { return near_; }
    [[nodiscard]] const Eigen::Vector3f& position(std::size_t c) const { return positions_[c]; }
    [[nodiscard]] std::size_t size() const { return positions_.size(); }
    /// +1: station c sees the front of test t, under `labels` (by test); -1: its back; 0: nothing.
    [[nodiscard]] int seen(std::size_t c, std::size_t t, const Signs& labels) const {
        return seen_[c * tests_.size() + t] * labels[t];
    }

    /// The same under the surface's own normals.
    [[nodiscard]] int seen(std::size_t c, std::size_t t) const { return seen_[c * tests_.size() + t]; }
    /// How many pairs of station and test see each other.
    [[nodiscard]] double all_seen() const;

    /// Share of the tests that lie in large planes with nearly everything on one side, as walls, floor and ceiling
    /// bound a room. Of things with round shapes next to none do.
    [[nodiscard]] double boxed(float size) const;

    /// The mean rise of the tests' fronts: 1 where all look up.
    [[nodiscard]] double rise(const Signs& labels) const;

    struct Cover {
        double share = 0; ///< of the tests: fronts seen, less twice the backs
        std::vector<std::size_t> chosen;
    };
    /// The few stations that explain a labelling best, one after the other.
    [[nodiscard]] Cover cover(const Signs& labels) const;

    /// Share of the tests whose front at least three far stations see.
    [[nodiscard]] double seen_from_afar(const Signs& labels) const;
    /// Fronts among all that far stations see.
    [[nodiscard]] double fronts_from_afar(const Signs& labels) const;
    /// How well the density of the points is that of scans from near stations: the logarithm's correlation with that of
    /// what a few would make together. Each makes cosine / distance^2, or more towards its poles, as beams of equal
    /// angles have it. -1 where no station sees much.
    [[nodiscard]] double density_fits(const Signs& labels) const;

    /// The chosen ones first, then those that see most fronts and few backs.
    [[nodiscard]] std::vector<std::size_t> best(std::vector<std::size_t> chosen, const Signs& labels,
                                                std::size_t most) const;

  private:
    /// The correlation that the best few of these densities reach together; the next is added while that helps.
    [[nodiscard]] double best_fit(const std::vector<std::vector<double>>& made) const;
    [[nodiscard]] double fit(const std::vector<double>& one, const std::vector<double>& other) const;

    /// On rays through free space, or the space behind: long ones are likelier.
    void add_near(const std::vector<RayHit>& hits, const Reach& reach, std::size_t count);

    const CloudSurface& surface_;
    std::optional<Eigen::Vector3f> up_;
    std::vector<Eigen::Vector3f> positions_; ///< the near ones first
    std::size_t near_ = 0;
    std::vector<std::uint32_t> tests_;
    std::vector<double> density_;   ///< its logarithm, by test
    std::vector<std::int8_t> seen_; ///< by station and test, under the surface's own normals
    std::vector<char> counts_;      ///< whether a station may explain a labelling
};

} // namespace scanshade
