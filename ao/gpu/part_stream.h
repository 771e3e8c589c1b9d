// Large buffers to and from the device, part by part, only for this folder.
#pragma once

#include "ao/gpu/bound_buffer.h"
#include "ao/gpu/vulkan.h"

#include <array>
#include <cstddef>
#include <functional>
#include <span>

namespace scanshade::gpu {

/// Two parts take turns: the host works on one while the device copies the other. Memory of a buffer's size that both
/// reach would take longer to make than to fill (a GB of it: a quarter of a second).
class PartStream {
  public:
    PartStream(Device::State& gpu, const vk::raii::CommandPool& pool) : gpu_(gpu), pool_(pool) {}
    ~PartStream();
    PartStream(const PartStream&) = delete;
    PartStream& operator=(const PartStream&) = delete;

    enum class Way { in, out };
    using Visit = std::function<void(std::size_t first, std::span<std::byte> part)>;
    /// Visits parts of whole items before they are copied in, or after they were copied out; the whole of a buffer that
    /// the host reaches.
    void run(const BoundBuffer& buffer, std::size_t item_bytes, Way way, const Visit& visit);

  private:
    struct Part {
        BoundBuffer staging;
        vk::raii::CommandBuffer commands = nullptr;
        vk::raii::Fence copied = nullptr;
        bool copying = false;
    };
    void make(Part& part) const;
    void begin_copy(Part& part, const BoundBuffer& buffer, std::size_t offset, std::size_t bytes, Way way);
    void wait(Part& part) const;

    Device::State& gpu_;
    const vk::raii::CommandPool& pool_;
    std::array<Part, 2> parts_;
};

} // namespace scanshade::gpu
