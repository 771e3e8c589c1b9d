// Barriers and submissions, only for this folder.
#pragma once

#include "ao/gpu/vulkan.h"

#include <vector>

namespace scanshade::gpu {

using Stage = vk::PipelineStageFlagBits2;
using Access = vk::AccessFlagBits2;

/// What was written before is seen by the passes and copies after.
void compute_barrier(const vk::raii::CommandBuffer& commands);
/// What was written before is seen by the host.
void host_barrier(const vk::raii::CommandBuffer& commands);

/// `done` is signalled when all of them are. Null ones are left out.
void begin_submit(Device::State& gpu, const std::vector<vk::CommandBuffer>& recorded, const vk::raii::Fence& done);
/// Makes the fence ready for the next submission. Throws DeviceLost after two minutes.
void wait_for(const Device::State& gpu, const vk::raii::Fence& done);

} // namespace scanshade::gpu
