// Bytes that stay on the device from run to run, whichever program made them or takes them.
#pragma once

#include "ao/gpu/device.h"

#include <cstddef>
#include <memory>
#include <vector>

namespace scanshade::gpu {

/// Program::give() fills them, Program::take() reads them. Not thread-safe, as programs are.
class DeviceBytes {
  public:
    DeviceBytes(Device& device, std::size_t bytes);
    ~DeviceBytes();
    DeviceBytes(const DeviceBytes&) = delete;
    DeviceBytes& operator=(const DeviceBytes&) = delete;
    [[nodiscard]] std::size_t size() const;

    struct State;
    [[nodiscard]] const State& state() const { return *state_; }

  private:
    std::unique_ptr<State> state_;
};

/// To allocate takes long on some devices: what nobody holds any more is given out again.
class DeviceBytesPool {
  public:
    explicit DeviceBytesPool(Device& device) : device_(device) {}
    /// Whatever they held.
    [[nodiscard]] std::shared_ptr<DeviceBytes> get(std::size_t bytes);

  private:
    Device& device_;
    std::vector<std::shared_ptr<DeviceBytes>> all_;
};

} // namespace scanshade::gpu
