// Which side of every plane of a cloud a scanner saw, without being told where it stood.
#pragma once

#include "ao/cloud/sides/patches.h"
#include "ao/cloud/sides/side_score.h"
#include "ao/cloud/surface/disc_rays.h"
#include "projection/base/finding.h"

#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// How much is spent on it; the rest of the effort does not grow with the cloud.
struct SidesEffort {
    std::size_t points = 25000; ///< that eight rays leave from on either side
    std::size_t stations = 200; ///< candidates within the cloud; 64 round it come on top
    std::size_t tests = 1000;   ///< points that candidates are judged by
    bool given_too = false;     ///< the sides as they were given are judged, too
};

/// The sides found. Signs refer to the surface's normals as they were given.
struct Sides {
    std::vector<std::int8_t> sign;    ///< by index in the tree: -1 = the normal has to be turned
    std::vector<float> confidence;    ///< by index in the tree, 0 .. 1
    std::string why;                  ///< in words; empty where the rule says it all
    std::optional<Finding> finding{}; ///< the probability of the opposite; none = by rule
    bool sure = false;                ///< the opposite would not do
    std::optional<SideSigns> signs{}; ///< where stations were looked for
    bool inner = false;               ///< the inner sides were taken
    [[nodiscard]] bool doubted() const { return finding && !finding->sentence.empty(); }
    /// Shares of the cloud that stations explain with these sides, and with those given: if asked for, and where
    /// stations were looked for.
    std::optional<double> explained{}, explained_as_given{};
};

/// Who decides between the two sides of everything: the cloud itself, or a person who knows what it is.
enum class SidesRule {
    automatic,
    terrain, ///< fronts look up on the whole, unless it is as steep as a room: `up` is needed
    up,      ///< every plane by itself looks up
    outward,
    inward
};

/// Free space is shared: a ray that leaves one plane and meets another tells that both sides are scanned or neither is.
/// And a scanner sees fronts only: places that see much and hardly any back are as good as the true ones. Both are put
/// into signed graphs of patches: first the signs relative to each other, then those to
/// the stations. `patches` and `rays` must be made of the surface; `rays` may be null for SidesRule::up alone. With
/// `up`, known to point to the sky, nobody looks from below, and where no station sees clean fronts (plants), planes
/// face up.
[[nodiscard]] Sides sides_of(const CloudSurface& surface, const Patches& patches, const DiscRays* rays,
                             const std::optional<Eigen::Vector3f>& up, SidesRule rule = SidesRule::automatic,
                             const SidesEffort& effort = {});

/// Sides towards a position relative to the surface's middle. Neighbours vote, by the cosines under which they are
/// seen. Where a plane is seen at a grazing angle, a small error of its normal would turn it over.
[[nodiscard]] Sides sides_to(const CloudSurface& surface, const Eigen::Vector3f& position);

/// How far recorded sides contradict each other: of the pairs of neighbours that continue each other smoothly, the
/// share with opposite normals, weighted by smoothness. The two faces of a thin board do not count. Right sides have
/// less than 0.3 % (axes 30 degrees off), whatever the noise, one inverted frame of 20 has 10 %, random signs have 40
/// to 50 %. Only flat places count: leaves are none.
[[nodiscard]] double contradiction(const CloudSurface& surface);

/// Recorded sides made consistent, piece by piece.
struct RepairedSides {
    std::vector<std::int8_t>
        sign;             ///< by index in the tree: -1 = the normal has to be turned, 0 = its piece is undecided
    double undecided = 0; ///< share of the points
    double turned = 0;    ///< share of the points with sign -1
    /// Of the points in pieces that opposed pairs joined, those that recorded what fewer did: how much was recorded
    /// wrong. The other pieces say nothing of it.
    double minority = 0;
};
/// Smooth pairs that agree join points to pieces. Those that oppose join pieces, the smoothest first (a maximum
/// spanning forest). Every piece takes the side that most of its points recorded. It is undecided where the majority is
/// less than a tenth of its points.
[[nodiscard]] RepairedSides repaired_sides(const CloudSurface& surface);

} // namespace scanshade
