#include "ao/gpu/device_bytes.h"

#include "ao/gpu/bound_buffer.h"

#include <algorithm>
#include <fmt/format.h>

namespace scanshade::gpu {

DeviceBytes::DeviceBytes(Device& device, std::size_t bytes) {
    using Usage = vk::BufferUsageFlagBits;
    state_ = asking_vulkan(fmt::format("{} bytes on the device", bytes), [&] {
        return std::make_unique<State>(BoundBuffer(device.state(), bytes, Usage::eTransferSrc | Usage::eTransferDst,
                                                   {vk::MemoryPropertyFlagBits::eDeviceLocal}));
    });
}

DeviceBytes::~DeviceBytes() = default;

std::size_t DeviceBytes::size() const { return state_->buffer.bytes; }

std::shared_ptr<DeviceBytes> DeviceBytesPool::get(std::size_t bytes) {
    const auto free =
        std::ranges::find_if(all_, [&](const auto& each) { return each.use_count() == 1 && each->size() == bytes; });
    return free != all_.end() ? *free : all_.emplace_back(std::make_shared<DeviceBytes>(device_, bytes));
}

} // namespace scanshade::gpu
