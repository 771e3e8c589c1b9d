// Visibility of a point by cosine-weighted rays, with its standard error.
#pragma once

#include "ao/raycast/ray_surface.h"
#include "projection/base/parameters.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// How much a surface at distance t occludes: hard 1 up to the radius R; quad 1 - t^2 / R^2; lin (R - t) / (0.615 R),
/// at most 1 (XeGTAO's range).
enum class Falloff { hard, quad, lin };
inline constexpr std::array falloff_words{Named{"hard", Falloff::hard}, Named{"quad", Falloff::quad},
                                          Named{"lin", Falloff::lin}};
/// Throws Misuse listing the names.
[[nodiscard]] Falloff falloff_named(std::string_view name);

/// Cosine-weighted directions about z: Owen-scrambled Sobol points (Burley 2020), in independently scrambled sets. Made
/// once; each point picks a set by its key and rotates it about its normal.
class CosineDirections {
  public:
    /// `by_block`: the directions of each block stand together, so that starts may cast a block alone.
    CosineDirections(int rays, int seed, bool by_block = false);

    /// One direction of a set: components, and which of `blocks` equal parts of the sequence it belongs to.
    struct Direction {
        float x, y, z;
        int block;
    };
    static constexpr int blocks = 16;

    [[nodiscard]] std::span<const Direction> set_for(std::uint32_t key) const;
    [[nodiscard]] int rays() const { return rays_; }

  private:
    int rays_, sets_;
    std::vector<Direction> directions_; ///< sorted by block or not, then so that the rays of a bundle are alike
};

/// Visibility under each falloff, from the same rays, with one standard error.
struct RayEstimate {
    std::array<float, 3> visibility{1, 1, 1};     ///< by Falloff; quad and lin only where asked for
    std::array<float, 3> standard_error{0, 0, 0}; ///< 0 also where all rays agree
};

/// The start of rays, and the surfaces they ignore.
struct RayStart {
    Eigen::Vector3d point, normal; ///< unit
    std::uint32_t key = 0;         ///< selects set and rotation: equal keys give equal results on any number of threads
    double lift_m = 0;             ///< above the point; at least the rounding error is used
    double disc_radius_m = 0;      ///< of the point's own disc, where it has one
    std::span<const Eigen::Vector3d> faces = {}; ///< normals of the faces round a vertex: directions below all of them
                                                 ///< are inside and are not cast
    std::optional<int> block = {};               ///< casts this part of the sequence alone; neighbours cast the others
};

/// Share of the cosine-weighted hemisphere about `normal` that is open within a radius, methods.md's equation 1.
class RayHemisphere {
  public:
    /// Keeps references: surface and directions must live as long. `all_falloffs` needs the nearest hit of every ray
    /// instead of any hit.
    RayHemisphere(const RaySurface& surface, const CosineDirections& directions, double radius_m, bool all_falloffs);

    [[nodiscard]] RayEstimate at(const RayStart& start) const;

  private:
    const RaySurface& surface_;
    const CosineDirections& directions_;
    double radius_m_;
    bool all_falloffs_;
};

} // namespace scanshade
