// Device memory that is used again, only for this folder.
#pragma once

#include "ao/gpu/device.h"
#include "projection/base/error.h"

#include <cstddef>
#include <deque>
#include <mutex>
#include <vulkan/vulkan_raii.hpp>

namespace scanshade::gpu {

/// Memory of one kind, for one buffer or image; mapped if the host can reach it.
struct MemoryBlock {
    vk::raii::DeviceMemory memory = nullptr;
    std::byte* mapped = nullptr;
    std::size_t bytes = 0;
    std::uint32_t type = 0; ///< index among the device's memory types
};

/// What programs gave back is kept for the next ones: captures of other sizes come with other programs, and drivers of
/// GPUs take about a millisecond to make, map or free a block, one process at a time. Thread-safe.
class MemoryPool {
  public:
    /// At least `bytes`, whose content is whatever was there.
    [[nodiscard]] MemoryBlock get(const Device::State& gpu, std::uint32_t type, std::size_t bytes);
    void put(MemoryBlock block) noexcept;

    /// Keeps up to so many bytes from now on. 0: nothing, and blocks are of the size asked for.
    void keep(std::size_t bytes);
    [[nodiscard]] std::size_t kept() const;

  private:
    using Blocks = std::deque<MemoryBlock>;
    [[nodiscard]] Blocks too_many(); ///< to be freed when the lock is gone

    static constexpr std::size_t most_blocks = 1024; // drivers have a limit, often 4096

    mutable std::mutex access_;
    Blocks idle_; ///< in the order in which they came back
    std::size_t idle_bytes_ = 0, most_bytes_ = 0;
};

/// A block that goes back to the pool.
class PooledMemory {
  public:
    PooledMemory() = default;
    PooledMemory(const Device::State& gpu, const vk::MemoryRequirements& needs, std::uint32_t type);
    PooledMemory(PooledMemory&& other) noexcept;
    PooledMemory& operator=(PooledMemory&& other) noexcept;
    ~PooledMemory();

    [[nodiscard]] vk::DeviceMemory operator*() const { return *block_.memory; }
    [[nodiscard]] std::byte* mapped() const { return block_.mapped; }

  private:
    MemoryPool* pool_ = nullptr;
    MemoryBlock block_;
};

} // namespace scanshade::gpu
