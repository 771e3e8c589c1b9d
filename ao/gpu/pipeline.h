// Compute pipelines, for the files of this folder alone: made once for a device, however many programs use them.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

namespace scanshade::gpu {

/// What a shader finds at a binding of set 0.
struct Binding {
    std::uint32_t index;
    vk::DescriptorType type;
    std::uint32_t count = 1;
    auto operator<=>(const Binding&) const = default;
};

/// A shader ready to run, and how it is bound (by push descriptors).
struct Pipeline {
    vk::raii::DescriptorSetLayout set = nullptr;
    vk::raii::PipelineLayout layout = nullptr;
    vk::raii::Pipeline pipeline = nullptr;
};

/// A device's pipelines: compiling takes longer than computing a frame, and no image size is compiled in, so that
/// methods made alike and frames of other sizes find theirs here.
class Pipelines {
  public:
    struct Key {
        std::string shader; ///< "cacao/blur"
        std::vector<Binding> bindings;
        std::vector<std::pair<int, int>> constants; ///< specialization: id, value
        auto operator<=>(const Key&) const = default;
    };
    /// Made by the first who asks. Any thread may ask. Throws Error naming a shader that is not there.
    [[nodiscard]] const Pipeline& of(const vk::raii::Device& device, const Key& key);

  private:
    std::mutex making_;
    std::map<Key, Pipeline> made_;
};

} // namespace scanshade::gpu
