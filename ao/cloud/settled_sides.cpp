// Which rule turns a surface's normals, and whether recorded ones are believed.
#include "ao/cloud/settled_sides.h"

#include <algorithm>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f;

namespace {

constexpr std::size_t enough = 100000; ///< points to judge recorded sides by
constexpr float sure = 0.8F;

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
    double opposed = 0, all = 0;
    for (std::size_t i = 0; i < surface.size(); ++i)
        if (found.confidence[i] > sure && !surface.normals[i].isZero()) {
            all += 1;
            opposed += found.sign[i] < 0;
        }
    constexpr double enough_sure = 0.3; // of the points
    return all > enough_sure * static_cast<double>(surface.size()) ? opposed / all : 0;
}

/// Where scanners could have stood that see recorded fronts as well as those found, who recorded them knew better.
bool as_good(const Sides& found) {
    constexpr double tie = 0.05;
    return !found.sure && found.explained_as_given && *found.explained_as_given > *found.explained - tie;
}

constexpr double hardly_random = 0.05, some_opposed = 0.05;

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

void SettledSides::decide_by_scanner(const CloudSurface& surface, Sides& found) const {
    constexpr double most = 0.85;
    if (!found.doubt || !seen_from)
        return;
    const Vector3f scanner = (*seen_from - surface.middle).cast<float>();
    double facing = 0, all = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const float towards = surface.normals[i].dot(scanner - surface.tree[i]) * static_cast<float>(found.sign[i]);
        facing += towards > 0;
        all += towards != 0;
    }
    if (facing > (1 - most) * all && facing < most * all)
        return;
    found.doubt.reset();
    found.why = "to the scanner's position, which decides between both sides";
    if (facing < most * all)
        for (std::int8_t& sign : found.sign)
            sign = static_cast<std::int8_t>(-sign);
}

bool SettledSides::look_right(const CloudSurface& surface, const Patches& patches,
                              std::optional<DiscRays>& rays) const {
    constexpr SidesEffort quick{4000, 60, 300, true};
    if (recorded_sides(surface, patches).random > hardly_random)
        return false;
    const Sides found = found_in(surface, patches, rays, quick);
    return as_good(found) || opposed_share(surface, found) <= some_opposed;
}

bool SettledSides::judged_by_part(std::size_t points) const {
    return options_.normals == CloudNormals::automatic && options_.outside == "auto" && points > 2 * enough;
}

void SettledSides::judge_early(const LocalCloud& points, std::span<const Vector3d> normals) {
    if (!judged_by_part(points.size()))
        return;
    Part part = part_of(points.tree, points.middle, [&](std::size_t i) { return normals[points.tree.original(i)]; });
    early_ = std::async(std::launch::async, [this, part = std::move(part)] {
        const CloudSurface surface = part.surface();
        std::optional<DiscRays> rays;
        return look_right(surface, patches_of(surface), rays);
    });
}

/// Recorded sides are right as a rule. Random ones show within patches; patches turned over, or all, show in where
/// a scanner could have stood.
std::vector<float> SettledSides::settle_recorded(CloudSurface& surface, std::optional<DiscRays>& rays) {
    constexpr double mostly_random = 0.2, all_opposed = 0.9;
    if (options_.normals != CloudNormals::automatic)
        return {};
    const bool told = options_.outside != "auto";
    if (judged_by_part(surface.size())) {
        const auto by_part = [&] {
            const CloudSurface some = part_of(surface.tree, surface.middle, [&](std::size_t i) {
                                          return Vector3d(surface.normals[i].cast<double>());
                                      }).surface();
            std::optional<DiscRays> rays_of_some;
            return look_right(some, patches_of(some), rays_of_some);
        };
        recorded_believed = early_.valid() ? early_.get() : by_part();
        if (recorded_believed)
            return {};
    }
    const Patches patches = patches_of(surface);
    if (!told && !judged_by_part(surface.size())) {
        recorded_believed = look_right(surface, patches, rays);
        if (recorded_believed)
            return {};
    }
    const RecordedSides order = recorded_sides(surface, patches);
    const bool in_order = order.random <= hardly_random;
    SidesEffort thorough;
    thorough.given_too = in_order && !told;
    Sides found = found_in(surface, patches, rays, thorough);
    double opposed = opposed_share(surface, found);
    if (thorough.given_too && orientation.kind == NormalOrientation::Kind::viewpoint && opposed > some_opposed &&
        opposed < all_opposed) {
        // Nearly everything is seen first from the foot of a table, too, where no scanner stood.
        if (!rays)
            rays.emplace(surface);
        const Sides free = sides_of(surface, patches, &*rays, {}, SidesRule::automatic, thorough);
        if (as_good(free) || opposed_share(surface, free) <= some_opposed)
            opposed = 0;
    }
    recorded_believed = in_order && !told && (as_good(found) || opposed <= some_opposed);
    if (recorded_believed)
        return {};
    if (constexpr double clearly = 0.3; in_order && !told && opposed > all_opposed && found.margin < clearly) {
        const bool viewed = orientation.kind == NormalOrientation::Kind::viewpoint;
        if (z_up_)
            doubts.push_back(
                fmt::format("{:.0f} % of the recorded normals look down, though the cloud seems to be seen from "
                            "above; they are kept: --cloud.outside up turns them, --cloud.normals recorded is "
                            "sure of them.",
                            100 * opposed));
        else if (orientation.kind != NormalOrientation::Kind::terrain && !found.doubt) // z may point anywhere
            doubts.push_back(
                fmt::format("{:.0f} % of the recorded normals face away from {}; they are kept: --cloud.outside "
                            "turns them, --cloud.normals recorded is sure of them.",
                            100 * opposed, viewed ? orientation.why : "where scanners could have stood"));
        return {};
    }
    const bool all = in_order || told || order.random > mostly_random;
    std::size_t turned = 0;
    for (std::size_t i = 0; i < surface.size(); ++i)
        if (found.sign[i] < 0 && (all || found.confidence[i] > sure) && !surface.normals[i].isZero()) {
            surface.normals[i] = -surface.normals[i];
            ++turned;
        }
    turned_points += turned;
    judged_points += surface.size();
    if (told)
        turned_why = "--cloud.outside says so";
    else if (in_order)
        turned_why = fmt::format("where sides are sure, {:.0f} % of them opposed them", 100 * opposed);
    else
        turned_why = fmt::format("{:.0f} % of the points lie in patches whose sides look random", 100 * order.random);
    if (!told && (in_order || turned > surface.size() * 3 / 5))
        doubts.push_back(fmt::format(
            "{:.0f} % of the recorded normals face away from where scanners could have stood; they "
            "were turned: --cloud.normals recorded keeps them.",
            in_order ? 100 * opposed : 100 * static_cast<double>(turned) / static_cast<double>(surface.size())));
    note(found);
    return all ? std::move(found.confidence) : std::vector<float>();
}

void SettledSides::note(const Sides& found) {
    if (!found.why.empty())
        orientation.why = found.why;
    if (found.doubt)
        doubts.push_back(*found.doubt);
}

} // namespace scanshade
