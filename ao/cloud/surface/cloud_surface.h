// A cloud as a surface: for every point its plane, the orientation of its normal, and a disc.
#pragma once

#include "ao/base/method.h"
#include "ao/cloud/surface/neighbours.h"
#include "shaders/shared/cloud.h"

#include <optional>
#include <string>

namespace scanshade {

class CloudGpu;

/// How normals that were not recorded are oriented.
struct NormalOrientation {
    enum class Kind {
        automatic, ///< by free space and places where scanners could stand (ao/cloud/sides/sides.h)
        viewpoint, ///< towards `point`, the scanner's position
        terrain,   ///< as automatic, and the whole looks along `point`, to the sky
        direction, ///< each plane by itself along `point`
        outward,   ///< away from the other points: objects
        inward     ///< towards the other points: rooms
    };
    Kind kind = Kind::automatic;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    std::string why{}; ///< the reason, for people
};

/// Guesses the orientation; the first that applies:
/// - to `recorded`, the viewpoint that the file names, if most points are seen first from there;
/// - to the origin of the coordinates, if nearly all points are seen first from there;
/// - terrain, if hardly any point has another above it, or with `z_up` not too many (plants over ground);
/// - automatic. `points` must be finite.
[[nodiscard]] NormalOrientation guessed_orientation(std::span<const Eigen::Vector3d> points,
                                                    const std::optional<Eigen::Vector3d>& recorded = {},
                                                    bool z_up = false);

/// The neighbourhoods, planes and discs of a cloud, in the order of its tree; positions relative to `middle`.
struct CloudSurface {
    static constexpr std::size_t kept = shared::cloud_kept; ///< neighbours remembered per point
    using Near = std::array<std::uint32_t, kept>;

    Eigen::Vector3d middle = Eigen::Vector3d::Zero(); ///< of the box round the points, so that single precision serves
    NeighbourTree tree;
    Untouched<Near> near; ///< indices in the tree's order, nearest first; the point's own where there are fewer
    Untouched<Eigen::Vector3f> normals; ///< unit; zero where the neighbours make no plane
    Untouched<float> disc_radius;       ///< covers the gaps between neighbours; 0 for a lonely point
    Untouched<float> roughness;         ///< one sigma of the neighbours' distances from the plane, in the cloud's unit
    Untouched<float> flatness; ///< 1 - 3 times the surface variation (Pauly, Gross and Kobbelt 2002): 1 = a plane
    std::vector<std::uint32_t> stands_for; ///< how many points recorded; empty = one each
    std::vector<float> noise{};            ///< sigma, where it exceeds the spacing; else empty
    float spacing = 0;                     ///< median distance of points: the side of a square that holds one
    double agreement = 1; ///< median |cosine| between given normals and planes: near 1/2 where the given ones are noise

    [[nodiscard]] std::size_t size() const { return tree.size(); }
    [[nodiscard]] std::uint32_t weight(std::size_t index) const { return stands_for.empty() ? 1 : stands_for[index]; }
};

/// The median distance of points, as CloudSurface::spacing has it.
[[nodiscard]] float spacing_of(const LocalCloud& points);

/// The share of points whose kept neighbours all lie on a line, as on the rings of a spinning lidar; of a sample.
[[nodiscard]] double share_on_lines(const CloudSurface& surface);

/// Finds neighbours and planes of `points`. `normals` is empty or holds one per point, in the order given; those of
/// zero length are replaced by the normals of the planes. Planes are fitted to 16 neighbours, weighted by distance, and
/// to 64 where the 16 are on a line, as on a scanner's rings. Estimated normals are not oriented yet. `axes` is empty
/// or holds one per point: where not zero, it is the normal of a better plane. `gpu`, if given, finds neighbours and
/// planes.
[[nodiscard]] CloudSurface cloud_surface(LocalCloud&& points, std::span<const Eigen::Vector3d> normals,
                                         CloudGpu* gpu = nullptr, std::span<const Eigen::Vector3f> axes = {});

} // namespace scanshade
