// The devices of a run, and a method for each frame that is computed at once.
#include "apps/run/workers.h"

#include <algorithm>
#include <fmt/format.h>
#include <utility>

namespace scanshade {

Workers::Workers(Devices devices, int in_flight) : devices_(std::move(devices)) {
    constexpr std::size_t of_a_gpu = 3;
    in_flight_ = in_flight > 0 ? static_cast<std::size_t>(in_flight) : gpu::is_cpu(device().info()) ? 1 : of_a_gpu;
}

void Workers::make(const std::string& method, MethodSetup& setup, const FitPlaneOptions& preparation) {
    const Configuration wanted{method, "", values_of(setup)};
    if (pool_ && wanted.method == configuration_.method && wanted.settings == configuration_.settings &&
        preparation == preparation_)
        return;
    pool_.reset();
    made_.clear();
    const bool keeps_cores_busy = setup.make_for_points() != nullptr;
    const std::size_t count = keeps_cores_busy ? 1 : in_flight_ * devices_->size();
    std::vector<std::shared_ptr<Finishers>> finishers;
    for (const auto& device : *devices_)
        finishers.push_back(std::make_shared<Finishers>(*device));
    std::vector<FrameAo*> methods;
    for (std::size_t i = 0; i < count; ++i) {
        const std::size_t device = i % devices_->size();
        made_.push_back(std::make_unique<FrameAo>(*(*devices_)[device], method_named(method), setup, preparation,
                                                  finishers[device]));
        methods.push_back(made_.back().get());
    }
    pool_ = std::make_unique<MethodPool>(methods);
    configuration_ = wanted;
    preparation_ = preparation;
}

std::string Workers::description() const {
    const gpu::DeviceInfo& info = devices_->front()->info();
    const std::string one = fmt::format("{} ({})", info.name, info.driver);
    const std::string all = devices_->size() > 1 ? fmt::format("{} x {}", devices_->size(), one) : one;
    return made_.size() > 1 ? fmt::format("{}, {} frames at once", all, made_.size()) : all;
}

} // namespace scanshade
