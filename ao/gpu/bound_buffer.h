// A Vulkan buffer with its memory, only for this folder.
#pragma once

#include "ao/gpu/device_bytes.h"
#include "ao/gpu/memory_pool.h"
#include "ao/gpu/vulkan.h"
#include "projection/base/error.h"

#include <cstddef>
#include <initializer_list>
#include <utility>

namespace scanshade::gpu {

/// Memory that shader and host both access at full speed: nothing is copied.
constexpr auto shared_memory = vk::MemoryPropertyFlagBits::eDeviceLocal | vk::MemoryPropertyFlagBits::eHostVisible |
                               vk::MemoryPropertyFlagBits::eHostCoherent | vk::MemoryPropertyFlagBits::eHostCached;

/// In the first available kind of memory wished for; mapped if the host can reach it.
struct BoundBuffer {
    PooledMemory memory;
    vk::raii::Buffer buffer = nullptr;
    vk::raii::BufferView view = nullptr; // texel buffers only
    std::byte* mapped = nullptr;
    std::size_t bytes = 0;

    BoundBuffer() = default;
    BoundBuffer(const Device::State& gpu, std::size_t size, vk::BufferUsageFlags usage,
                std::initializer_list<vk::MemoryPropertyFlags> wishes)
        : bytes(size) {
        buffer = gpu.device.createBuffer({{}, size, usage});
        const auto needs = buffer.getMemoryRequirements();
        int type = -1;
        vk::MemoryPropertyFlags flags;
        for (const auto& wish : wishes)
            if (type < 0 && (type = gpu.memory_type(needs.memoryTypeBits, wish)) >= 0)
                flags = wish;
        if (type < 0)
            throw Error("the device has no suitable memory");
        memory = PooledMemory(gpu, needs, static_cast<std::uint32_t>(type));
        buffer.bindMemory(*memory, 0);
        if (flags & vk::MemoryPropertyFlagBits::eHostVisible) // else the host reads it slowly, if at all
            mapped = memory.mapped();
    }
};

struct DeviceBytes::State {
    explicit State(BoundBuffer bound) : buffer(std::move(bound)) {}
    BoundBuffer buffer;
};

} // namespace scanshade::gpu
