#include "ao/gpu/part_stream.h"

#include "ao/gpu/commands.h"

#include <algorithm>
#include <utility>

namespace scanshade::gpu {

constexpr std::size_t most_bytes = std::size_t(1) << 25; ///< of a part

PartStream::~PartStream() {
    try {
        for (const Part& part : parts_)
            if (part.copying)
                wait_for(gpu_, part.copied);
    } catch (...) { // the device is lost, and its memory with it
    }
}

void PartStream::make(Part& part) const {
    using Usage = vk::BufferUsageFlagBits;
    using Memory = vk::MemoryPropertyFlagBits;
    const vk::MemoryPropertyFlags visible = Memory::eHostVisible | Memory::eHostCoherent;
    part.staging = BoundBuffer(gpu_, most_bytes, Usage::eTransferSrc | Usage::eTransferDst,
                               {visible | Memory::eHostCached, visible});
    part.commands =
        std::move(gpu_.device.allocateCommandBuffers({*pool_, vk::CommandBufferLevel::ePrimary, 1}).front());
    part.copied = gpu_.device.createFence({});
}

void PartStream::begin_copy(Part& part, const BoundBuffer& buffer, std::size_t offset, std::size_t bytes, Way way) {
    part.commands.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
    compute_barrier(part.commands);
    const vk::Buffer host = *part.staging.buffer, device = *buffer.buffer;
    if (way == Way::in) {
        part.commands.copyBuffer(host, device, vk::BufferCopy(0, offset, bytes));
    } else {
        part.commands.copyBuffer(device, host, vk::BufferCopy(offset, 0, bytes));
        host_barrier(part.commands);
    }
    part.commands.end();
    begin_submit(gpu_, {*part.commands}, part.copied);
    part.copying = true;
}

void PartStream::wait(Part& part) const {
    if (std::exchange(part.copying, false))
        wait_for(gpu_, part.copied);
}

void PartStream::run(const BoundBuffer& buffer, std::size_t item_bytes, Way way, const Visit& visit) {
    const std::size_t all = buffer.bytes, step = most_bytes / item_bytes * item_bytes;
    if (buffer.mapped)
        return visit(0, {buffer.mapped, all});
    for (Part& part : parts_) {
        if (part.staging.bytes == 0)
            make(part);
        wait(part); // a visit before may have failed
    }
    const auto bytes_at = [&](std::size_t offset) { return std::min(step, all - offset); };
    std::size_t turn = 0;
    if (way == Way::out)
        begin_copy(parts_[turn], buffer, 0, bytes_at(0), way);
    for (std::size_t offset = 0; offset < all; offset += step, turn ^= 1) {
        Part& part = parts_[turn];
        if (const std::size_t next = offset + step; way == Way::out && next < all)
            begin_copy(parts_[turn ^ 1], buffer, next, bytes_at(next), way);
        wait(part);
        visit(offset / item_bytes, {part.staging.mapped, bytes_at(offset)});
        if (way == Way::in)
            begin_copy(part, buffer, offset, bytes_at(offset), way);
    }
    for (Part& part : parts_)
        wait(part);
}

} // namespace scanshade::gpu
