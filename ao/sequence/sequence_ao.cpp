#include "ao/sequence/sequence_ao.h"

#include "projection/base/statistics.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <limits>
#include <set>
#include <tbb/parallel_for_each.h>
#include <tbb/task_arena.h>

namespace scanshade {

namespace {

using Eigen::Isometry3d;

/// Of what an alignment leaves open, how much counts as alignment_error: most of it slides surfaces along themselves.
constexpr double slides = 0.25;

} // namespace

std::vector<Parameter> SequenceAoOptions::parameters() {
    return {{"fuse", "frames around each that noisy depth is averaged with; 0 = none", &fuse, "", 0, 16},
            {"layers", "other views whose surfaces occlude what a frame shows (surfel, vxao); 0 = none", &layers, "", 0,
             16},
            {"reach",
             "how many frames away those may be; 0 = so many as the camera takes to move by the radius, 4 to 30",
             &reach, "frames", 0, 1000},
            {"average", "frames around each whose visibility is averaged with its own; 0 = none", &average, "", 0, 64}};
}

SequenceAo::SequenceAo(gpu::Device& device, Method& method, double radius_m, const DepthNoise& noise,
                       const FitPlaneOptions& fit, const SequenceAoOptions& options)
    : method_(method), options_(options), noise_(noise), pack_(device), upload_(device), gather_(device),
      radius_m_(radius_m) {
    if (!method.looks_at_neighbours())
        options_.layers = 0;
    if (!noise.any())
        options_.fuse = 0;
    if (!noise.needs_preparation())
        return;
    FitPlaneOptions only_drop = fit, after_drop = fit;
    only_drop.smoothing = 0;
    after_drop.drop_flying = false;
    drop_flying_.emplace(device, noise, only_drop);
    fit_.emplace(device, noise, after_drop);
}

int reach_for(std::span<const std::optional<Isometry3d>> world_from_camera, double radius_m) {
    constexpr int least = 4, most = 30;
    for (int step = least; step < most; ++step) {
        std::vector<double> moved;
        for (std::size_t i = static_cast<std::size_t>(step); i < world_from_camera.size(); ++i)
            if (const auto& before = world_from_camera[i - static_cast<std::size_t>(step)],
                &after = world_from_camera[i];
                before && after)
                moved.push_back((after->translation() - before->translation()).norm());
        if (moved.empty())
            break;
        if (median(std::move(moved)) >= radius_m)
            return step;
    }
    return most;
}

void SequenceAo::add(std::size_t index, const DepthImage& depth,
                     const std::optional<Eigen::Isometry3d>& world_from_camera) {
    Slot& slot = slots_[index];
    slot.depth = depth;
    slot.world_from_camera = world_from_camera;
}

void SequenceAo::forget_before(std::size_t index) { slots_.erase(slots_.begin(), slots_.lower_bound(index)); }

const DepthImage& SequenceAo::kept(Slot& slot) {
    if (!slot.kept) {
        slot.kept = drop_flying_->compute(slot.depth).depth;
        account("flying pixels", drop_flying_->timings());
    }
    return *slot.kept;
}

const Facets& SequenceAo::facets(Slot& slot) {
    if (!slot.facets) {
        const DepthImage& depth = fit_ ? kept(slot) : slot.depth;
        const Stopwatch stopwatch;
        tbb::this_task_arena::isolate([&] { slot.facets = facets_of(depth, noise_); });
        timings_.emplace_back("facets", stopwatch.ms());
    }
    return *slot.facets;
}

View SequenceAo::view_of(std::size_t index) {
    Slot& slot = slots_.at(index);
    if (!fit_)
        return {slot.depth};
    if (!slot.fitted) {
        std::vector<OtherDepth> others;
        for (const Fitting& other : adjacent_views(index, options_.fuse)) {
            Slot& there = slots_.at(other.index);
            if (!there.kept_there)
                there.kept_there = upload_(kept(there).z_m);
            others.push_back({there.depth.camera, there.kept_there, other.here_from_there});
            slot.fused.push_back(other.index);
        }
        slot.fitted = fit_->compute(kept(slot), others);
        account("prepare", fit_->timings());
    }
    const bool planes = !slot.fitted->normals.normals.empty();
    return {{slot.fitted->depth, slot.fitted->normals}, noise_, planes};
}

/// A frame's normals are asked for twice: to pack them, and to look from them.
void SequenceAo::let_go(Slot& slot) {
    if (slot.fitted && slot.packed && slot.ao)
        slot.fitted->normals = {};
}

const PackedSurfaces& SequenceAo::packed(std::size_t index) {
    Slot& slot = slots_.at(index);
    if (!slot.packed) {
        slot.packed = pack_.compute(view_of(index));
        account("pack", pack_.timings());
        let_go(slot);
    }
    return *slot.packed;
}

/// From the earlier one's side, whichever asks: results must not hang on the order of questions.
SequenceAo::PairRegistration SequenceAo::registered(const Slot& earlier, const Slot& later) const {
    const Pair pair{*earlier.facets, *later.facets, radius_m_, noise_}, back{pair.there, pair.here, radius_m_, noise_};
    const Isometry3d recorded = earlier.world_from_camera->inverse() * *later.world_from_camera;
    const auto [pose, sigma_m] = aligned(pair, recorded);
    // Each must agree with the other: what one has looked through tells nothing of what is hidden from it.
    const Agreement there = agreement(pair, pose), here = agreement(back, pose.inverse());
    return {{std::min(there.overlap, here.overlap), std::max(there.contradicted, here.contradicted),
             std::max({there.alignment_error_m, here.alignment_error_m, slides * sigma_m}),
             std::max(there.alignment_error, here.alignment_error)},
            pose};
}

void SequenceAo::register_with(std::size_t index, std::span<const std::size_t> others) {
    struct Task {
        const Slot *earlier, *later;
        PairRegistration* registration;
    };
    std::vector<Task> tasks;
    for (const std::size_t other : others) {
        const auto there = slots_.find(other);
        if (there == slots_.end() || !there->second.world_from_camera || !slots_.at(index).world_from_camera)
            continue;
        Slot &earlier = slots_.at(std::min(index, other)), &later = slots_.at(std::max(index, other));
        const auto [known, is_new] = earlier.registrations.try_emplace(std::max(index, other));
        if (!is_new)
            continue;
        (void)facets(earlier);
        (void)facets(later);
        tasks.push_back({&earlier, &later, &known->second});
    }
    if (tasks.empty())
        return;
    const Stopwatch stopwatch;
    tbb::this_task_arena::isolate([&] { // no other frame is begun while this one waits
        tbb::parallel_for_each(tasks,
                               [&](const Task& task) { *task.registration = registered(*task.earlier, *task.later); });
    });
    timings_.emplace_back("align", stopwatch.ms());
}

std::optional<SequenceAo::Fitting> SequenceAo::fitting(std::size_t here, std::size_t there) {
    const auto own = slots_.find(here), other = slots_.find(there);
    if (other == slots_.end() || !own->second.world_from_camera || !other->second.world_from_camera)
        return std::nullopt;
    if (other->second.depth.camera.size != own->second.depth.camera.size) // averages need the same pixels
        return std::nullopt;
    register_with(here, {&there, 1});
    const PairRegistration& met = slots_.at(std::min(here, there)).registrations.at(std::max(here, there));
    if (met.agreement.fits())
        return Fitting{there, here < there ? met.earlier_from_later : met.earlier_from_later.inverse(),
                       met.agreement.alignment_error_m};
    std::vector<LeftOut>& left_out = own->second.left_out;
    if (std::ranges::none_of(left_out, [&](const LeftOut& each) { return each.index == there; }))
        left_out.push_back({there, met.agreement});
    return std::nullopt;
}

/// As far away as they may be, and evenly between: near views see little that this one does not. Where the recording
/// ends, or a frame does not fit, the next nearer one, and more from the other side.
std::vector<SequenceAo::Fitting> SequenceAo::spread_views(std::size_t index) {
    std::vector<Fitting> chosen;
    const int sides = (options_.layers + 1) / 2;
    const auto try_frame = [&](std::size_t other) {
        const bool had = std::ranges::any_of(chosen, [&](const Fitting& each) { return each.index == other; });
        if (had || static_cast<int>(chosen.size()) == options_.layers)
            return had;
        const auto fits = fitting(index, other);
        if (fits)
            chosen.push_back(*fits);
        return fits.has_value();
    };
    const auto ring = [&](int i) { return cvRound(static_cast<double>(options_.reach) * i / sides); };
    std::vector<std::size_t> first_choice;
    for (int i = sides; i >= 1; --i)
        for (const int side : {-1, 1})
            first_choice.push_back(index + static_cast<std::size_t>(side * ring(i)));
    register_with(index, first_choice);
    for (int i = sides; i >= 1; --i)
        for (const int side : {-1, 1})
            for (int step = ring(i); step > ring(i - 1) && !try_frame(index + static_cast<std::size_t>(side * step));
                 --step) {
            }
    return chosen;
}

/// The nearest ones on either side.
std::vector<SequenceAo::Fitting> SequenceAo::adjacent_views(std::size_t index, int count) {
    std::vector<Fitting> chosen;
    std::vector<std::size_t> candidates;
    for (int step = 1; step <= (count + 1) / 2; ++step) {
        candidates.push_back(index - static_cast<std::size_t>(step));
        candidates.push_back(index + static_cast<std::size_t>(step));
    }
    register_with(index, candidates);
    for (const std::size_t other : candidates)
        if (const auto fits = fitting(index, other))
            chosen.push_back(*fits);
    return chosen;
}

void SequenceAo::account(std::string_view step, const Timings& timings) {
    double sum = 0;
    for (const auto& [name, ms] : timings)
        sum += ms;
    timings_.emplace_back(step, sum);
}

const AoMap& SequenceAo::visibility(std::size_t index) {
    Slot& slot = slots_.at(index);
    if (slot.ao)
        return *slot.ao;
    View view = view_of(index);
    std::vector<Neighbour> neighbours;
    for (const Fitting& other : spread_views(index)) {
        neighbours.push_back({&packed(other.index), other.here_from_there, other.alignment_error_m});
        slot.neighbours.push_back(other.index);
    }
    view.neighbours = neighbours;
    view.instant = options_.average > 0 ? static_cast<int>(index % 65536) : 0; // so that what is averaged differs
    slot.ao = method_.compute(view);
    if (!slot.fused.empty())
        slot.ao->visibility.setTo(std::numeric_limits<float>::quiet_NaN(), holes(slot));
    slot.remarks = method_.remarks();
    let_go(slot);
    timings_.insert(timings_.end(), method_.timings().begin(), method_.timings().end());
    return *slot.ao;
}

Seen SequenceAo::seen(std::size_t index) {
    const AoMap& ao = visibility(index);
    Slot& slot = slots_.at(index);
    if (!slot.ao_there)
        slot.ao_there = upload_(ao.visibility);
    return {&packed(index), slot.ao_there};
}

std::size_t SequenceAoResult::others() const {
    std::set<std::size_t> all(fused.begin(), fused.end());
    all.insert(neighbours.begin(), neighbours.end());
    all.insert(averaged.begin(), averaged.end());
    return all.size();
}

double share_of_gain(std::size_t others) {
    const auto n = static_cast<double>(others);
    return std::min(1.0, 7.0 / 6.0 * n / (n + 2));
}

SequenceAoResult SequenceAo::compute(std::size_t index) {
    SequenceAoResult result;
    result.ao = visibility(index);
    std::vector<Seen> others;
    for (const Fitting& other : adjacent_views(index, options_.average)) {
        others.push_back(seen(other.index));
        others.back().here_from_there = other.here_from_there;
        result.averaged.push_back(other.index);
    }
    if (!others.empty()) {
        result.ao = gather_.compute(seen(index), others, {radius_m_, noise_});
        account("average", gather_.timings());
    }
    averaged_ = !others.empty();
    Slot& slot = slots_.at(index);
    result.depth = fit_ ? slot.fitted->depth : slot.depth;
    if (!slot.fused.empty()) {
        result.depth.z_m = result.depth.z_m.clone();
        result.depth.z_m.setTo(0, holes(slot));
    }
    result.fused = slot.fused;
    result.neighbours = slot.neighbours;
    result.left_out = slot.left_out;
    result.remarks = slot.remarks;
    result.timings = std::move(timings_);
    timings_.clear();
    return result;
}

} // namespace scanshade
