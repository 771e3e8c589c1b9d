// Memory that stays on the device between runs, shared by programs.
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

/// Reuses memory that nobody holds any more, since allocation is slow on some devices.
class DeviceBytesPool {
  public:
    explicit DeviceBytesPool(Device& device) : device_(device) {}
    /// With undefined content.
    [[nodiscard]] std::shared_ptr<DeviceBytes> get(std::size_t bytes);

  private:
    Device& device_;
    std::vector<std::shared_ptr<DeviceBytes>> all_;
};

} // namespace scanshade::gpu
