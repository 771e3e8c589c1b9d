// A cloud as a surface: the plane round every point, which side of it is outside, and the disc that stands for it.
#pragma once

#include "ao/cloud/neighbours.h"
#include "ao/method.h"
#include "shaders/shared/cloud.h"

#include <optional>
#include <string>

namespace scanshade {

class CloudGpu;
class DiscRays;

/// Where the outside of a surface without recorded normals is.
struct Outside {
    enum class Kind {
        viewpoint, ///< towards `point`, where the scanner stood
        direction, ///< along `point`: the sky of terrain
        outward,   ///< away from the rest: objects seen from all round
        inward     ///< towards the rest: rooms
    };
    Kind kind = Kind::outward;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    std::string why; ///< "the scanner's place as recorded", for people
};

/// Where a cloud was seen from: from `recorded`, the viewpoint its file names, if nearly all points are seen first from
/// there. Else what the cloud itself tells: one nearly all of which is seen first from the origin of its coordinates
/// was recorded from there; one with hardly anything above anything is terrain, its outside above; one that hides many
/// of its points from all sides is a room; else outward. `points` must be finite.
[[nodiscard]] Outside guessed_outside(std::span<const Eigen::Vector3d> points,
                                      const std::optional<Eigen::Vector3d>& recorded = {});

/// The neighbourhoods, planes and discs of a cloud, in the order of its tree; positions relative to `middle`.
struct CloudSurface {
    static constexpr std::size_t kept = shared::cloud_kept; ///< neighbours remembered per point
    using Near = std::array<std::uint32_t, kept>;

    Eigen::Vector3d middle = Eigen::Vector3d::Zero(); ///< of the box round the points, so that single precision serves
    NeighbourTree tree;
    std::vector<Near> near;               ///< places, nearest first; the point's own where there are fewer
    std::vector<Eigen::Vector3f> normals; ///< unit; zero where the neighbours make no plane
    std::vector<float> disc_radius;       ///< covers the gaps between neighbours; 0 for a lonely point
    std::vector<float> roughness; ///< one sigma of the neighbours' distances from the plane, in the cloud's unit
    std::vector<float> flatness;  ///< 1 - 3 times the surface variation (Pauly, Gross and Kobbelt 2002): 1 = a plane
    float spacing = 0;            ///< median over the points of the side of a square that holds one of them
    double agreement = 1; ///< median |cosine| between given normals and planes: near 1/2 where the former are noise
    double discord = 0;   ///< share of points whose given normal opposes the nearest one's on the same plane

    [[nodiscard]] std::size_t size() const { return tree.size(); }
};

/// Finds neighbours and planes of `points`, which must be finite. Where `normals` holds one per point they are taken,
/// and those that have no length are filled in from the planes. Planes come from 16 neighbours, weighted by distance;
/// where these lie on a line, as on a scanner's rings, from 64. `normals` of estimated planes have no side yet.
/// Neighbours and planes are found by `gpu`, if given.
[[nodiscard]] CloudSurface cloud_surface(std::span<const Eigen::Vector3d> points,
                                         std::span<const Eigen::Vector3d> normals, CloudGpu* gpu = nullptr);

/// Turns normals to the outside. Towards a viewpoint each point by itself; else neighbours are made to agree, those
/// that most surely lie on one surface first (a spanning tree as of Hoppe et al. 1992, built as Kruskal's), and every
/// piece that agrees in itself takes the side that most of it has evidence for. In rooms (inward) that is the side with
/// more air, by rays against `rays`, which must be given then; pieces with clear evidence against each other are not
/// joined. Points without a plane face the viewpoint or the direction.
void turn_outside(CloudSurface& surface, const Outside& outside, const DiscRays* rays = nullptr);

} // namespace scanshade
