// The steps on a cloud that is never in memory as a whole. Where its points wait is the store's concern: the values of
// clouds in memory and of those on disk are equal, since nothing here depends on it.
#include "ao/cloud/large_cloud.h"

#include "ao/cloud/cloud_sample.h"
#include "ao/cloud/cloud_work.h"
#include "ao/cloud/repeatability.h"
#include "ao/cloud/tiles.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <thread>
#include <utility>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr float not_known = std::numeric_limits<float>::quiet_NaN();
constexpr std::size_t enough_for_sides = 300000;

/// A share of all hashes.
std::uint64_t hashes_below(double share) { return static_cast<std::uint64_t>(std::clamp(share, 0.0, 1.0) * 0x1p32); }

/// As bytes in text, exactly.
template <class Number>
void put(std::string& bytes, Number value) {
    const auto raw = std::bit_cast<std::array<char, sizeof(Number)>>(value);
    bytes.append(raw.data(), raw.size());
}
template <class Number>
Number take(std::string_view& bytes) {
    std::array<char, sizeof(Number)> raw{};
    if (bytes.size() < raw.size())
        throw Error("what was decided about the tiles is cut off");
    std::memcpy(raw.data(), bytes.data(), raw.size());
    bytes.remove_prefix(raw.size());
    return std::bit_cast<Number>(raw);
}

/// What the second pass found, as the store keeps it.
struct Sorted {
    std::optional<SharedNoise> noise;
    std::uint64_t valid = 0, strays = 0;

    [[nodiscard]] std::string text() const {
        std::string bytes;
        put(bytes, valid), put(bytes, strays);
        put(bytes, static_cast<std::uint8_t>(noise.has_value()));
        if (!noise)
            return bytes;
        put(bytes, static_cast<std::uint64_t>(noise->noise.sigmas().size()));
        for (const double along : noise->middle)
            put(bytes, along);
        put(bytes, static_cast<std::uint8_t>(noise->sides));
        put(bytes, static_cast<std::uint8_t>(noise->exceeds_spacing));
        for (std::size_t i = 0; i < noise->noise.sigmas().size(); ++i) {
            for (const float along : noise->noise.positions()[i])
                put(bytes, along);
            put(bytes, noise->noise.sigmas()[i]);
        }
        return bytes;
    }
    [[nodiscard]] static Sorted from(std::string_view bytes) {
        Sorted sorted;
        sorted.valid = take<std::uint64_t>(bytes), sorted.strays = take<std::uint64_t>(bytes);
        if (take<std::uint8_t>(bytes) == 0)
            return sorted;
        const auto count = take<std::uint64_t>(bytes);
        Vector3d middle;
        for (double& along : middle)
            along = take<double>(bytes);
        const bool sides = take<std::uint8_t>(bytes) != 0, exceeds_spacing = take<std::uint8_t>(bytes) != 0;
        std::vector<Vector3f> positions;
        std::vector<float> sigmas;
        for (std::uint64_t i = 0; i < count; ++i) {
            Vector3f position;
            for (float& along : position)
                along = take<float>(bytes);
            positions.push_back(position);
            sigmas.push_back(take<float>(bytes));
        }
        sorted.noise = {middle, CloudNoise(std::move(positions), std::move(sigmas)), sides, exceeds_spacing};
        return sorted;
    }
};

class LargeCloud {
  public:
    LargeCloud(const CloudSetup& setup, PointSource& source, TileStore& store, double shown,
               const std::function<bool()>& stop)
        : setup_(setup), source_(source), store_(store), shown_(shown, source.size()), stop_(stop),
          watch_(result_.timings), at_once_(points_at_once(setup)) {}

    PointVisibility run() {
        survey();
        sort_points();
        settle_sides();
        compute_tiles();
        if (store_.helps())
            return std::move(result_);
        check();
        tell();
        return std::move(result_);
    }

  private:
    /// The first pass: a sample, from which everything is decided that concerns all tiles.
    void survey() {
        CloudSample sample(enough_for_sides, source_.size());
        TwinLook twins;
        source_.pass([&](std::size_t first, std::span<const Vector3d> points, std::span<const Vector3d> normals) {
            for (std::size_t i = 0; i < points.size(); ++i)
                if (points[i].allFinite()) {
                    const Vector3f normal = normals.empty() ? Vector3f::Zero() : Vector3f(normals[i].cast<float>());
                    sample.add(static_cast<std::uint32_t>(first + i), points[i], normal);
                    twins.add(points[i]);
                }
            may_stop();
        });
        finite_ = sample.seen();
        whole_.twins = twins.many();
        distinct_ = whole_.twins ? twins.distinct() : 1;
        std::vector<CloudSample::Point> all = sample.by_number();
        const double share = static_cast<double>(sample.below()) * 0x1p-32; // by_number() has thinned it
        decide(all);
        CloudDecisions& decided = whole_.decisions;
        const auto beyond = [&](const CloudSample::Point& each) { return is_beyond(each.point); };
        const auto strays = std::ranges::count_if(all, beyond);
        const double within = all.empty() ? 0 : 1 - static_cast<double>(strays) / static_cast<double>(all.size());
        decided.points = within * distinct_ * static_cast<double>(finite_);
        std::erase_if(all, beyond);
        sample_ = std::move(all);
        std::vector<Vector3d> points;
        for (const CloudSample::Point& each : sample_)
            points.push_back(each.point);
        // Beyond the radius: planes of 64 neighbours, and whole boxes of what is thinned together.
        const double side = thinning_grid(decided.extent.centre, decided.spacing).side;
        const double beyond_radius = std::max(16 * decided.spacing, side + 4 * decided.spacing);
        plan_ = TilePlan(points, share, decided.radius + beyond_radius, at_once_);
        watch_.lap("survey");
    }

    [[nodiscard]] bool is_beyond(const Vector3d& point) const {
        const Extent& extent = whole_.decisions.extent;
        return (point - extent.centre).norm() > extent.farthest;
    }

    /// Extent, orientation, spacing and radius, from about as many points as judge a cloud at once.
    void decide(const std::vector<CloudSample::Point>& all) {
        const std::uint64_t chosen =
            hashes_below(static_cast<double>(enough_to_judge) / static_cast<double>(std::max<std::size_t>(finite_, 1)));
        std::vector<Vector3d> points, normals;
        for (const CloudSample::Point& each : all)
            if (each.hash < chosen) {
                points.push_back(each.point);
                if (source_.has_normals())
                    normals.push_back(each.normal.cast<double>());
            }
        const PointSet some{points, normals, {}, source_.z_up()};
        DecidedCloud decided = scanshade::decide(setup_, some, source_.scanner(), finite(some.points),
                                                 distinct_ * static_cast<double>(finite_));
        whole_.decisions = std::move(decided.decisions);
        result_.notes = std::move(decided.notes);
        result_.radius = whole_.decisions.radius;
        result_.spacing = whole_.decisions.spacing;
    }

    /// The second pass: points into the tiles that need them, strays apart, and some for the noise and the check.
    void sort_points() {
        const CloudDecisions& decided = whole_.decisions;
        check_ = thinned_check(static_cast<std::size_t>(decided.points), decided.radius / decided.spacing);
        if (check_.keep > 0) // what is checked is in memory at once
            check_.keep = std::min(check_.keep, 0.9 * static_cast<double>(at_once_) / decided.points);
        strays_tile_ = plan_.size(), check_tile_ = plan_.size() + 1;
        std::string plan = fmt::format("{:016x} {} {} {} {} {}\n", plan_.fingerprint(), source_.size(), finite_,
                                       source_.has_normals(), whole_.twins, check_.keep);
        for (const std::string& note : result_.notes)
            plan += note + "\n";
        std::string kept;
        if (store_.begin(plan, plan_.size() + 2, source_.has_normals(), plan_.copies() + std::max(check_.keep, 0.0),
                         kept)) {
            sorted_ = Sorted::from(kept);
        } else {
            sort_anew();
            store_.decide(sorted_.text());
        }
        whole_.noise = sorted_.noise;
        whole_.decisions.noise_exceeds_spacing = sorted_.noise && sorted_.noise->exceeds_spacing;
        watch_.lap("points into tiles");
    }

    void sort_anew() {
        const CloudDecisions& decided = whole_.decisions;
        NoisePlaces places(noise_places(), look_for_noise(decided.radius, decided.spacing));
        const std::uint64_t checked = hashes_below(check_.keep);
        const Vector3f none = Vector3f::Zero();
        source_.pass([&](std::size_t first, std::span<const Vector3d> points, std::span<const Vector3d> normals) {
            const bool with_normals = source_.has_normals() && !normals.empty();
            for (std::size_t i = 0; i < points.size(); ++i) {
                const Vector3d& point = points[i];
                if (!point.allFinite())
                    continue;
                const auto number = static_cast<std::uint32_t>(first + i);
                const Vector3f normal = with_normals ? Vector3f(normals[i].cast<float>()) : none;
                if (is_beyond(point)) {
                    ++sorted_.strays;
                    store_.add(strays_tile_, number, point, normal, true);
                    continue;
                }
                ++sorted_.valid;
                const Vector3d rounded = normal.cast<double>();
                places.add(number, point, with_normals ? &rounded : nullptr);
                if (hash(number, 1U) < checked)
                    store_.add(check_tile_, number, point, normal, true);
                plan_.for_each_tile(
                    point, [&](std::size_t tile, bool core) { store_.add(tile, number, point, normal, core); });
            }
            may_stop();
        });
        sorted_.noise = places.measured();
    }

    /// Those of noise_places() for a cloud in memory, whatever --cloud.memory is.
    [[nodiscard]] std::vector<NoisePlace> noise_places() const {
        std::vector<NoisePlace> places;
        std::vector<CloudSample::Point> lowest = sample_;
        std::ranges::sort(lowest, {}, [](const CloudSample::Point& each) { return std::pair(each.hash, each.number); });
        for (std::size_t k = 0; k < std::min(lowest.size(), NoisePlace::wanted); ++k)
            places.push_back({lowest[k].number, lowest[k].point});
        return places;
    }

    /// Of these points, where it is known.
    [[nodiscard]] std::vector<Vector3d> seen_from_of(const std::vector<std::uint32_t>& numbers) const {
        const std::span<const Vector3d> all = source_.seen_from();
        std::vector<Vector3d> some(all.empty() ? 0 : numbers.size());
        for (std::size_t k = 0; k < some.size(); ++k)
            some[k] = all[numbers[k]];
        return some;
    }

    /// On a sample of the whole; tiles follow.
    void settle_sides() {
        std::vector<Vector3d> points, normals;
        std::vector<std::uint32_t> numbers;
        for (const CloudSample::Point& each : sample_) {
            numbers.push_back(each.number);
            points.push_back(each.point);
            if (source_.has_normals())
                normals.push_back(each.normal.cast<double>());
        }
        sample_ = {};
        const std::vector<Vector3d> seen_from = seen_from_of(numbers);
        const PointSet some{points, normals, {}, source_.z_up(), false, seen_from};
        CloudWork work = CloudWork::of_part(setup_, some, source_.scanner(), whole_.decisions);
        whole_.sides = work.settle_sides();
        whole_.normals_refused = work.normals_refused();
        recorded_ =
            source_.has_normals() && setup_.options.normals != CloudNormals::estimated && !whole_.normals_refused;
        whole_.recorded_kept = recorded_ && work.sides().recorded_kept;
        if (whole_.normals_refused)
            result_.notes.push_back(work.notes().back());
        told_sides_ = told_sides(work.sides(), recorded_);
        std::ranges::copy(work.sides().findings, std::back_inserter(result_.findings));
        const NormalOrientation::Kind kind = work.sides().orientation.kind;
        by_sample_ = kind != NormalOrientation::Kind::viewpoint && kind != NormalOrientation::Kind::direction;
        watch_.lap("sides");
    }

    void compute_tiles() {
        std::vector<std::size_t> with_others;
        for (std::size_t tile = 0; tile < plan_.size() + 1; ++tile) {
            may_stop();
            if (store_.claim(tile))
                compute_tile(tile);
            else
                with_others.push_back(tile);
        }
        for (const std::size_t tile : store_.helps() ? std::vector<std::size_t>() : with_others) {
            while (!store_.claim(tile)) { // free at last, also where the other process died
                may_stop();
                std::this_thread::sleep_for(std::chrono::milliseconds(100));
            }
            compute_tile(tile);
        }
    }

    void compute_tile(std::size_t tile) {
        const std::optional<TileValues> known = store_.values(tile);
        TileValues values = known ? *known : tile < plan_.size() ? values_of(tile) : values_of_strays();
        count(tile, values);
        if (!known)
            store_.keep(tile, std::move(values));
        store_.release();
    }

    TileValues values_of(std::size_t tile) {
        const TilePoints round = store_.points(tile);
        TileValues values;
        values.round = round.numbers.size();
        if (std::ranges::none_of(round.in_core, [](char core) { return core != 0; }))
            return values;
        const std::vector<Vector3d> seen_from = seen_from_of(round.numbers);
        const PointSet set{round.points, round.normals, {}, source_.z_up(), false, seen_from};
        CloudWork work = CloudWork::of_tile(setup_, set, whole_);
        CloudWork::TileResult found = work.run_tile(round.in_core);
        collect(values, round, found.values);
        for (std::size_t k = 0; k < found.kept_signs.size(); ++k)
            if (round.in_core[k])
                values.kept_signs.push_back(found.kept_signs[k]);
        values.twins = found.twins;
        values.moved = found.fitted.moved;
        values.discs = found.fitted.kept;
        values.fitted_from = found.fitted.from;
        values.noise = found.fitted.noise;
        values.on_gpu = found.on_gpu;
        for (const auto& [name, ms] : found.values.timings)
            scanshade::add(result_.timings, name, ms);
        for (const std::string& note : found.values.notes) // of a device that failed
            result_.notes.push_back(note);
        return values;
    }

    TileValues values_of_strays() {
        TileValues values;
        values.checked = true;
        const TilePoints strays = store_.points(strays_tile_);
        const std::vector<Vector3d> seen_from = seen_from_of(strays.numbers);
        const PointSet set{strays.points, strays.normals, {}, false, false, seen_from};
        PointVisibility found;
        if (strays.numbers.size() >= CloudWork::fewest_strays)
            found =
                CloudWork::of_strays(setup_, set, source_.scanner(), whole_.decisions.radius, whole_.decisions.spacing);
        else
            found.visibility.assign(strays.numbers.size(), not_known),
                found.error.assign(strays.numbers.size(), not_known),
                found.normals.assign(strays.numbers.size(), Vector3f::Zero());
        collect(values, strays, found);
        return values;
    }

    /// The values of the core.
    void collect(TileValues& values, const TilePoints& round, const PointVisibility& found) const {
        for (std::size_t k = 0; k < round.numbers.size(); ++k) {
            if (!round.in_core[k])
                continue;
            if (shown_(round.numbers[k])) {
                values.shown.push_back(static_cast<std::uint32_t>(values.numbers.size()));
                values.normals.push_back(found.normals[k]);
            }
            values.numbers.push_back(round.numbers[k]);
            values.visibility.push_back(found.visibility[k]);
            values.error.push_back(found.error[k]);
        }
    }

    void count(std::size_t tile, const TileValues& values) {
        for (const float value : values.visibility)
            unknown_ += std::isnan(value);
        if (tile >= plan_.size())
            return;
        ++tiles_;
        gpu_tiles_ += values.on_gpu;
        twins_ += values.twins;
        largest_ = std::max(largest_, values.round);
        fitted_.noise = std::max(fitted_.noise, values.noise);
        fitted_.moved += values.moved;
        fitted_.kept += values.discs;
        fitted_.from += values.fitted_from;
    }

    /// Again with a part of the points: where that gives other values, these are not to be relied on.
    void check() {
        Watch watch(result_.timings); // tiles have counted their own time
        std::optional<CheckedPart> part;
        if (check_.keep > 0) {
            const TilePoints kept = store_.points(check_tile_);
            std::vector<float> whole(kept.numbers.size(), not_known);
            for (std::size_t tile = 0; tile < plan_.size(); ++tile) {
                const TileValues values = store_.values(tile).value_or(TileValues{});
                for (std::size_t k = 0; k < values.numbers.size(); ++k) {
                    const auto place = std::ranges::lower_bound(kept.numbers, values.numbers[k]);
                    if (place != kept.numbers.end() && *place == values.numbers[k])
                        whole[static_cast<std::size_t>(place - kept.numbers.begin())] = values.visibility[k];
                }
            }
            CloudAoOptions options = setup_.options;
            if (whole_.recorded_kept)
                options.normals = CloudNormals::recorded;
            const CloudSetup setup{options, nullptr, setup_.up, setup_.viewpoint};
            const std::vector<Vector3d> seen_from = seen_from_of(kept.numbers);
            const PointSet set{kept.points, kept.normals, {}, source_.z_up(), false, seen_from};
            CloudWork some = CloudWork::of_part(setup, set, source_.scanner(), whole_.decisions);
            const PointVisibility thinned = some.run();
            part.emplace(kept.points, whole, thinned.visibility, check_);
        }
        ErrorSum sum;
        for (std::size_t tile = 0; tile < plan_.size() + 1; ++tile) { // strays are the last one
            may_stop();
            TileValues values = store_.values(tile).value_or(TileValues{});
            if (part && !values.checked) {
                const TilePoints round = store_.points(tile);
                std::vector<Vector3d> core;
                for (std::size_t k = 0; k < round.numbers.size(); ++k)
                    if (round.in_core[k])
                        core.push_back(round.points[k]);
                const std::vector<float> repeated = part->errors(core, values.visibility);
                for (std::size_t k = 0; k < values.error.size(); ++k)
                    if (!std::isnan(values.visibility[k]))
                        values.error[k] = error_once_checked(values.error[k], values.visibility[k],
                                                             values.kept_signs[k], repeated[k]);
            }
            for (const float error : values.error)
                sum.add(error);
            if (std::exchange(values.checked, true))
                continue;
            store_.keep(tile, std::move(values));
        }
        result_.expected_error = sum.rms();
        if (result_.expected_error) {
            const ToldError told = told_error(*result_.expected_error, part ? part->error() : 0);
            told_error_ = told.note;
            result_.findings.push_back(told.by_part);
        }
        watch.lap("check on a part");
    }

    void tell() {
        result_.tiles = static_cast<int>(tiles_);
        if (const auto told = told_noise(fitted_))
            result_.notes.push_back(*told);
        result_.notes.push_back(told_sides_);
        if (tiles_ > 1)
            result_.notes.push_back(fmt::format(
                "in {} tiles of at most {} points each{}.", tiles_, largest_,
                by_sample_ ? fmt::format("; sides were settled on {} points of the whole", whole_.sides->surface.size())
                           : ""));
        if (setup_.device && gpu_tiles_ > 0)
            result_.notes.push_back(
                fmt::format("neighbours, rays and means on {}.", CloudGpu(*setup_.device).device_name()));
        if (setup_.device && gpu_tiles_ < tiles_)
            result_.notes.push_back(fmt::format("{} of {} tiles were too large for {}; the processor computed them.",
                                                tiles_ - gpu_tiles_, tiles_, CloudGpu(*setup_.device).device_name()));
        if (twins_ > 0)
            result_.notes.push_back(
                fmt::format("{} points are at the coordinates of others: they count once.", twins_));
        if (sorted_.strays > 0)
            result_.notes.push_back(
                fmt::format("{} points lie more than {:.4g} from the middle of the cloud, far from all others: they "
                            "are taken for strays and occlude nothing else.",
                            sorted_.strays, whole_.decisions.extent.farthest));
        if (unknown_ > 0)
            result_.notes.push_back(
                fmt::format("{} of {} points have no surface round them; their visibility is unknown.", unknown_,
                            sorted_.valid + sorted_.strays));
        if (!told_error_.empty())
            result_.notes.push_back(told_error_);
    }

    void may_stop() const {
        if (stop_ && stop_())
            throw Outage("interrupted");
    }

    const CloudSetup& setup_;
    PointSource& source_;
    TileStore& store_;
    ShownPoints shown_;
    const std::function<bool()>& stop_;
    PointVisibility result_;
    Watch watch_;
    std::size_t at_once_, finite_ = 0;
    double distinct_ = 1;                    ///< positions / points
    std::vector<CloudSample::Point> sample_; ///< without strays
    OfWhole whole_;
    TilePlan plan_;
    Sorted sorted_;
    ThinnedCheck check_;
    std::size_t strays_tile_ = 0, check_tile_ = 0;
    bool recorded_ = false, by_sample_ = false;
    std::string told_sides_, told_error_;
    std::uint64_t largest_ = 0, twins_ = 0, unknown_ = 0, tiles_ = 0, gpu_tiles_ = 0;
    FittedCounts fitted_;
};

/// A cloud in memory.
class PointsInMemory final : public PointSource {
  public:
    PointsInMemory(const PointSet& cloud, const std::optional<Vector3d>& scanner) : cloud_(cloud), scanner_(scanner) {}
    [[nodiscard]] std::size_t size() const override { return cloud_.points.size(); }
    void pass(const Visit& visit) override { visit(0, cloud_.points, cloud_.normals); }
    [[nodiscard]] bool has_normals() const override { return !cloud_.normals.empty(); }
    [[nodiscard]] bool z_up() const override { return cloud_.z_up; }
    [[nodiscard]] std::optional<Vector3d> scanner() const override { return scanner_; }
    [[nodiscard]] std::span<const Vector3d> seen_from() const override { return cloud_.seen_from; }

  private:
    const PointSet& cloud_;
    std::optional<Vector3d> scanner_;
};

/// Tiles of a cloud in memory, by number.
class TilesInMemory final : public TileStore {
  public:
    explicit TilesInMemory(const PointSet& cloud) : cloud_(cloud) {
        result.visibility.assign(cloud.points.size(), not_known);
        result.error.assign(cloud.points.size(), not_known);
        result.normals.assign(cloud.points.size(), Vector3f::Zero());
    }
    bool begin(const std::string&, std::size_t tiles, bool, double, std::string&) override {
        numbers_.resize(tiles);
        values_.resize(tiles);
        return false;
    }
    void add(std::size_t tile, std::uint32_t number, const Vector3d&, const Vector3f&, bool core) override {
        numbers_[tile].push_back(core ? number : number | in_rim);
    }
    void decide(const std::string&) override {}
    [[nodiscard]] std::size_t count(std::size_t tile) const override { return numbers_[tile].size(); }
    [[nodiscard]] TilePoints points(std::size_t tile) override {
        TilePoints all;
        for (const std::uint32_t each : numbers_[tile]) {
            const std::uint32_t number = each & ~in_rim;
            all.numbers.push_back(number);
            all.in_core.push_back(each == number);
            all.points.push_back(cloud_.points[number]);
            if (!cloud_.normals.empty())
                all.normals.push_back(Vector3f(cloud_.normals[number].cast<float>()).cast<double>());
        }
        return all;
    }
    /// Made again from the whole; there is no earlier run.
    [[nodiscard]] std::optional<TileValues> values(std::size_t tile) override {
        if (!values_[tile])
            return std::nullopt;
        TileValues values = *values_[tile];
        for (const std::uint32_t each : numbers_[tile]) {
            if (each & in_rim)
                continue;
            values.numbers.push_back(each);
            values.visibility.push_back(result.visibility[each]);
            values.error.push_back(result.error[each]);
        }
        return values;
    }
    void keep(std::size_t tile, TileValues values) override {
        for (std::size_t k = 0; k < values.numbers.size(); ++k) {
            result.visibility[values.numbers[k]] = values.visibility[k];
            result.error[values.numbers[k]] = values.error[k];
        }
        for (std::size_t k = 0; k < values.shown.size(); ++k)
            result.normals[values.numbers[values.shown[k]]] = values.normals[k];
        for (auto* list : {&values.numbers, &values.shown})
            *list = {};
        values.visibility = values.error = {};
        values.normals = {};
        values_[tile] = std::move(values);
    }

    PointVisibility result;

  private:
    static constexpr std::uint32_t in_rim = 0x80000000U; ///< readers have fewer points
    const PointSet& cloud_;
    std::vector<std::vector<std::uint32_t>> numbers_;
    std::vector<std::optional<TileValues>> values_; ///< without what `result` has
};

} // namespace

ShownPoints::ShownPoints(double wanted, std::size_t all)
    : below_(hashes_below(wanted / static_cast<double>(std::max<std::size_t>(all, 1)))) {}

bool ShownPoints::operator()(std::uint32_t number) const { return hash(number, 2U) < below_; }

PointVisibility compute_large(const CloudSetup& setup, PointSource& source, TileStore& store, double shown,
                              const std::function<bool()>& stop) {
    return LargeCloud(setup, source, store, shown, stop).run();
}

PointVisibility in_tiles(const CloudSetup& setup, const PointSet& cloud, const std::optional<Vector3d>& scanner) {
    PointsInMemory source(cloud, scanner);
    TilesInMemory store(cloud);
    PointVisibility told = compute_large(setup, source, store, static_cast<double>(cloud.points.size()));
    told.visibility = std::move(store.result.visibility);
    told.error = std::move(store.result.error);
    told.normals = std::move(store.result.normals);
    return told;
}

} // namespace scanshade
