#include "ao/gpu/memory_pool.h"

#include "ao/gpu/vulkan.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace scanshade::gpu {
namespace {

/// Few sizes, so that blocks fit again: at most a quarter is unused.
std::size_t rounded_up(std::size_t bytes) {
    constexpr std::size_t least = 4096;
    if (bytes <= least)
        return least;
    const std::size_t step = std::bit_floor(bytes) / 4;
    return (bytes + step - 1) / step * step;
}

MemoryBlock made(const Device::State& gpu, std::uint32_t type, std::size_t bytes) {
    MemoryBlock block;
    block.memory = gpu.device.allocateMemory({bytes, type});
    block.bytes = bytes;
    block.type = type;
    if (gpu.memory.memoryTypes[type].propertyFlags & vk::MemoryPropertyFlagBits::eHostVisible)
        block.mapped = static_cast<std::byte*>(block.memory.mapMemory(0, VK_WHOLE_SIZE));
    return block;
}

} // namespace

MemoryBlock MemoryPool::get(const Device::State& gpu, std::uint32_t type, std::size_t bytes) {
    {
        const std::lock_guard alone(access_);
        if (most_bytes_ > 0)
            bytes = rounded_up(bytes);
        const auto fits = std::ranges::find_if(
            idle_, [&](const MemoryBlock& block) { return block.type == type && block.bytes == bytes; });
        if (fits != idle_.end()) {
            MemoryBlock block = std::move(*fits);
            idle_.erase(fits);
            idle_bytes_ -= block.bytes;
            return block;
        }
    }
    try {
        return made(gpu, type, bytes);
    } catch (const vk::SystemError&) { // what lies idle may be what is missing
        Blocks freed;
        const std::lock_guard alone(access_);
        if (idle_.empty())
            throw;
        freed.swap(idle_);
        idle_bytes_ = 0;
    }
    return made(gpu, type, bytes);
}

void MemoryPool::put(MemoryBlock block) noexcept {
    Blocks freed;
    try {
        const std::lock_guard alone(access_);
        const std::size_t bytes = block.bytes;
        idle_.push_back(std::move(block));
        idle_bytes_ += bytes;
        freed = too_many();
    } catch (const std::bad_alloc&) { // then it is freed here
    }
}

void MemoryPool::keep(std::size_t bytes) {
    Blocks freed;
    const std::lock_guard alone(access_);
    most_bytes_ = bytes;
    freed = too_many();
}

std::size_t MemoryPool::kept() const {
    const std::lock_guard alone(access_);
    return idle_bytes_;
}

MemoryPool::Blocks MemoryPool::too_many() {
    Blocks oldest;
    while (idle_bytes_ > most_bytes_ || idle_.size() > most_blocks) {
        idle_bytes_ -= idle_.front().bytes;
        oldest.push_back(std::move(idle_.front()));
        idle_.pop_front();
    }
    return oldest;
}

PooledMemory::PooledMemory(const Device::State& gpu, const vk::MemoryRequirements& needs, std::uint32_t type)
    : pool_(gpu.memory_pool.get()), block_(pool_->get(gpu, type, needs.size)) {}

PooledMemory::PooledMemory(PooledMemory&& other) noexcept
    : pool_(std::exchange(other.pool_, nullptr)), block_(std::move(other.block_)) {}

PooledMemory& PooledMemory::operator=(PooledMemory&& other) noexcept {
    if (this != &other) {
        if (pool_)
            pool_->put(std::move(block_));
        pool_ = std::exchange(other.pool_, nullptr);
        block_ = std::move(other.block_);
    }
    return *this;
}

PooledMemory::~PooledMemory() {
    if (pool_)
        pool_->put(std::move(block_));
}

} // namespace scanshade::gpu
