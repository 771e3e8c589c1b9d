// The sides of a cloud's surfaces, settled as its settings say.
#pragma once

#include "ao/cloud/cloud_ao.h"
#include "ao/cloud/sides/sides.h"

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
    std::vector<std::string> doubts;          ///< sentences, some of them twice
    std::size_t turned_points = 0;            ///< whose recorded normals were turned
    std::size_t judged_points = 0;            ///< of the surfaces where some were
    std::string turned_why;
    bool recorded_believed = false; ///< recorded sides were looked at, and are right

    /// Begins to judge recorded sides by a part of the points, beside other work, where settle() will need that first.
    /// `normals`: the recorded ones of these points.
    void judge_early(const LocalCloud& points, std::span<const Eigen::Vector3d> normals);

    /// Turns the normals to the sides that were scanned. Returns how sure that is, 0 .. 1, by index in the tree; empty
    /// where the recorded sides are taken. `rays` are made of the surface if they are needed. `recorded`: the normals
    /// are recorded ones.
    std::vector<float> settle(CloudSurface& surface, std::optional<DiscRays>& rays, bool recorded);

  private:
    [[nodiscard]] Sides found_in(const CloudSurface& surface, const Patches& patches, std::optional<DiscRays>& rays,
                                 const SidesEffort& effort = {}) const;
    /// Whether a quick look at recorded sides finds nothing wrong. `rays` as for settle().
    [[nodiscard]] bool look_right(const CloudSurface& surface, const Patches& patches,
                                  std::optional<DiscRays>& rays) const;
    /// Whether recorded sides are judged by a part of so many points first.
    [[nodiscard]] bool judged_by_part(std::size_t points) const;
    /// Where both sides would do, that to the scanner is right.
    void decide_by_scanner(const CloudSurface& surface, Sides& found) const;
    std::vector<float> settle_recorded(CloudSurface& surface, std::optional<DiscRays>& rays);
    void note(const Sides& found);

    const CloudAoOptions& options_;
    Eigen::Vector3d up_;
    bool z_up_;
    std::future<bool> early_; ///< what judge_early() began
};

} // namespace scanshade
