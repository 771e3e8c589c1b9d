// Which rule turns a surface's normals, and whether recorded ones are believed.
#include "ao/cloud/settled_sides.h"

#include "ao/cloud/sides/noise_camera.h"

#include <algorithm>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f;

namespace {

constexpr std::size_t enough = 100000; ///< points to ask whether recorded sides may be right

/// Part of a cloud, evenly chosen, with the normals that it has.
struct Part {
    std::vector<Vector3d> points, normals;
    [[nodiscard]] CloudSurface surface() const { return cloud_surface(LocalCloud(points), normals); }
};

/// About `enough` points. `normal_of(index)`: by index in the tree.
template <class Normal>
Part part_of(const NeighbourTree& tree, const Vector3d& middle, const Normal& normal_of) {
    Part part;
    const std::size_t step = std::max<std::size_t>(1, tree.size() / enough);
    for (std::size_t index = step / 2; index < tree.size(); index += step) {
        part.points.push_back(middle + tree[index].cast<double>());
        part.normals.push_back(normal_of(index));
    }
    return part;
}

/// The share of sure sides that oppose the normals as they are; 0 where too few are sure.
double opposed_share(const CloudSurface& surface, const Sides& found) {
    constexpr float sure = 0.8F;
    double opposed = 0, all = 0;
    for (std::size_t i = 0; i < surface.size(); ++i)
        if (found.confidence[i] > sure && !surface.normals[i].isZero()) {
            all += 1;
            opposed += found.sign[i] < 0;
        }
    constexpr double enough_sure = 0.3; // of the points
    return all > enough_sure * static_cast<double>(surface.size()) ? opposed / all : 0;
}

/// How far normals look along an axis on the whole: 1 = all do, -1 = all look away.
float rise_along(const CloudSurface& surface, const Vector3f& axis) {
    double rise = 0, all = 0;
    for (const Vector3f& normal : surface.normals) {
        const auto along = static_cast<double>(normal.dot(axis));
        rise += along;
        all += std::abs(along);
    }
    return all > 0 ? static_cast<float>(rise / all) : 0.0F;
}

constexpr double hardly_opposed = 0.05, nearly_all_opposed = 0.9;

} // namespace

/// The sides that the cloud itself tells, or a person.
Sides SettledSides::found_in(const CloudSurface& surface, const Patches& patches, std::optional<DiscRays>& rays,
                             const SidesEffort& effort) const {
    using Kind = NormalOrientation::Kind;
    if (orientation.kind == Kind::viewpoint)
        return sides_to(surface, (orientation.point - surface.middle).cast<float>());
    if (orientation.kind == Kind::direction)
        return sides_of(surface, patches, nullptr, orientation.point.cast<float>().normalized(), SidesRule::up);
    if (!rays)
        rays.emplace(surface);
    if (orientation.kind == Kind::automatic && !surface.noise.empty())
        if (const auto camera = camera_of_noise(surface, *rays)) {
            Sides sides = sides_to(surface, camera->position);
            sides.why = fmt::format("to the place from where their noise grows, which sees {:.0f} % of them",
                                    100 * camera->seen);
            return sides;
        }
    const std::optional<Vector3f> up =
        orientation.kind == Kind::terrain || z_up_ ? std::optional<Vector3f>(up_.cast<float>()) : std::nullopt;
    const SidesRule rule = orientation.kind == Kind::terrain   ? SidesRule::terrain
                           : orientation.kind == Kind::outward ? SidesRule::outward
                           : orientation.kind == Kind::inward  ? SidesRule::inward
                                                               : SidesRule::automatic;
    return sides_of(surface, patches, &*rays, up, rule, effort);
}

std::vector<float> SettledSides::settle(CloudSurface& surface, std::optional<DiscRays>& rays, bool recorded) {
    if (recorded)
        return settle_recorded(surface, rays);
    Sides found = found_in(surface, patches_of(surface), rays);
    decide_by_scanner(surface, found);
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        if (found.sign[i] < 0)
            surface.normals[i] = -surface.normals[i];
    });
    // What has no plane faces the scanner, or the sky.
    using Kind = NormalOrientation::Kind;
    const bool to_sky = orientation.kind == Kind::direction || orientation.kind == Kind::terrain;
    if (to_sky || orientation.kind == Kind::viewpoint)
        for (std::size_t i = 0; i < surface.size(); ++i)
            if (surface.normals[i].isZero())
                surface.normals[i] =
                    to_sky ? Vector3f(orientation.point.cast<float>().normalized())
                           : Vector3f((orientation.point - surface.middle).cast<float>() - surface.tree[i])
                                 .stableNormalized();
    note(found);
    return std::move(found.confidence);
}

void SettledSides::turn_to(CloudSurface& surface, const std::function<Vector3d(std::size_t)>& seen_from) {
    std::vector<std::int8_t> sign(surface.size(), 1);
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        const Vector3f there = (seen_from(i) - surface.middle).cast<float>() - surface.tree[i];
        if (surface.normals[i].isZero())
            surface.normals[i] = there.stableNormalized();
        else if (surface.normals[i].dot(there) < 0)
            sign[i] = -1;
    });
    turn(surface, sign, "they faced away from where their points were seen from");
    orientation.kind = NormalOrientation::Kind::viewpoint;
    orientation.why = "the position that each point was seen from";
}

void SettledSides::decide_by_scanner(const CloudSurface& surface, Sides& found) const {
    constexpr double most = 0.85;
    if (found.sure || !found.finding || !seen_from)
        return;
    const Vector3f scanner = (*seen_from - surface.middle).cast<float>();
    double facing = 0, all = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const float towards = surface.normals[i].dot(scanner - surface.tree[i]) * static_cast<float>(found.sign[i]);
        facing += towards > 0;
        all += towards != 0;
    }
    if (facing > (1 - most) * all && facing < most * all) {
        found.finding->sentence = fmt::format("{:.0f} % of the surfaces face the scanner's position, so it tells "
                                              "neither side; --cloud.outside sets them.",
                                              100 * facing / all);
        return;
    }
    found.finding->sentence.clear();
    found.why = "to the scanner's position, which decides between both sides";
    if (facing < most * all)
        for (std::int8_t& sign : found.sign)
            sign = static_cast<std::int8_t>(-sign);
}

Finding SettledSides::objection(const CloudSurface& surface, std::optional<DiscRays>& rays, bool in_order) const {
    using Kind = NormalOrientation::Kind;
    const bool viewed = orientation.kind == Kind::viewpoint;
    if (z_up_ && orientation.kind == Kind::terrain) {
        // The sky sees it: no station need be found, which plants prevent.
        constexpr float down = -0.5F; // of the normals along the axis, those up less those down
        const double rise = rise_along(surface, up_.cast<float>());
        Finding sky{Check::normals_to_sky, rise, down, {}};
        if (rise <= down)
            sky.sentence =
                "most of the recorded normals look down, though the cloud seems to be seen from above; they are "
                "kept: --cloud.outside up turns them, --cloud.normals recorded is sure of them.";
        return sky;
    }
    const Patches patches = patches_of(surface);
    Finding space{Check::normals_to_space, 0, nearly_all_opposed, {}};
    const auto objects = [&](const SidesEffort& effort) {
        constexpr double tie = 0.05; // of the points
        const Sides found = found_in(surface, patches, rays, effort);
        const bool as_good =
            !found.sure && found.explained_as_given && *found.explained_as_given > *found.explained - tie;
        space.value = opposed_share(surface, found);
        return !found.doubted() && !as_good && space.value > nearly_all_opposed;
    };
    constexpr SidesEffort quick{4000, 60, 300, true};
    if (!objects(quick) || (!viewed && !objects({.given_too = true})))
        return space;
    if (orientation.kind == Kind::terrain && in_order) // z may point anywhere
        return space;
    space.sentence =
        fmt::format("nearly all recorded normals face away from {}; they are kept: --cloud.outside turns them, "
                    "--cloud.normals recorded is sure of them.",
                    viewed ? orientation.why : "where scanners could have stood");
    return space;
}

bool SettledSides::asks_part(std::size_t points) const {
    return options_.normals == CloudNormals::automatic && options_.outside == "auto" && points > 2 * enough;
}

void SettledSides::object_early(const LocalCloud& points, std::span<const Vector3d> normals) {
    if (!asks_part(points.size()))
        return;
    Part part = part_of(points.tree, points.middle, [&](std::size_t i) { return normals[points.tree.original(i)]; });
    early_ = std::async(std::launch::async, [this, part = std::move(part)] {
        const CloudSurface surface = part.surface();
        std::optional<DiscRays> rays;
        return objection(surface, rays, true);
    });
}

void SettledSides::turn(CloudSurface& surface, std::span<const std::int8_t> sign, std::string why) {
    for (std::size_t i = 0; i < surface.size(); ++i)
        if (sign[i] < 0 && !surface.normals[i].isZero()) {
            surface.normals[i] = -surface.normals[i];
            ++turned_points;
        }
    judged_points += surface.size();
    turned_why = std::move(why);
}

/// Recorded sides stay unless they contradict each other on smooth patches. Where free space would have them otherwise,
/// that errs more often: a place beneath a table sees as much as a camera in front of it.
std::vector<float> SettledSides::settle_recorded(CloudSurface& surface, std::optional<DiscRays>& rays) {
    recorded_kept = options_.normals != CloudNormals::automatic;
    if (recorded_kept)
        return {};
    if (options_.outside != "auto") {
        Sides found = found_in(surface, patches_of(surface), rays);
        turn(surface, found.sign, "--cloud.outside says so");
        note(found);
        return std::move(found.confidence);
    }
    std::vector<float> known;
    constexpr double contradictory = 0.005;
    recorded_kept = contradiction(surface) < contradictory;
    if (!recorded_kept) {
        RepairedSides repair = repaired_sides(surface);
        const bool viewed = orientation.kind == NormalOrientation::Kind::viewpoint;
        // The majority of a piece is a matter of chance where half were turned box by box: 16 of 17 clouds read 0.31
        // to 0.48. Where a quarter were, they read 0.25.
        constexpr double by_chance = 0.3;
        const bool random = repair.minority > by_chance;
        Sides found;
        if (random || viewed || repair.undecided > 0) {
            found = found_in(surface, patches_of(surface), rays);
            decide_by_scanner(surface, found);
        }
        if (random || viewed) {
            turn(surface, found.sign, random ? "their sides look random" : "they opposed each other");
            note(found);
            return std::move(found.confidence);
        }
        // Parts without a smooth pair to others keep what was recorded, which was wrong as often as elsewhere.
        known.assign(surface.size(), static_cast<float>(1 - 2 * repair.turned));
        for (std::size_t i = 0; i < surface.size(); ++i)
            if (repair.sign[i] == 0)
                repair.sign[i] = found.sign[i], known[i] = found.confidence[i];
        turn(surface, repair.sign, "they opposed most of their neighbours");
        repaired = true;
    }
    if (orientation.kind == NormalOrientation::Kind::viewpoint && !orientation.point.isZero()) {
        // All is seen from the recorded position, unless it is another's, as in merged scans. Free space tells.
        Sides seen = sides_to(surface, (orientation.point - surface.middle).cast<float>());
        const double opposed = opposed_share(surface, seen);
        if (opposed > hardly_opposed && opposed < nearly_all_opposed) {
            if (!rays)
                rays.emplace(surface);
            if (opposed_share(surface, sides_of(surface, patches_of(surface), &*rays, {})) > hardly_opposed) {
                recorded_kept = repaired = false;
                turn(surface, seen.sign, fmt::format("{:.0f} % of them faced away from the scanner", 100 * opposed));
                at_most(findings, Check::normals_to_scanner, opposed, hardly_opposed, [&] {
                    return fmt::format("{:.0f} % of the recorded normals face away from {}; they were turned: "
                                       "--cloud.normals recorded keeps them.",
                                       100 * opposed, orientation.why);
                });
                return std::move(seen.confidence);
            }
        }
    }
    const auto of_part = [&] {
        const CloudSurface some = part_of(surface.tree, surface.middle, [&](std::size_t i) {
                                      return Vector3d(surface.normals[i].cast<double>());
                                  }).surface();
        std::optional<DiscRays> rays_of_some;
        return objection(some, rays_of_some, recorded_kept);
    };
    findings.push_back(!asks_part(surface.size())        ? objection(surface, rays, recorded_kept)
                       : early_.valid() && recorded_kept ? early_.get()
                                                         : of_part());
    return known;
}

void SettledSides::note(const Sides& found) {
    if (!found.why.empty())
        orientation.why = found.why;
    if (found.finding)
        findings.push_back(*found.finding);
}

} // namespace scanshade
