// The devices of a run, and a method for each frame that is computed at once.
#include "apps/session/workers.h"

#include <algorithm>
#include <fmt/format.h>
#include <optional>
#include <utility>

namespace scanshade {

Workers::Workers(Devices devices, int in_flight) : devices_(std::move(devices)) {
    constexpr std::size_t of_a_gpu = 3;
    in_flight_ = in_flight > 0 ? static_cast<std::size_t>(in_flight) : gpu::is_cpu(device().info()) ? 1 : of_a_gpu;
}

Workers::~Workers() = default;

struct Workers::Made {
    Configuration configuration;
    FitPlaneOptions preparation;
    std::vector<std::unique_ptr<FrameAo>> methods;
    std::optional<MethodPool> pool;
};

std::shared_ptr<MethodPool> Workers::pool_of(const std::string& method, MethodSetup& setup,
                                             const FitPlaneOptions& preparation) {
    const auto pool_in = [](const std::shared_ptr<Made>& made) {
        return std::shared_ptr<MethodPool>(made, &*made->pool);
    };
    Configuration wanted{method, "", values_of(setup)};
    const auto known = std::ranges::find_if(made_, [&](const auto& made) {
        return wanted.method == made->configuration.method && wanted.settings == made->configuration.settings &&
               preparation == made->preparation;
    });
    if (known != made_.end()) {
        std::rotate(known, known + 1, made_.end());
        return pool_in(made_.back());
    }
    constexpr std::size_t most = 2; // device memory is theirs; captures at work keep those that they use
    if (made_.size() == most)
        made_.erase(made_.begin());
    const auto made = std::make_shared<Made>();
    made->configuration = std::move(wanted);
    made->preparation = preparation;
    const bool keeps_cores_busy = setup.make_for_points() != nullptr;
    const std::size_t count = keeps_cores_busy ? 1 : in_flight_ * devices_->size();
    std::vector<std::shared_ptr<Finishers>> finishers;
    for (const auto& device : *devices_)
        finishers.push_back(std::make_shared<Finishers>(*device));
    std::vector<FrameAo*> methods;
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t device = i % devices_->size();
        made->methods.push_back(std::make_unique<FrameAo>(*(*devices_)[device], method_named(method), setup,
                                                          preparation, finishers[device]));
        methods.push_back(made->methods.back().get());
    }
    made->pool.emplace(methods);
    made_.push_back(made);
    return pool_in(made);
}

std::string Workers::description(const MethodPool& pool) const {
    const gpu::DeviceInfo& info = devices_->front()->info();
    const std::string one = fmt::format("{} ({})", info.name, info.driver);
    const std::string all = devices_->size() > 1 ? fmt::format("{} x {}", devices_->size(), one) : one;
    return pool.size() > 1 ? fmt::format("{}, {} frames at once", all, pool.size()) : all;
}

} // namespace scanshade
