// The discs of a cloud in the boxes of its tree, and single rays against them.
#pragma once

#include "ao/cloud/surface/cloud_surface.h"

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// A ray among the discs. Discs overlap, so a ray from one hits its neighbours at once. Hits before `own_reach` are
/// ignored where the disc's plane passes within `own_depth` of `own_point`. Discs more than 45 degrees from
/// `own_normal` count: they belong to the other wall of a corner.
struct DiscRay {
    Eigen::Vector3f origin, direction; ///< local: DiscTree::local()
    float near = 0, far = 0;           ///< in lengths of the direction
    Eigen::Vector3f own_point = Eigen::Vector3f::Zero(), own_normal = Eigen::Vector3f::Zero();
    float own_reach = 0, own_depth = 0;
};

/// A Gaussian within the plane of a disc. At the offset x from the middle it takes the share
/// opacity e^(-((u x)^2 + (v x)^2) / 2) of the light, up to the disc's rim.
struct SoftDisc {
    Eigen::Vector3f u = Eigen::Vector3f::Zero(), v = u; ///< in the plane, 1 / length
    float opacity = 0, radius = 0;                      ///< radius 0: takes nothing
};

/// Immutable once made; safe to use from several threads. Takes 32 bytes a point. Eight boxes or discs are tested
/// together, without fused multiplications: all processors find the same hits.
class DiscTree {
  public:
    /// The discs of points that have a normal and a radius. The surface is not needed afterwards. `soft`, if not empty,
    /// has the radii instead, one for each point by index in the surface's tree; it must outlive this.
    explicit DiscTree(const CloudSurface& surface, std::span<const SoftDisc> soft = {});

    /// A position relative to the surface's middle becomes one relative to the middle of the discs.
    [[nodiscard]] Eigen::Vector3f local(const Eigen::Vector3d& position) const {
        return (position - middle_).cast<float>();
    }
    /// Rounding of a coordinate anywhere on the discs.
    [[nodiscard]] double rounding() const { return rounding_; }

    /// Nodes that rays of a limited length from a few points can reach. These rays start there, not at the root.
    class Start {
      public:
        static constexpr std::size_t most = 32;

      private:
        friend class DiscTree;
        friend struct Traversal;
        std::array<std::uint32_t, most> node_;
        std::array<std::array<std::array<float, 8>, 6>, most / 8> box_; ///< of eight nodes: low x y z, high x y z
        std::size_t count_ = 0, level_ = 0;
    };
    /// Where rays start, and the half spaces that they stay in.
    struct Origins {
        Eigen::AlignedBox3f positions, normals; ///< boxes round all of them
        float lowest = 0; ///< the least height of an origin, along its own normal, over the middle of `positions`
    };
    /// For rays up to `reach` that leave their origins to the side of the normals. What lies below the planes of all of
    /// them is left out: of a flat surface nothing is.
    [[nodiscard]] Start start_near(const Origins& origins, float reach) const;
    [[nodiscard]] Start start_at_root() const;

    /// Whether any disc blocks the ray.
    [[nodiscard]] bool blocked(const Start& start, const DiscRay& ray) const;
    /// The share of the light that all soft discs on the ray's way let through.
    [[nodiscard]] float transmitted(const Start& start, const DiscRay& ray) const;
    [[nodiscard]] bool is_soft() const { return !soft_.empty(); }

    struct Hit {
        float distance; ///< in lengths of the direction
        std::uint32_t index;
    };
    /// The first disc that the ray hits; of equal distances the lower index.
    [[nodiscard]] std::optional<Hit> first_hit(const DiscRay& ray) const;

  private:
    friend struct Traversal;
    static constexpr std::size_t wide = 8; ///< children of a node
    struct alignas(32) Node {
        std::array<std::array<float, wide>, 6> box; ///< low x y z, high x y z of its children
    };
    static const Node nobody; ///< boxes that no ray hits
    void copy_discs(const CloudSurface& surface);
    void join_boxes(const NeighbourTree& tree);
    [[nodiscard]] const float* coordinate(std::size_t which) const { return discs_.get() + which * stride_; }

    Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
    double rounding_ = 0;
    std::size_t stride_ = 0;
    std::span<const SoftDisc> soft_;
    std::unique_ptr<float[]> discs_;  ///< x y z, normal x y z, radius: `stride_` of each, by index
    Untouched<std::uint32_t> begins_; ///< the first disc of each leaf
    Untouched<Node> nodes_;           ///< level after level; node n of a level has the children 8n .. 8n + 7
    std::vector<std::size_t> levels_; ///< the first node of each level; the children of the last are leaves
};

} // namespace scanshade
