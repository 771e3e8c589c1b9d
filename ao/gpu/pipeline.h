// Compute pipelines, only for this folder: made once per device and shared by its programs.
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

/// The kind of resource at a binding of set 0.
struct Binding {
    std::uint32_t index;
    vk::DescriptorType type;
    std::uint32_t count = 1;
    auto operator<=>(const Binding&) const = default; // NOLINT(modernize-use-nullptr): clang-tidy 14 sees a 0 in it
};

/// A shader ready to run, and how it is bound (by push descriptors).
struct Pipeline {
    vk::raii::DescriptorSetLayout set = nullptr;
    vk::raii::PipelineLayout layout = nullptr;
    vk::raii::Pipeline pipeline = nullptr;
};

/// A device's pipelines. Compiling takes longer than computing a frame. Image sizes are not compiled in, so methods
/// with equal settings share pipelines for all sizes.
class Pipelines {
  public:
    struct Key {
        std::string shader; ///< "cacao/blur"
        std::vector<Binding> bindings;
        std::vector<std::pair<int, int>> constants;   ///< specialization: id, value
        auto operator<=>(const Key&) const = default; // NOLINT(modernize-use-nullptr)
    };
    /// Made on the first request, from any thread. Throws Error that names a missing shader.
    [[nodiscard]] const Pipeline& of(const vk::raii::Device& device, const Key& key);

  private:
    std::mutex making_;
    std::map<Key, Pipeline> made_;
};

} // namespace scanshade::gpu
