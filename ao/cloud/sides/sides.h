// Which side of every plane of a cloud a scanner saw, without being told where it stood.
#pragma once

#include "ao/cloud/sides/patches.h"
#include "ao/cloud/surface/disc_rays.h"

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
    std::vector<std::int8_t> sign; ///< by index in the tree: -1 = the normal has to be turned
    std::vector<float> confidence; ///< by index in the tree, 0 .. 1
    std::string why;               ///< in words; empty where the rule says it all
    double margin = 0; ///< by how much more of the cloud stations explain with these sides than with all turned over;
                       ///< 0 where something else decided
    std::optional<std::string> doubt{}; ///< where both answers explain the cloud equally well
    bool sure = false;                  ///< a room or a body, and nothing else would do
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

/// How recorded normals agree with their neighbours, patch by patch.
struct RecordedSides {
    double random = 0;  ///< share of the points in patches whose signs look random
    double opposed = 0; ///< share of the points that oppose most of their patch, there
};
/// Of a surface whose normals are recorded ones. A patch of eight or more points is in order if fewer than a tenth
/// oppose the others. So it is if those that do make a sheet of its own: they stand higher.
[[nodiscard]] RecordedSides recorded_sides(const CloudSurface& surface, const Patches& patches);

} // namespace scanshade
