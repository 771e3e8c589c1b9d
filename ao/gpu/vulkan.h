// The Vulkan objects behind Device, only for this folder: all other code uses Device and Program.
#pragma once

#include "ao/gpu/device.h"
#include "ao/gpu/memory_pool.h"
#include "ao/gpu/pipeline.h"
#include "projection/base/error.h"

#include <mutex>
#include <vulkan/vulkan_raii.hpp>

namespace scanshade::gpu {

/// Runs code that calls Vulkan. Vulkan's error codes describe the machine (no driver, no memory, a lost device), not
/// bugs of ours: they become DeviceLost and Error.
template <class Action>
decltype(auto) asking_vulkan(Action&& action) {
    try {
        return std::forward<Action>(action)();
    } catch (const vk::DeviceLostError& failure) {
        throw DeviceLost(failure.what());
    } catch (const vk::SystemError& failure) {
        throw Error(failure.what());
    }
}

/// The same, with context.
template <class Action>
decltype(auto) asking_vulkan(const std::string& what, Action&& action) {
    return during(what, [&]() -> decltype(auto) { return asking_vulkan(std::forward<Action>(action)); });
}

struct Messages {
    std::mutex mutex;
    std::vector<std::string> texts;
};

/// Vulkan's loader; throws Error where it is not installed.
[[nodiscard]] vk::raii::Context loader();

struct Device::State {
    vk::raii::Context context = loader();
    std::unique_ptr<Messages> messages = std::make_unique<Messages>(); // outlives the messenger that writes into it
    bool validating = false;
    vk::raii::Instance instance = nullptr;
    vk::raii::DebugUtilsMessengerEXT messenger = nullptr;
    vk::raii::PhysicalDevice physical = nullptr;
    vk::raii::Device device = nullptr;
    std::uint32_t queue_family = 0;
    /// One for all programs. With several, NVIDIA's driver 580 now and then lost the device (Xid 109, the switch
    /// between them timed out), and frames came no faster.
    vk::raii::Queue queue = nullptr;
    std::mutex submitting; ///< to be held by who submits
    Pipelines pipelines;
    std::unique_ptr<MemoryPool> memory_pool = std::make_unique<MemoryPool>();
    vk::PhysicalDeviceMemoryProperties memory;
    double nanoseconds_per_tick = 1;
    bool has_timestamps = false;
    DeviceInfo info;

    /// Index of the first memory type among `allowed` bits that has all `wanted` flags; -1 if none.
    [[nodiscard]] int memory_type(std::uint32_t allowed, vk::MemoryPropertyFlags wanted) const;
};

} // namespace scanshade::gpu
