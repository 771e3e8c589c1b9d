// Visibility of the points of a cloud or of a tile: neighbours, planes, sides, discs, rays, and means over neighbours.
#include "ao/cloud/cloud_work.h"

#include "ao/cloud/back_share.h"
#include "ao/cloud/neighbour_means.h"
#include "ao/cloud/repeatability.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "projection/base/indices_where.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <numeric>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
constexpr float nothing = std::numeric_limits<float>::quiet_NaN();

/// Recorded normals, where they are used.
std::span<const Vector3d> normals_used(const CloudAoOptions& options, const PointSet& cloud) {
    return options.normals == CloudNormals::estimated ? std::span<const Vector3d>() : cloud.normals;
}

NormalOrientation orientation_of(const CloudSetup& setup, const std::vector<Vector3d>& some,
                                 const std::optional<Vector3d>& scanner, bool z_up) {
    using Kind = NormalOrientation::Kind;
    const CloudAoOptions& options = setup.options;
    NormalOrientation found;
    if (setup.viewpoint)
        found = {Kind::viewpoint, *setup.viewpoint, "the position given by --cloud.outside"};
    else if (options.outside == "auto")
        found = guessed_orientation(some, scanner, z_up);
    else
        found = {options.outside == "up"        ? Kind::direction
                 : options.outside == "outward" ? Kind::outward
                                                : Kind::inward,
                 setup.up, options.outside + ", as given"};
    if (found.kind == Kind::direction || found.kind == Kind::terrain)
        found.point = setup.up;
    return found;
}

/// Visibility changes slowly against the radius: the more points the radius spans, the more may share their rays.
RaysAndMeans rays_and_means(const CloudAoOptions& options, const CloudDecisions& decided, bool on_gpu) {
    const double spacings = options.sky || !(decided.spacing > 0) ? 0 : decided.radius / decided.spacing;
    const std::size_t level = spacings > 120 ? 2 : spacings > 60 ? 1 : 0;
    constexpr int of_gpu = 64; // costs a GPU less time than the other stages cost the host
    const int rays = options.rays > 0 ? options.rays : on_gpu ? of_gpu : std::array{16, 8, 4}[level];
    return {rays, options.smooth >= 0 ? options.smooth : std::array{2, 3, 5}[level]};
}

std::string note_of(const RaysAndMeans& chosen) {
    return fmt::format("{} rays a point, {} times the mean over neighbours.", chosen.rays, chosen.passes);
}

} // namespace

DecidedCloud decide(const CloudSetup& setup, const PointSet& cloud, const std::optional<Vector3d>& scanner,
                    Indices finite, std::optional<double> sample_of) {
    const CloudAoOptions& options = setup.options;
    DecidedCloud decided;
    CloudDecisions& found = decided.decisions;
    std::vector<Vector3d> some = sample_of ? std::vector<Vector3d>(cloud.points.begin(), cloud.points.end())
                                           : sampled(cloud.points, finite, enough_to_judge);
    found.extent = extent_of(some);
    const auto beyond = [&](const Vector3d& point) {
        return (point - found.extent.centre).norm() > found.extent.farthest;
    };
    std::erase_if(some, beyond);
    decided.strays = indices_where(finite, [&](std::uint32_t i) { return beyond(cloud.points[i]); });
    decided.within = decided.strays.empty()
                         ? std::move(finite)
                         : indices_where(finite, [&](std::uint32_t i) { return !beyond(cloud.points[i]); });
    found.points = static_cast<double>(decided.within.size());
    found.orientation = orientation_of(setup, some, scanner, cloud.z_up);
    if (!some.empty()) {
        const double share = sample_of
                                 ? std::min(1.0, static_cast<double>(cloud.points.size()) / std::max(*sample_of, 1.0))
                                 : static_cast<double>(some.size()) / found.points;
        // That of a sample is larger by the root of its share: points are on surfaces.
        found.spacing = static_cast<double>(spacing_of(LocalCloud(some))) * std::sqrt(share);
        found.radius = options.radius > 0 ? options.radius : default_radius(found.extent.size, found.spacing);
        decided.notes.push_back(
            fmt::format("points stand {:.4g} apart (median), over {:.4g}.", found.spacing, found.extent.size));
        decided.notes.push_back(
            options.sky ? "visibility is the share of the sky, at any distance."
                        : fmt::format("radius {:.4g} ({}).", found.radius,
                                      options.radius > 0 ? "as given"
                                                         : "a twentieth of the extent, within 10 .. 200 spacings"));
    }
    decided.notes.push_back(note_of(rays_and_means(options, found, setup.device)));
    return decided;
}

std::size_t points_at_once(const CloudSetup& setup) {
    constexpr double bytes_per_point = 420; // the file's records among them; with a GPU it is less
    const auto fitting = static_cast<std::size_t>(setup.options.memory_mib * 1048576.0 / bytes_per_point);
    return setup.device ? std::min(fitting, CloudGpu(*setup.device).most_points()) : fitting;
}

CloudWork::CloudWork(Role role, const CloudSetup& setup, const PointSet& cloud, const std::optional<Vector3d>& scanner,
                     Start start)
    : role_(role), setup_(setup), options_(setup.options), scanner_(scanner), cloud_(cloud), whole_(start.whole),
      decided_(std::move(start.decided.decisions)), watch_(result_.timings, start.begun),
      rays_(rays_and_means(options_, decided_, setup.device && role != Role::part)),
      directions_(rays_.rays, options_.seed), sides_(options_, setup.up, cloud.z_up),
      valid_(std::move(start.decided.within)), strays_(std::move(start.decided.strays)), twins_(std::move(start.twins)),
      normals_refused_(whole_ && whole_->normals_refused) {
    if (setup.device)
        gpu_.emplace(*setup.device);
    if (cloud.from_scanner)
        sides_.seen_from = scanner;
    sides_.orientation = decided_.orientation;
    result_.radius = decided_.radius;
    result_.spacing = decided_.spacing;
    result_.notes = std::move(start.decided.notes);
    if (role == Role::part) // others are told by what was decided
        result_.notes.push_back(note_of(rays_));
    if (role != Role::tile)
        watch_.lap("survey");
}

CloudWork CloudWork::of_cloud(const CloudSetup& setup, const PointSet& cloud, const std::optional<Vector3d>& scanner) {
    Start start;
    Indices points = finite(cloud.points);
    start.twins = take_out_twins(cloud.points, normals_used(setup.options, cloud), points);
    start.decided = decide(setup, cloud, scanner, std::move(points));
    return {Role::cloud, setup, cloud, scanner, std::move(start)};
}

CloudWork CloudWork::of_part(const CloudSetup& setup, const PointSet& part, const std::optional<Vector3d>& scanner,
                             const CloudDecisions& whole) {
    Start start;
    Indices points = finite(part.points);
    start.twins = take_out_twins(part.points, normals_used(setup.options, part), points);
    start.decided = {whole, std::move(points), {}, {}};
    CloudDecisions& decided = start.decided.decisions;
    decided.points = static_cast<double>(std::max<std::size_t>(start.decided.within.size(), 1));
    decided.spacing = whole.spacing * std::sqrt(whole.points / decided.points);
    return {Role::part, setup, part, scanner, std::move(start)};
}

CloudWork CloudWork::of_tile(const CloudSetup& setup, const PointSet& tile, const OfWhole& whole) {
    Start start;
    Indices points(tile.points.size());
    std::iota(points.begin(), points.end(), 0U);
    if (whole.twins) {
        const bool used = !whole.normals_refused;
        start.twins =
            all_twins(tile.points, used ? normals_used(setup.options, tile) : std::span<const Vector3d>(), points);
    }
    start.decided = {whole.decisions, std::move(points), {}, {}};
    start.whole = &whole;
    return {Role::tile, setup, tile, std::nullopt, std::move(start)};
}

PointVisibility CloudWork::run() {
    tile(valid_, valid_);
    require_results();
    std::ranges::copy(sides_.findings, std::back_inserter(result_.findings));
    compute_thinned();
    compute_strays();
    copy_to_twins();
    tell_error();
    tell();
    if (gpu_)
        for (const auto& [pass, ms] : gpu_->timings())
            result_.timings.emplace_back("on the device: " + pass, ms);
    return std::move(result_);
}

CloudWork::TileResult CloudWork::run_tile(std::span<const char> in_core) {
    std::vector<char> needed(in_core.begin(), in_core.end()); // copies stand for each other
    std::size_t twins = 0;
    for (const auto& [point, same_as] : twins_) {
        needed[same_as] |= in_core[point];
        twins += in_core[point] != 0;
    }
    const Indices core = indices_where(valid_, [&](std::uint32_t i) { return needed[i] != 0; });
    tile(core, valid_);
    require_results();
    copy_to_twins();
    if (gpu_)
        for (const auto& [pass, ms] : gpu_->timings())
            result_.timings.emplace_back("on the device: " + pass, ms);
    return {std::move(result_), std::move(kept_signs_), fitted_, twins, gpu_tiles_ > 0};
}

void CloudWork::copy_to_twins() {
    for (const auto& [point, same_as] : twins_) {
        result_.visibility[point] = result_.visibility[same_as];
        result_.error[point] = result_.error[same_as];
        result_.normals[point] = result_.normals[same_as];
        if (!kept_signs_.empty())
            kept_signs_[point] = kept_signs_[same_as];
    }
}

WholeSides CloudWork::settle_sides() {
    Fitted planes = planes_of(valid_, nullptr);
    CloudSurface& surface = planes.surface;
    fitted_ = {}; // tiles tell of themselves
    drop_strays(surface, decided_.extent.centre, static_cast<double>(surface.spacing));
    std::optional<DiscRays> rays;
    std::vector<float> known;
    if (cloud_.seen_from.empty())
        known = sides_.settle(surface, rays, recorded());
    else
        turn_to_cameras(surface, planes.points, valid_);
    return {std::move(surface), std::move(known)};
}

PointVisibility CloudWork::of_strays(const CloudSetup& setup, const PointSet& strays,
                                     const std::optional<Vector3d>& scanner, double radius, double spacing) {
    CloudAoOptions options = setup.options;
    options.radius = radius;
    const CloudSetup alone_setup{options, nullptr, setup.up, setup.viewpoint};
    Start start;
    Indices points = finite(strays.points);
    start.twins = take_out_twins(strays.points, normals_used(options, strays), points);
    start.decided = decide(alone_setup, strays, scanner, std::move(points));
    start.decided.decisions.spacing = std::min(start.decided.decisions.spacing, spacing);
    return CloudWork(Role::strays, alone_setup, strays, scanner, std::move(start)).run();
}

/// Made as late as possible: the rays need the memory.
void CloudWork::require_results() {
    const std::size_t count = cloud_.points.size();
    if (result_.visibility.size() != count)
        tbb::parallel_invoke([&] { result_.visibility.assign(count, nothing); },
                             [&] { result_.error.assign(count, nothing); },
                             [&] { result_.normals.assign(count, Vector3f::Zero()); },
                             [&] { kept_signs_.assign(is_checked() ? count : 0, {}); },
                             [&] { signs_.resize(options_.keep_signs ? count : 0); });
}

/// These points, with the normals that they have.
CloudWork::Picked CloudWork::picked(const Indices& indices) const {
    Picked some;
    some.points.resize(indices.size());
    some.normals.resize(cloud_.normals.empty() ? 0 : indices.size());
    some.seen_from.resize(cloud_.seen_from.empty() ? 0 : indices.size());
    tbb::parallel_for(std::size_t(0), indices.size(), [&](std::size_t k) {
        some.points[k] = cloud_.points[indices[k]];
        if (!some.normals.empty())
            some.normals[k] = cloud_.normals[indices[k]];
        if (!some.seen_from.empty())
            some.seen_from[k] = cloud_.seen_from[indices[k]];
    });
    return some;
}

/// Strays by themselves, as a cloud of its own about its own middle: what they say of normals and sides must not
/// concern the others. A few of them make no surface; so do strays of strays.
void CloudWork::compute_strays() {
    if (strays_.size() < fewest_strays || role_ != Role::cloud)
        return;
    const auto [points, normals, seen_from] = picked(strays_);
    const PointVisibility found = of_strays(setup_, {.points = points, .normals = normals, .seen_from = seen_from},
                                            scanner_, result_.radius, result_.spacing);
    for (std::size_t k = 0; k < strays_.size(); ++k) {
        result_.visibility[strays_[k]] = found.visibility[k];
        result_.error[strays_[k]] = found.error[k];
        result_.normals[strays_[k]] = found.normals[k];
    }
}

ThinnedCheck CloudWork::check_of_whole() const {
    const std::size_t points = whole_ ? static_cast<std::size_t>(whole_->decisions.points) : valid_.size();
    const bool checked = role_ == Role::cloud || role_ == Role::tile;
    return !checked || options_.sky ? ThinnedCheck() : thinned_check(points, result_.radius / result_.spacing);
}

bool CloudWork::is_checked() const { return check_of_whole().keep > 0; }

/// How far rays go; in a sky at any distance.
float CloudWork::reach() const {
    return options_.sky ? std::numeric_limits<float>::max() : static_cast<float>(result_.radius);
}

/// Again with a part of the points: where that gives other values, these are not to be relied on.
void CloudWork::compute_thinned() {
    const ThinnedCheck check = check_of_whole();
    if (!(check.keep > 0))
        return;
    const auto chosen = static_cast<std::uint64_t>(check.keep * 0x1p32);
    const Indices kept = indices_where(valid_, [&](std::uint32_t i) { return hash(i, 1U) < chosen; });
    const auto [points, normals, seen_from] = picked(kept);
    CloudAoOptions options = options_;
    options.keep_signs = false;
    if (sides_.recorded_kept)
        options.normals = CloudNormals::recorded;
    const PointSet part{points, normals, {}, cloud_.z_up, cloud_.from_scanner, seen_from};
    const CloudSetup setup{options, setup_.device, setup_.up, setup_.viewpoint};
    CloudDecisions whole = decided_;
    whole.orientation = sides_.orientation;
    CloudWork some = of_part(setup, part, scanner_, whole);
    const Repeatability found = repeatability(cloud_.points, result_.visibility, kept, some.run().visibility, check,
                                              order_.empty() ? valid_ : order_);
    order_.clear();
    error_by_check_ = found.rms;
    watch_.lap("check on a part");
    tbb::parallel_for(std::size_t(0), result_.error.size(), [&](std::size_t i) {
        if (!std::isnan(result_.visibility[i]))
            result_.error[i] =
                error_once_checked(result_.error[i], result_.visibility[i], kept_signs_[i], found.error[i]);
    });
    for (std::size_t i = 0; i < signs_.size(); ++i)
        signs_[i].repeat = found.error[i];
}

void CloudWork::tell_error() {
    if (role_ != Role::cloud)
        return;
    ErrorSum sum;
    for (const float error : result_.error)
        sum.add(error);
    result_.expected_error = sum.rms();
    if (!result_.expected_error)
        return;
    const ToldError told = told_error(*result_.expected_error, error_by_check_);
    result_.notes.push_back(told.note);
    result_.findings.push_back(told.by_part);
}

/// Values for `core`, a part of `round`; on the GPU if its memory suffices.
void CloudWork::tile(const Indices& core, const Indices& round) {
    if (round.empty())
        return;
    if (gpu_ && round.size() <= gpu_->most_points()) {
        try {
            tile(core, round, &*gpu_);
            ++gpu_tiles_;
            return;
        } catch (const Outage&) { // concerns more than this cloud
            throw;
        } catch (const Error& failure) { // most likely out of memory, since other programs use the device, too
            result_.notes.push_back(fmt::format("{}: {}", gpu_->device_name(), failure.what()));
        }
    }
    tile(core, round, nullptr);
}

void CloudWork::tile(const Indices& core, const Indices& round, CloudGpu* gpu) {
    Fitted planes = planes_of(round, gpu);
    CloudSurface& surface = planes.surface;
    FittedCloud& fitted = planes.points;
    if (role_ == Role::cloud)
        note_lines(surface);
    const std::vector<std::uint32_t> lonely = drop_strays(surface, decided_.extent.centre, result_.spacing);
    std::optional<DiscRays> rays;
    std::vector<float> side_known;
    if (!cloud_.seen_from.empty())
        turn_to_cameras(surface, fitted, round);
    else if (!whole_)
        side_known = sides_.settle(surface, rays, recorded());
    else if (!whole_->recorded_kept)
        side_known = sides_as_in_whole(surface);
    for (const std::uint32_t index : lonely)
        surface.normals[index].setZero();
    watch_.lap("sides");
    BackShare backs;
    constexpr double noise_is_told = 76; // spacings; see look_for_noise()
    constexpr std::size_t some = 2000;
    const bool by_radius = role_ == Role::cloud && result_.radius < noise_is_told * result_.spacing;
    if (!fitted.empty() || by_radius) {
        if (!rays)
            rays.emplace(surface);
        backs = fitted.empty() ? back_share(surface, *rays, reach(), some) : back_share(surface, *rays, reach());
        if (fitted.empty())
            backs.near.clear();
        fitted_.backs = std::max(fitted_.backs, backs.mean);
        watch_.lap("backs");
    }
    const Wanted wanted = wanted_of(core, round, fitted);
    const Untouched<float> values = visibility_of(surface, std::move(rays), wanted, gpu);
    attach(planes, values, side_known, backs.near, round, wanted);
    if (role_ == Role::cloud && fitted.empty()) {
        order_.resize(round.size());
        tbb::parallel_for(std::size_t(0), order_.size(),
                          [&](std::size_t i) { order_[i] = round[surface.tree.original(i)]; });
    }
    watch_.lap("gather");
}

/// Both orders are ascending. A point of the surface is wanted if it stands for one of the core.
CloudWork::Wanted CloudWork::wanted_of(const Indices& core, const Indices& round, const FittedCloud& fitted) {
    Wanted wanted;
    std::vector<char>& in_core = wanted.in_core;
    in_core.resize(core.size() == round.size() ? 0 : round.size(), 0);
    for (std::size_t k = 0, c = 0; k < in_core.size() && c < core.size(); ++k)
        if (round[k] == core[c]) {
            in_core[k] = 1;
            ++c;
        }
    if (!in_core.empty() && !fitted.empty()) {
        wanted.fitted.resize(fitted.points.size(), 0);
        for (std::size_t k = 0; k < round.size(); ++k)
            wanted.fitted[fitted.fitted_of[k]] |= in_core[k];
    } else {
        wanted.fitted = in_core;
    }
    return wanted;
}

/// Rays from the points that are wanted and from those that their means need, then the means.
Untouched<float> CloudWork::visibility_of(const CloudSurface& surface, std::optional<DiscRays> rays,
                                          const Wanted& wanted, CloudGpu* gpu) {
    const float radius = reach();
    const std::optional<Vector3f> up = options_.sky ? std::optional<Vector3f>(setup_.up.cast<float>()) : std::nullopt;
    Untouched<float> values;
    if (gpu) {
        rays.reset();
        values = gpu->visibility(surface, directions_, {radius, up, mean_falloff(radius), rays_.passes});
        watch_.lap("rays and means");
    } else {
        if (!rays)
            rays.emplace(surface);
        watch_.lap("tree");
        values.resize(surface.size());
        tbb::parallel_for(std::size_t(0), values.size(), [&](std::size_t i) { values[i] = nothing; });
        std::vector<char> asked(surface.size(), 1);
        if (!wanted.fitted.empty()) {
            tbb::parallel_for(std::size_t(0), asked.size(), [&](std::size_t i) { asked[i] = wanted.has(surface, i); });
            asked = asked_by_means(surface, std::move(asked), rays_.passes);
        }
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, surface.tree.leaves(), 8), [&](const auto& range) {
            for (std::size_t leaf = range.begin(); leaf < range.end(); ++leaf)
                rays->open(leaf, directions_, radius, up, asked, values);
        });
        rays.reset();
        watch_.lap("rays");
        for (int pass = 0; pass < rays_.passes; ++pass)
            values = smoothed(surface, values, radius);
        watch_.lap("means");
    }
    return values;
}

/// Visibility, error and normal of each of the surface's points -> those points of the cloud that it stands for.
void CloudWork::attach(const Fitted& planes, const Untouched<float>& values, const std::vector<float>& side_known,
                       const std::vector<float>& backs, const Indices& round, const Wanted& wanted) {
    const CloudSurface& surface = planes.surface;
    const FittedCloud& fitted = planes.points;
    const float radius = reach();
    require_results();
    const CloudErrorTables& errors = shipped_cloud_errors();
    const float of_lines = back_of_lines(lines_);
    const auto give = [&](std::size_t index, std::size_t point) {
        result_.visibility[point] = values[index];
        result_.normals[point] = surface.normals[index];
        const float disc = surface.disc_radius[index];
        const bool has_plane = surface.flatness[index] > 0; // else nothing tells its side but where the scanner stood
        const CloudErrorSigns signs{.visibility = values[index],
                                    .flatness = surface.flatness[index],
                                    .span = disc > 0 ? radius / disc : 0,
                                    .rough = surface.roughness[index] / radius,
                                    .side = side_known.empty() ? CloudErrorSigns::recorded
                                            : has_plane        ? side_known[index]
                                                               : 0,
                                    .back = backs.empty() ? of_lines : std::hypot(backs[index], of_lines)};
        result_.error[point] =
            kept_signs_.empty() ? expected_error(signs, errors) : factor_of_surroundings(signs, errors);
        if (!kept_signs_.empty())
            kept_signs_[point] = kept(signs);
        if (!signs_.empty())
            signs_[point] = signs;
    };
    if (fitted.empty()) {
        tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
            if (wanted.has(surface, i) && !std::isnan(values[i]))
                give(i, round[surface.tree.original(i)]);
        });
    } else {
        std::vector<std::uint32_t> index_of(surface.size());
        for (std::size_t i = 0; i < surface.size(); ++i)
            index_of[surface.tree.original(i)] = static_cast<std::uint32_t>(i);
        tbb::parallel_for(std::size_t(0), round.size(), [&](std::size_t k) {
            const std::size_t index = index_of[fitted.fitted_of[k]];
            if ((wanted.in_core.empty() || wanted.in_core[k]) && !std::isnan(values[index]))
                give(index, round[k]);
        });
    }
}

/// Turns normals like those of the whole's nearest point in the same plane. Returns how sure that is by index in
/// the tree.
std::vector<float> CloudWork::sides_as_in_whole(CloudSurface& surface) const {
    const CloudSurface& whole = whole_->sides->surface;
    const std::vector<float>& whole_known = whole_->sides->known;
    const Vector3f apart = (surface.middle - whole.middle).cast<float>();
    std::vector<float> known(whole_known.empty() ? 0 : surface.size(), 0.0F);
    tbb::parallel_for(std::size_t(0), surface.size(), [&](std::size_t i) {
        Vector3f& normal = surface.normals[i];
        const Vector3f at = surface.tree[i] + apart;
        const float reach = 3 * std::max(whole.spacing, surface.disc_radius[i]);
        constexpr float alike = 0.7F;
        float nearest = std::numeric_limits<float>::infinity(), cosine = 0;
        whole.tree.for_each_within(at, reach, [&](std::size_t index) {
            const float turn = normal.isZero() ? 1.0F : normal.dot(whole.normals[index]);
            const Vector3f offset = whole.tree[index] - at;
            const float off_plane = 2 * offset.dot(normal); // the other side of a board is near, too
            const float distance = offset.squaredNorm() + off_plane * off_plane;
            if (std::abs(turn) < alike || distance >= nearest)
                return;
            nearest = distance;
            cosine = turn;
            if (!known.empty())
                known[i] = whole_known[index];
        });
        if (cosine < 0)
            normal = -normal;
    });
    return known;
}

/// To the camera or station that saw each point, or one of those that the disc stands for.
void CloudWork::turn_to_cameras(CloudSurface& surface, const FittedCloud& fitted, const Indices& round) {
    std::vector<std::uint32_t> point_of(fitted.points.size());
    for (std::size_t k = 0; k < round.size() && !fitted.empty(); ++k)
        point_of[fitted.fitted_of[k]] = round[k];
    sides_.turn_to(surface, [&](std::size_t index) {
        const std::size_t given = surface.tree.original(index);
        return cloud_.seen_from[fitted.empty() ? round[given] : point_of[given]];
    });
}

void CloudWork::note_lines(const CloudSurface& surface) {
    constexpr double many = 0.15; // 0.17 .. 0.6 in sweeps of 64 and 16 lasers along a street, 0.1 from a tripod
    lines_ = share_on_lines(surface);
    if (lines_ > many)
        result_.notes.push_back(fmt::format("{:.0f} % of the points have all near neighbours on a line, as in the "
                                            "rings of a spinning lidar: what lies between is not seen, which the "
                                            "expected error has. Several sweeps in one cloud fill the gaps.",
                                            100 * lines_));
}

/// Neighbours and planes of these points, without their noise.
CloudWork::Fitted CloudWork::planes_of(const Indices& which, CloudGpu* gpu) {
    std::vector<Vector3d> some_points, some_normals;
    const auto pick = [&](std::span<const Vector3d> from, std::vector<Vector3d>& to) {
        if (which.size() == from.size())
            return from;
        to.resize(which.size());
        tbb::parallel_for(std::size_t(0), to.size(), [&](std::size_t i) { to[i] = from[which[i]]; });
        return std::span<const Vector3d>(to);
    };
    const std::span<const Vector3d> points = pick(cloud_.points, some_points);
    std::span<const Vector3d> normals;
    if (recorded())
        normals = pick(cloud_.normals, some_normals);
    FittedCloud fitted;
    const auto surface_of = [&] {
        LocalCloud local(points);
        watch_.lap("points in order");
        fitted = without_noise(local, points, normals);
        watch_.lap("noise");
        if (gpu && fitted.empty() && !normals.empty() && !whole_)
            sides_.object_early(local, normals); // while the device works, the cores have time
        return fitted.empty() ? cloud_surface(std::move(local), normals, gpu)
                              : cloud_surface(LocalCloud(fitted.points), fitted.normals, gpu, fitted.axes);
    };
    CloudSurface surface = surface_of();
    constexpr double same_planes = 0.8;
    if (!normals.empty() && !whole_ && options_.normals == CloudNormals::automatic && surface.agreement < same_planes) {
        normals_refused_ = true;
        result_.notes.push_back(
            fmt::format("recorded normals are not used: the median angle between them and the planes of the points is "
                        "{:.0f} degrees; --cloud.normals recorded uses them anyway.",
                        std::acos(surface.agreement) * 180 / std::numbers::pi));
        normals = {};
        surface = surface_of();
    }
    watch_.lap("planes");
    fitted_.noise = std::max(fitted_.noise, fitted.noise);
    fitted_.moved += fitted.moved;
    fitted_.kept += fitted.points.size();
    fitted_.from += which.size();
    if (!fitted.empty()) {
        std::vector<std::uint32_t> count(fitted.points.size(), 0);
        for (const std::uint32_t point : fitted.fitted_of)
            ++count[point];
        surface.stands_for.resize(surface.size());
        surface.noise.resize(fitted.sigma.empty() ? 0 : surface.size());
        for (std::size_t i = 0; i < surface.size(); ++i) {
            surface.stands_for[i] = count[surface.tree.original(i)];
            if (!surface.noise.empty())
                surface.noise[i] = fitted.sigma[surface.tree.original(i)];
            if (fitted.alone[surface.tree.original(i)])
                surface.disc_radius[i] = 0;
            else if (!fitted.largest_disc.empty())
                surface.disc_radius[i] =
                    std::min(surface.disc_radius[i], fitted.largest_disc[surface.tree.original(i)]);
        }
    }
    return {std::move(surface), std::move(fitted)};
}

/// Noise of the cloud, which a tile is told, and another part of a cloud finds by itself.
FittedCloud CloudWork::without_noise(const LocalCloud& local, std::span<const Vector3d> points,
                                     std::span<const Vector3d> normals) {
    const ThinningGrid grid = thinning_grid(decided_.extent.centre, result_.spacing);
    const double radius = options_.sky ? 10 * result_.spacing : result_.radius;
    if (role_ == Role::part || role_ == Role::strays)
        return fitted_cloud(local, points, normals, radius, grid, decided_.noise_exceeds_spacing);
    const std::optional<SharedNoise> noise =
        whole_ ? whole_->noise
               : noise_at(noise_places(cloud_.points, valid_), local, normals, look_for_noise(radius, result_.spacing));
    decided_.noise_exceeds_spacing = noise && noise->exceeds_spacing;
    return noise ? fitted_cloud(local, points, normals, radius, *noise, grid) : FittedCloud();
}

/// Whether recorded normals are used.
bool CloudWork::recorded() const {
    return !cloud_.normals.empty() && options_.normals != CloudNormals::estimated && !normals_refused_;
}

void CloudWork::tell() {
    check_noise_left(fitted_, result_.findings);
    if (const auto told = told_noise(fitted_))
        result_.notes.push_back(*told);
    result_.notes.push_back(told_sides(sides_, recorded()));
    if (gpu_ && gpu_tiles_ > 0)
        result_.notes.push_back(fmt::format("neighbours, rays and means on {}.", gpu_->device_name()));
    if (gpu_ && gpu_tiles_ == 0)
        result_.notes.push_back(
            fmt::format("the cloud is too large for {}; the processor computed it.", gpu_->device_name()));
    if (!twins_.empty())
        result_.notes.push_back(
            fmt::format("{} points are at the coordinates of others: they count once.", twins_.size()));
    if (!strays_.empty())
        result_.notes.push_back(fmt::format("{} points lie more than {:.4g} from the middle of the cloud, far from all "
                                            "others: they are taken for strays and occlude nothing else.",
                                            strays_.size(), decided_.extent.farthest));
    std::size_t unknown = 0;
    for (const Indices* indices : {&valid_, &strays_})
        for (const std::uint32_t i : *indices)
            unknown += std::isnan(result_.visibility[i]);
    if (unknown > 0)
        result_.notes.push_back(fmt::format("{} of {} points have no surface round them; their visibility is unknown.",
                                            unknown, valid_.size() + strays_.size()));
}

} // namespace scanshade
