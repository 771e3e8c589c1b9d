#include "ao/sequence/sequence.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace scanshade {

std::vector<Parameter> SequenceOptions::parameters() {
    return {{"layers", "other views whose surfaces occlude what a frame shows; 0 = none", &layers, "", 0, 32},
            {"reach", "how many frames away they may be", &reach, "frames", 1, 1000}};
}

Sequence::Sequence(gpu::Device& device, Method& method, const DepthNoise& noise, const FitPlaneOptions& fit,
                   const SequenceOptions& options)
    : method_(method), options_(options), noise_(noise), pack_(device) {
    if (noise.any())
        fit_.emplace(device, noise, fit);
}

void Sequence::add(std::size_t place, const DepthImage& depth, const std::optional<Eigen::Isometry3d>& world_from_camera) {
    slots_[place] = {depth, world_from_camera, {}, {}};
}

void Sequence::forget_before(std::size_t place) { slots_.erase(slots_.begin(), slots_.lower_bound(place)); }

View Sequence::view_of(Slot& slot) {
    if (!fit_)
        return {slot.depth};
    if (!slot.fitted) {
        slot.fitted = fit_->compute(slot.depth);
        account("prepare", fit_->timings());
    }
    const bool planes = !slot.fitted->normals.normals.empty();
    return {slot.fitted->depth, planes ? &slot.fitted->normals : nullptr, noise_, planes};
}

const PackedSurfaces& Sequence::packed(Slot& slot) {
    if (!slot.packed) {
        slot.packed = pack_.compute(view_of(slot));
        account("pack", pack_.timings());
    }
    return *slot.packed;
}

std::vector<std::size_t> Sequence::neighbours_of(std::size_t place) const {
    std::vector<std::size_t> chosen;
    const int sides = options_.layers / 2;
    for (int i = 1; i <= sides; ++i) {
        const auto step = static_cast<std::size_t>(std::lround(static_cast<double>(options_.reach) * i / sides));
        for (const std::size_t other : {place - step, place + step})
            if (slots_.contains(other) && slots_.at(other).world_from_camera)
                chosen.push_back(other);
    }
    return chosen;
}

void Sequence::account(std::string_view step, const Timings& timings) {
    double sum = 0;
    for (const auto& [name, ms] : timings)
        sum += ms;
    timings_.emplace_back(step, sum);
}

SequenceResult Sequence::compute(std::size_t place) {
    Slot& slot = slots_.at(place);
    View view = view_of(slot);
    SequenceResult result;
    std::vector<Neighbour> neighbours;
    if (slot.world_from_camera) {
        result.neighbours = neighbours_of(place);
        const Eigen::Isometry3d here_from_world = slot.world_from_camera->inverse();
        for (const std::size_t other : result.neighbours) {
            Slot& there = slots_.at(other);
            neighbours.push_back({&packed(there), here_from_world * *there.world_from_camera});
        }
    }
    view.neighbours = neighbours;
    result.ao = method_.compute(view);
    timings_.insert(timings_.end(), method_.timings().begin(), method_.timings().end());
    result.timings = std::move(timings_);
    timings_.clear();
    return result;
}

} // namespace scanshade
