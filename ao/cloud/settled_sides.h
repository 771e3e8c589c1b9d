// The sides of a cloud's surfaces, settled as its settings say.
#pragma once

#include "ao/cloud/cloud_ao.h"
#include "ao/cloud/sides/sides.h"
#include "projection/base/finding.h"

#include <functional>
#include <future>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// Turns normals, tile by tile, and remembers what there is to tell people.
class SettledSides {
  public:
    /// `up`: unit, the direction of the sky. `z_up`: whether the cloud is known to have it along z.
    SettledSides(const CloudAoOptions& options, Eigen::Vector3d up, bool z_up)
        : options_(options), up_(std::move(up)), z_up_(z_up) {}

    NormalOrientation orientation;            ///< as given or guessed; `why` becomes what was found
    std::optional<Eigen::Vector3d> seen_from; ///< where the scanner of all points stood, if that is known
    Findings findings;
    std::size_t turned_points = 0; ///< whose recorded normals were turned
    std::size_t judged_points = 0; ///< of the surfaces where some were
    std::string turned_why;
    bool recorded_kept = false; ///< all of them
    bool repaired = false;      ///< some were turned to agree with their neighbours, whatever `orientation` is

    /// Begins to look for what objects to recorded sides, by a part of the points, beside other work. `normals`: the
    /// recorded ones of these points.
    void object_early(const LocalCloud& points, std::span<const Eigen::Vector3d> normals);

    /// Turns the normals to the sides that were scanned. Returns how sure that is, 0 .. 1, by index in the tree; empty
    /// where the recorded sides are taken. `rays` are made of the surface if they are needed. `recorded`: the normals
    /// are recorded ones.
    std::vector<float> settle(CloudSurface& surface, std::optional<DiscRays>& rays, bool recorded);

    /// Each normal to where its point was seen from: no side is wrong then. `seen_from(index)`: by index in the tree.
    /// What has no plane faces there, too.
    void turn_to(CloudSurface& surface, const std::function<Eigen::Vector3d(std::size_t)>& seen_from);

  private:
    [[nodiscard]] Sides found_in(const CloudSurface& surface, const Patches& patches, std::optional<DiscRays>& rays,
                                 const SidesEffort& effort = {}) const;
    /// A doubt where nearly all recorded sides face away from where scanners could have stood. `in_order`: they did
    /// not contradict each other. `rays` as for settle().
    [[nodiscard]] Finding objection(const CloudSurface& surface, std::optional<DiscRays>& rays, bool in_order) const;
    /// Of clouds of so many points, only a part is asked.
    [[nodiscard]] bool asks_part(std::size_t points) const;
    /// Where both sides would do, that to the scanner is right.
    void decide_by_scanner(const CloudSurface& surface, Sides& found) const;
    /// Turns normals with sign -1, for the reason given.
    void turn(CloudSurface& surface, std::span<const std::int8_t> sign, std::string why);
    std::vector<float> settle_recorded(CloudSurface& surface, std::optional<DiscRays>& rays);
    void note(const Sides& found);

    const CloudAoOptions& options_;
    Eigen::Vector3d up_;
    bool z_up_;
    std::future<Finding> early_; ///< what object_early() began
};

} // namespace scanshade
