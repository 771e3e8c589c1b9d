// The devices of a run, and a method for each frame that is computed at once.
#pragma once

#include "ao/frame.h"
#include "ao/gpu/device.h"
#include "apps/frame/method_pool.h"
#include "apps/method_settings.h"

#include <memory>
#include <string>
#include <vector>

namespace scanshade {

/// While one frame's passes run, the next one is packed and the one before unpacked: with one at a time, a GPU mostly
/// waits for the host. Processor cores have no such gaps, and each frame in flight takes memory.
class Workers {
  public:
    /// Devices that several Workers may share; they live as long as any of these.
    using Devices = std::shared_ptr<const std::vector<std::unique_ptr<gpu::Device>>>;

    /// Opens the devices that `choice` names (gpu::open_devices()); `in_flight` frames on each, 0 = three on a GPU, one
    /// on the processor's own cores.
    Workers(const std::string& choice, int in_flight)
        : Workers(std::make_shared<const std::vector<std::unique_ptr<gpu::Device>>>(gpu::open_devices(choice)),
                  in_flight) {}
    /// The same on devices that are open already; at least one.
    Workers(Devices devices, int in_flight);
    ~Workers();

    /// The device for work that computes one frame at a time.
    [[nodiscard]] gpu::Device& device() { return *devices_->front(); }
    /// Methods of these settings, made once for all captures that ask for the same: shaders are compiled then. Captures
    /// that are computed side by side may have settings of their own. A method that uses all cores by itself exists
    /// once.
    [[nodiscard]] std::shared_ptr<MethodPool> pool_of(const std::string& method, MethodSetup& setup,
                                                      const FitPlaneOptions& preparation);

    /// "NVIDIA H100 (NVIDIA 550.54)", "2 x NVIDIA ..., 6 frames at once"
    [[nodiscard]] std::string description(const MethodPool& pool) const;
    [[nodiscard]] std::size_t devices() const { return devices_->size(); }

  private:
    struct Made; ///< methods, and what they were made from

    Devices devices_; ///< outlive what is made on them
    std::size_t in_flight_;
    std::vector<std::shared_ptr<Made>> made_; ///< the last few; the last used is the last
};

} // namespace scanshade
