#include "ao/cloud/splat_ao.h"

#include "ao/cloud/neighbour_means.h"
#include "ao/cloud/surface/order_statistics.h"
#include "projection/base/indices_where.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Cholesky>
#include <fmt/format.h>
#include <limits>
#include <numeric>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr float unseen = std::numeric_limits<float>::quiet_NaN();

/// The numbers of the axes by their sigmas.
struct Axes {
    int shortest, middle, longest;
};
Axes axes_of(const Splat& splat) {
    std::array<int, 3> order{0, 1, 2};
    std::ranges::sort(order, std::ranges::less(), [&](int axis) { return splat.sigma[axis]; });
    return {order[0], order[1], order[2]};
}
Vector3f axis(const Splat& splat, int which) { return splat.rotation * Vector3f(Vector3f::Unit(which)); }

/// A splat twice as wide as thick is a disc. Others, balls and needles, do not tell their normal.
bool is_flat(const Splat& splat, const Axes& axes) {
    return splat.sigma[axes.middle] > 0 && splat.sigma[axes.shortest] <= 0.5F * splat.sigma[axes.middle];
}

/// What a splat takes of rays through its plane. Of a splat that is not flat it is a slice.
SoftDisc soft_disc(const Splat& splat, const Vector3f& normal) {
    constexpr float rim = 3; // sigmas
    const Axes axes = axes_of(splat);
    const float widest = splat.sigma[axes.longest];
    SoftDisc disc{.opacity = splat.opacity, .radius = rim * widest};
    if (is_flat(splat, axes)) {
        disc.u = axis(splat, axes.middle) / splat.sigma[axes.middle];
        disc.v = axis(splat, axes.longest) / widest;
        return disc;
    }
    if (!(splat.sigma[axes.shortest] > 0))
        return {};
    const Eigen::Matrix3f turned = splat.rotation.toRotationMatrix() * splat.sigma.cwiseInverse().asDiagonal();
    Eigen::Matrix<float, 3, 2> plane;
    plane.col(0) = normal.unitOrthogonal();
    plane.col(1) = normal.cross(plane.col(0));
    const Eigen::Matrix<float, 3, 2> scaled = turned.transpose() * plane;
    const Eigen::Matrix2f root = (scaled.transpose() * scaled).eval().llt().matrixU();
    disc.u = plane * root.row(0).transpose();
    disc.v = plane * root.row(1).transpose();
    return disc;
}

/// Which splats make surfaces.
struct Chosen {
    Indices surface;
    std::size_t haze = 0, huge = 0;
};
Chosen chosen_of(const PointSet& cloud) {
    constexpr float huge = 20; // times the median: skies and backgrounds are made of few splats
    const Indices dense = indices_where(cloud.points.size(), [&](std::size_t i) {
        const Splat& splat = cloud.splats[i];
        return cloud.points[i].allFinite() && splat.opacity >= haze_opacity && splat.sigma.maxCoeff() > 0;
    });
    std::vector<float> widths(dense.size());
    std::ranges::transform(dense, widths.begin(), [&](std::uint32_t i) { return cloud.splats[i].sigma.maxCoeff(); });
    const float widest = huge * median_of_lengths(widths);
    Chosen chosen;
    chosen.surface = indices_where(dense, [&](std::uint32_t i) { return cloud.splats[i].sigma.maxCoeff() <= widest; });
    const auto finite_points = std::ranges::count_if(cloud.points, [](const Vector3d& p) { return p.allFinite(); });
    chosen.haze = static_cast<std::size_t>(finite_points) - dense.size();
    chosen.huge = dense.size() - chosen.surface.size();
    return chosen;
}

/// The splats of a surface, one after the other.
struct Members {
    std::vector<Vector3d> points, axes, seen_from; ///< axes: zero where a splat does not tell its normal
    std::size_t flat = 0;
};
Members members_of(const PointSet& cloud, const Indices& which, bool use_axes) {
    Members members;
    members.points.resize(which.size());
    members.axes.resize(which.size(), Vector3d::Zero());
    members.seen_from.resize(cloud.seen_from.empty() ? 0 : which.size());
    for (std::size_t k = 0; k < which.size(); ++k) {
        const Splat& splat = cloud.splats[which[k]];
        members.points[k] = cloud.points[which[k]];
        if (const Axes axes = axes_of(splat); use_axes && is_flat(splat, axes)) {
            members.axes[k] = axis(splat, axes.shortest).cast<double>();
            ++members.flat;
        }
        if (!members.seen_from.empty())
            members.seen_from[k] = cloud.seen_from[which[k]];
    }
    return members;
}

Untouched<float> light_on(const CloudSurface& surface, const DiscRays& rays, const DirectionSet& directions, int passes,
                          float radius, const std::optional<Vector3f>& up) {
    const std::vector<char> all(surface.size(), 1);
    Untouched<float> values(surface.size());
    std::ranges::fill(values, unseen);
    tbb::parallel_for(std::size_t(0), surface.tree.leaves(),
                      [&](std::size_t leaf) { rays.open(leaf, directions, radius, up, all, values); });
    for (int pass = 0; pass < passes; ++pass)
        values = smoothed(surface, values, radius);
    return values;
}

/// Whether the nearest cameras that have a splat in their images see its front, 1, or its back, -1; 0 if none sees it.
class CameraVotes {
  public:
    CameraVotes(std::span<const FoundFrame> frames, const Vector3d& middle) {
        for (const FoundFrame& frame : frames)
            cameras_.push_back({(frame.world_from_camera.inverse() * Eigen::Translation3d(middle)).cast<float>(),
                                (frame.world_from_camera.translation() - middle).cast<float>(), frame.camera});
    }
    [[nodiscard]] int operator()(const CloudSurface& surface, const DiscRays& rays, std::size_t splat) const {
        constexpr std::size_t most = 12; // of them, the nearest: farther ones are rarely the first to see a thing
        constexpr int enough = 5;        // more votes for one side than for the other
        std::vector<std::pair<float, const PosedCamera*>> near;
        for (const PosedCamera& camera : cameras_)
            if (camera.shows(surface.tree[splat]))
                near.emplace_back((surface.tree[splat] - camera.position).squaredNorm(), &camera);
        const auto end = near.begin() + static_cast<std::ptrdiff_t>(std::min(most, near.size()));
        std::partial_sort(near.begin(), end, near.end());
        int votes = 0, asked = 0;
        for (auto each = near.begin(); each != end && std::abs(votes) < enough; ++each, ++asked)
            votes += rays.seen_from(splat, each->second->position);
        // Some look through gaps at the backs of what none sees.
        return 2 * std::abs(votes) < asked ? 0 : std::clamp(votes, -1, 1);
    }

  private:
    struct PosedCamera {
        Eigen::Isometry3f camera_from_tree;
        Vector3f position;
        Pinhole pinhole;

        [[nodiscard]] bool shows(const Vector3f& point) const {
            const Vector3d seen = (camera_from_tree * point).cast<double>();
            if (!(seen.z() > 0))
                return false;
            const Eigen::Vector2d pixel = pinhole.pixel(seen);
            return pixel.x() > -0.5 && pixel.y() > -0.5 && pixel.x() < pinhole.size.width - 0.5 &&
                   pixel.y() < pinhole.size.height - 0.5;
        }
    };
    std::vector<PosedCamera> cameras_;
};

/// Turns sides to where they are seen from: splats are recorded from many sides, so the backs of things face away from
/// any place. `see(splat)` is 1 for its front, -1, or 0; `known` is how sure sides are. Returns the share of splats
/// that are seen.
template <class See>
double turn_to_seen(CloudSurface& surface, const See& see, std::vector<float>& known) {
    std::vector<std::int8_t> seen(surface.size());
    tbb::parallel_for(std::size_t(0), seen.size(), [&](std::size_t i) {
        seen[i] = static_cast<std::int8_t>(surface.normals[i].isZero() ? 0 : see(i));
    });
    const auto front = std::ranges::count(seen, 1), back = std::ranges::count(seen, -1);
    const float whole = back > front ? -1.0F : 1.0F; // what it does not see is wrong where all the rest is
    std::vector<float> turned(surface.size(), whole);
    tbb::parallel_for(std::size_t(0), turned.size(), [&](std::size_t i) {
        constexpr float one_plane = 0.9F, fewest = 4; // cosine; splats that agree
        float votes = seen[i], voters = 1;            // a gap in what hides it may show one of many
        for (const std::uint32_t j : surface.near[i])
            if (const float alike = surface.normals[i].dot(surface.normals[j]); j != i && std::abs(alike) > one_plane) {
                votes += static_cast<float>(alike < 0 ? -seen[j] : seen[j]);
                ++voters;
            }
        if (std::abs(votes) <= 0.75F * voters || voters < fewest)
            return;
        turned[i] = votes < 0 ? -1.0F : 1.0F;
        known[i] = 1;
    });
    for (std::size_t i = 0; i < turned.size(); ++i)
        surface.normals[i] *= turned[i];
    return static_cast<double>(front + back) / static_cast<double>(std::max<std::size_t>(surface.size(), 1));
}

/// Returns how sure they are, by index in the tree. `cameras` decide where there are some.
std::vector<float> settle(SettledSides& sides, CloudSurface& surface, const DiscRays& soft,
                          std::span<const FoundFrame> cameras) {
    using Kind = NormalOrientation::Kind;
    const NormalOrientation asked = sides.orientation;
    const bool to_place = asked.kind == Kind::viewpoint && cameras.empty();
    if (to_place || !cameras.empty())
        sides.orientation = {};
    std::optional<DiscRays> rays;
    std::vector<float> known = sides.settle(surface, rays, false);
    constexpr double much = 0.1; // of the splats: enough to choose between two answers of the whole
    if (!cameras.empty()) {
        const CameraVotes votes(cameras, surface.middle);
        const double share = turn_to_seen(
            surface, [&](std::size_t i) { return votes(surface, soft, i); }, known);
        if (share > much)
            sides.findings.clear();
        sides.orientation.why = fmt::format("to the {} cameras that the splats were made with, which see {:.0f} % of "
                                            "them; others {}",
                                            cameras.size(), 100 * share, sides.orientation.why);
        return known;
    }
    if (!to_place)
        return known;
    const Vector3f place = (asked.point - surface.middle).cast<float>();
    const double share = turn_to_seen(
        surface, [&](std::size_t i) { return soft.seen_from(i, place); }, known);
    if (share > much)
        sides.findings.clear();
    sides.orientation = asked;
    sides.orientation.why += ", where it sees them";
    return known;
}

/// Discs of known width and normal err less than points, whose surroundings are estimated: by this share, which holds
/// on corners and rooms of 2,000 to 20,000 splats. A side may be as wrong.
float error_of_splat(CloudErrorSigns signs) {
    constexpr float share = 0.55F;
    const float all = expected_error(signs, shipped_cloud_errors());
    signs.side = CloudErrorSigns::recorded;
    const float sure = expected_error(signs, shipped_cloud_errors());
    return std::sqrt(std::max(all * all - sure * sure, 0.0F) + share * share * sure * sure);
}

/// Of the square that each splat of a surface has to itself: what the middle one covers, opacity 1 counting as all.
double covered_by(const PointSet& cloud, const Indices& which, double spacing) {
    std::vector<float> areas(which.size());
    std::ranges::transform(which, areas.begin(), [&](std::uint32_t i) {
        const Splat& splat = cloud.splats[i];
        const Axes axes = axes_of(splat);
        return splat.opacity * splat.sigma[axes.middle] * splat.sigma[axes.longest];
    });
    constexpr double whole = 6.2832; // integral of a normal distribution of sigma 1
    return whole * static_cast<double>(median_of_lengths(areas)) / (spacing * spacing);
}

void check_gaps(double covered, Findings& findings) {
    constexpr double least = 0.2;
    at_least(findings, Check::splat_gaps, covered, least, [&] {
        return fmt::format("the splats cover {:.2g} % of their surface: rays pass between them, and most stays open. "
                           "Check their scales, or keep x, y and z alone, which are computed as points.",
                           100 * covered);
    });
}

class SplatWork {
  public:
    SplatWork(const CloudSetup& setup, const PointSet& cloud, const std::optional<Vector3d>& scanner)
        : options_(with_defaults(setup.options)), setup_{options_, nullptr, setup.up, setup.viewpoint}, cloud_(cloud),
          scanner_(scanner) {}
    PointVisibility run() {
        const std::size_t count = cloud_.points.size();
        result_.visibility.assign(count, unseen);
        result_.error.assign(count, unseen);
        result_.normals.assign(count, Vector3f::Zero());
        const Chosen chosen = chosen_of(cloud_);
        if (!chosen.surface.empty())
            of_surface(chosen.surface);
        tell(chosen);
        return std::move(result_);
    }

  private:
    static CloudAoOptions with_defaults(CloudAoOptions options) {
        constexpr int rays = 32, passes = 2;
        options.rays = options.rays > 0 ? options.rays : rays;
        options.smooth = options.smooth >= 0 ? options.smooth : passes;
        return options;
    }

    void of_surface(const Indices& which);
    void attach(const CloudSurface& surface, const Untouched<float>& values, const std::vector<float>& side_known,
                const Indices& which);
    void give_to_haze(const CloudSurface& surface, const Indices& which);
    void tell(const Chosen& chosen);

    const CloudAoOptions options_;
    const CloudSetup setup_;
    const PointSet& cloud_;
    const std::optional<Vector3d> scanner_;
    PointVisibility result_;
};

/// Strays, farther splats of a background, occlude as well; only radius and sides are decided without them.
void SplatWork::of_surface(const Indices& which) {
    Watch watch(result_.timings);
    Members members = members_of(cloud_, which, options_.normals != CloudNormals::estimated);
    Indices all(which.size());
    std::iota(all.begin(), all.end(), 0U);
    DecidedCloud decided = decide(setup_, {.points = members.points, .z_up = cloud_.z_up}, scanner_, std::move(all));
    result_.radius = decided.decisions.radius;
    result_.spacing = decided.decisions.spacing;
    std::ranges::move(decided.notes, std::back_inserter(result_.notes));
    watch.lap("survey");
    CloudSurface surface = cloud_surface(LocalCloud(members.points), members.axes);
    constexpr double same_planes = 0.8;
    if (options_.normals == CloudNormals::automatic && surface.agreement < same_planes) {
        members.flat = 0;
        surface = cloud_surface(LocalCloud(members.points), {});
    }
    watch.lap("planes");
    std::vector<SoftDisc> soft(surface.size());
    tbb::parallel_for(std::size_t(0), soft.size(), [&](std::size_t i) {
        if (!surface.normals[i].isZero())
            soft[i] = soft_disc(cloud_.splats[which[surface.tree.original(i)]], surface.normals[i]);
    });
    const DiscRays rays(surface, soft);
    SettledSides sides(options_, setup_.up, cloud_.z_up);
    sides.orientation = decided.decisions.orientation;
    std::vector<float> side_known;
    if (members.seen_from.empty())
        side_known =
            settle(sides, surface, rays, options_.outside == "auto" ? cloud_.frames : std::span<const FoundFrame>());
    else
        sides.turn_to(surface, [&](std::size_t index) { return members.seen_from[surface.tree.original(index)]; });
    watch.lap("sides");
    const float reach = options_.sky ? std::numeric_limits<float>::max() : static_cast<float>(result_.radius);
    const auto up = options_.sky ? std::optional<Vector3f>(setup_.up.cast<float>()) : std::nullopt;
    const Untouched<float> values =
        light_on(surface, rays, DirectionSet(options_.rays, options_.seed), options_.smooth, reach, up);
    watch.lap("rays and means");
    attach(surface, values, side_known, which);
    give_to_haze(surface, which);
    watch.lap("gather");
    result_.findings = sides.findings;
    if (result_.spacing > 0)
        check_gaps(covered_by(cloud_, which, result_.spacing), result_.findings);
    result_.notes.push_back(
        fmt::format("normals: the shortest axes of {} flat splats, planes through 16 neighbours for {} "
                    "others, {}.",
                    members.flat, which.size() - members.flat, turned_how(sides)));
}

void SplatWork::attach(const CloudSurface& surface, const Untouched<float>& values,
                       const std::vector<float>& side_known, const Indices& which) {
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        const std::size_t splat = which[surface.tree.original(i)];
        const float disc = surface.disc_radius[i], radius = static_cast<float>(result_.radius);
        result_.visibility[splat] = values[i];
        result_.normals[splat] = surface.normals[i];
        if (std::isnan(values[i]))
            return;
        const float side = side_known.empty() ? CloudErrorSigns::recorded : side_known[i];
        result_.error[splat] = error_of_splat({.visibility = values[i],
                                               .flatness = surface.flatness[i],
                                               .span = disc > 0 ? radius / disc : 0,
                                               .rough = surface.roughness[i] / radius,
                                               .side = side});
    });
}

/// What blends with a surface is shaded like it. What is farther from all than the radius is open.
void SplatWork::give_to_haze(const CloudSurface& surface, const Indices& which) {
    const float reach = static_cast<float>(result_.radius),
                reach2 = options_.sky ? std::numeric_limits<float>::infinity() : reach * reach;
    std::vector<char> has_own(cloud_.points.size(), 0);
    for (const std::uint32_t splat : which)
        has_own[splat] = 1;
    tbb::parallel_for(std::size_t(0), has_own.size(), [&](std::size_t i) {
        if (has_own[i] || !cloud_.points[i].allFinite())
            return;
        Nearest nearest;
        surface.tree.find_near((cloud_.points[i] - surface.middle).cast<float>(), 1, nearest, reach2);
        if (nearest.all().empty()) {
            result_.visibility[i] = 1;
            result_.error[i] = 0;
            return;
        }
        const std::uint32_t like = which[surface.tree.original(nearest.all().front().point)];
        result_.visibility[i] = result_.visibility[like];
        result_.error[i] = result_.error[like];
    });
}

void SplatWork::tell(const Chosen& chosen) {
    ErrorSum sum;
    for (const float error : result_.error)
        sum.add(error);
    result_.expected_error = sum.rms();
    if (result_.expected_error)
        result_.notes.push_back(told_error(*result_.expected_error, 0).note);
    if (chosen.haze > 0)
        result_.notes.push_back(fmt::format("{} of {} splats are of next to no opacity (below {:g}): they occlude "
                                            "nothing, and have the visibility of the nearest surface.",
                                            chosen.haze, cloud_.points.size(), haze_opacity));
    if (chosen.huge > 0)
        result_.notes.push_back(
            fmt::format("{} splats are more than 20 times as wide as most: they are taken for sky and "
                        "occlude nothing.",
                        chosen.huge));
}

} // namespace

PointVisibility visibility_of_splats(const CloudSetup& setup, const PointSet& cloud,
                                     const std::optional<Vector3d>& scanner) {
    return SplatWork(setup, cloud, scanner).run();
}

} // namespace scanshade
