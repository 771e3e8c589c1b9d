// The devices of a run, and what computes frames on them: as many methods, made alike, as frames are computed at once.
#include "apps/run/workers.h"

#include <algorithm>
#include <fmt/format.h>

namespace scanshade {

Workers::Workers(const std::string& choice, int in_flight) : devices_(gpu::open_devices(choice)) {
    constexpr std::size_t of_a_gpu = 3;
    in_flight_ = in_flight > 0 ? static_cast<std::size_t>(in_flight) : gpu::is_cpu(device().info()) ? 1 : of_a_gpu;
}

void Workers::make(const std::string& method, MethodSetup& setup, const FitPlaneOptions& fit) {
    const Configuration wanted{method, "", values_of(setup)};
    if (crew_ && wanted.method == configuration_.method && wanted.settings == configuration_.settings && fit == fit_)
        return;
    crew_.reset();
    made_.clear();
    const auto add = [&](gpu::Device& device) {
        Worker worker{&device, setup.make(device), nullptr};
        worker.method = std::make_unique<OnFittedDepth>(device, *worker.plain, fit);
        made_.push_back(std::move(worker));
    };
    add(device());
    const bool rays = dynamic_cast<PointMethod*>(any().plain.get()) != nullptr; // keep all cores busy already
    for (std::size_t i = 1; !rays && i < in_flight_ * devices_.size(); ++i)
        add(*devices_[i % devices_.size()]);
    std::vector<Method*> methods;
    for (const Worker& worker : made_)
        methods.push_back(worker.method.get());
    crew_ = std::make_unique<Crew>(methods);
    configuration_ = wanted;
    fit_ = fit;
}

const Workers::Worker& Workers::who_is(const Method& lent) const {
    return *std::ranges::find(made_, &lent, [](const Worker& worker) -> const Method* { return worker.method.get(); });
}

std::string Workers::description() const {
    const gpu::DeviceInfo& info = devices_.front()->info();
    const std::string one = fmt::format("{} ({})", info.name, info.driver);
    const std::string all = devices_.size() > 1 ? fmt::format("{} x {}", devices_.size(), one) : one;
    return made_.size() > 1 ? fmt::format("{}, {} frames at once", all, made_.size()) : all;
}

} // namespace scanshade
