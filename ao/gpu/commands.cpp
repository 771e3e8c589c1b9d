#include "ao/gpu/commands.h"

#include "projection/base/error.h"

#include <cstdint>
#include <mutex>

namespace scanshade::gpu {
namespace {

void barrier(const vk::raii::CommandBuffer& commands, vk::PipelineStageFlags2 to_stage, vk::AccessFlags2 to_access) {
    const vk::MemoryBarrier2 memory(Stage::eComputeShader | Stage::eTransfer,
                                    Access::eMemoryRead | Access::eMemoryWrite, to_stage, to_access);
    commands.pipelineBarrier2(vk::DependencyInfo({}, memory));
}

} // namespace

void compute_barrier(const vk::raii::CommandBuffer& commands) {
    barrier(commands, Stage::eComputeShader | Stage::eTransfer, Access::eMemoryRead | Access::eMemoryWrite);
}

void host_barrier(const vk::raii::CommandBuffer& commands) { barrier(commands, Stage::eHost, Access::eHostRead); }

void begin_submit(Device::State& gpu, const std::vector<vk::CommandBuffer>& recorded, const vk::raii::Fence& done) {
    std::vector<vk::CommandBufferSubmitInfo> infos;
    for (const vk::CommandBuffer each : recorded)
        if (each)
            infos.emplace_back(each);
    const std::lock_guard alone(gpu.submitting);
    gpu.queue.submit2(vk::SubmitInfo2({}, {}, infos), *done);
}

void wait_for(const Device::State& gpu, const vk::raii::Fence& done) {
    constexpr std::uint64_t patience_ns = 120'000'000'000;
    if (gpu.device.waitForFences(*done, VK_TRUE, patience_ns) != vk::Result::eSuccess)
        throw DeviceLost("did not finish within 120 s");
    gpu.device.resetFences(*done);
}

} // namespace scanshade::gpu
