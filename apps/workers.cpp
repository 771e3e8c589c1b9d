// The devices of a run, and what computes frames on them: as many methods, made alike, as frames are computed at once.
#include "apps/workers.h"

#include <fmt/format.h>

namespace scanshade {

Workers::Workers(const std::string& choice, int in_flight) : devices_(gpu::open_devices(choice)) {
    constexpr std::size_t of_a_gpu = 3;
    in_flight_ = in_flight > 0 ? static_cast<std::size_t>(in_flight) : gpu::is_cpu(device().info()) ? 1 : of_a_gpu;
}

void Workers::make(const std::string& method, MethodSetup& setup) {
    const Configuration wanted{method, "", values_of(setup)};
    if (!made_.empty() && wanted.method == configuration_.method && wanted.settings == configuration_.settings)
        return;
    made_.clear();
    made_.push_back({&device(), setup.make(device()), nullptr});
    const bool rays = dynamic_cast<PointMethod*>(&plain()) != nullptr; // keep all cores busy already
    for (std::size_t i = 1; !rays && i < in_flight_ * devices_.size(); ++i) {
        gpu::Device& next = *devices_[i % devices_.size()];
        made_.push_back({&next, setup.make(next), nullptr});
    }
    configuration_ = wanted;
}

std::vector<Method*> Workers::methods(const DepthNoise& noise, const FitPlaneOptions& fit) {
    std::vector<Method*> all;
    for (auto& [device, plain, fitted] : made_) {
        fitted = noise.any() ? std::make_unique<OnFittedDepth>(*device, noise, *plain, fit) : nullptr;
        all.push_back(fitted ? static_cast<Method*>(fitted.get()) : plain.get());
    }
    return all;
}

std::string Workers::description() const {
    const gpu::DeviceInfo& info = devices_.front()->info();
    const std::string one = fmt::format("{} ({})", info.name, info.driver);
    const std::string all = devices_.size() > 1 ? fmt::format("{} x {}", devices_.size(), one) : one;
    return made_.size() > 1 ? fmt::format("{}, {} frames at once", all, made_.size()) : all;
}

} // namespace scanshade
