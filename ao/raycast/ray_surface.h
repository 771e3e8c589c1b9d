// Triangles or oriented discs in Embree's tree. Every ground truth of the program is cast against one of these.
#pragma once

#include <array>
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// Triangles with shared vertices, metres; both sides occlude.
struct Mesh {
    std::vector<Eigen::Vector3d> vertices;
    std::vector<std::array<int, 3>> triangles;
};

/// A flat disc, metres; `normal` has unit length; both sides occlude.
struct Disc {
    Eigen::Vector3d centre, normal;
    double radius_m = 0;
};

/// Discs overlap, so a ray from one hits its neighbours at once. Hits closer than reach_m are ignored if the disc's
/// plane passes within depth_m of `point`. No effect on triangles.
struct OwnSurface {
    Eigen::Vector3f point = Eigen::Vector3f::Zero(); ///< local: RaySurface::local()
    float reach_m = 0, depth_m = 0;
};

/// Eight rays from one origin, as Embree takes them: directions of unit length.
struct RayBundle {
    static constexpr int size = 8;
    Eigen::Vector3f origin; ///< local: RaySurface::local()
    float far_m = 0;
    OwnSurface own;
    alignas(32) std::array<float, size> x, y, z;
    alignas(32) std::array<int, size> live; ///< -1 for rays to cast, 0 for the others
};

/// Rounding of a coordinate up to `farthest`: 64 float steps there.
[[nodiscard]] double rounding_at(float farthest);

/// Immutable once made; safe to use from several threads. Coordinates are kept relative to the middle of the geometry,
/// so that single precision suffices far from the origin (methods.md's 2.3: at 500 km a float step is 31 mm).
class RaySurface {
  public:
    /// Triangles with a missing or non-finite vertex, or no wider than a micrometre, are left out.
    explicit RaySurface(const Mesh& mesh);
    /// Non-finite discs and discs without a radius are left out.
    explicit RaySurface(std::span<const Disc> discs);
    ~RaySurface();
    RaySurface(RaySurface&&) noexcept;
    RaySurface& operator=(RaySurface&&) noexcept;

    struct Hit {
        double distance; ///< in lengths of the ray's direction
        int primitive;   ///< index of the triangle or disc, as given
    };
    struct Hits {
        std::array<float, RayBundle::size> distance; ///< infinite where there is none
        std::array<int, RayBundle::size> primitive;  ///< as in Hit; -1 where there is none
    };
    /// The first hit beyond `near` lengths.
    [[nodiscard]] std::optional<Hit> nearest(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                             double near = 0) const;
    /// Whether any surface crosses the open segment between two points.
    [[nodiscard]] bool blocked(const Eigen::Vector3d& from, const Eigen::Vector3d& to) const;

    [[nodiscard]] Eigen::Vector3f local(const Eigen::Vector3d& point) const;
    /// Rounding of a coordinate anywhere on the geometry.
    [[nodiscard]] double rounding_m() const;
    [[nodiscard]] bool empty() const;

    /// Sets live to 0 for the rays of `bundle` that hit a surface closer than far_m.
    void drop_blocked(RayBundle& bundle) const;
    /// The first hit of each live ray.
    [[nodiscard]] Hits hits(const RayBundle& bundle) const;

  private:
    struct Tree;
    std::unique_ptr<Tree> tree_;
};

} // namespace scanshade
