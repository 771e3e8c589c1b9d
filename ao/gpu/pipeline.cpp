#include "ao/gpu/pipeline.h"

#include "ao/gpu/shader_table.h"

namespace scanshade::gpu {
namespace {

Pipeline make(const vk::raii::Device& device, const Pipelines::Key& key) {
    Pipeline made;
    std::vector<vk::DescriptorSetLayoutBinding> bindings;
    for (const Binding& binding : key.bindings)
        bindings.emplace_back(binding.index, binding.type, binding.count, vk::ShaderStageFlagBits::eCompute);
    made.set = device.createDescriptorSetLayout({vk::DescriptorSetLayoutCreateFlagBits::ePushDescriptorKHR, bindings});
    made.layout = device.createPipelineLayout(vk::PipelineLayoutCreateInfo({}, *made.set));

    std::vector<vk::SpecializationMapEntry> entries;
    std::vector<std::int32_t> values;
    for (const auto& [id, value] : key.constants) {
        entries.emplace_back(static_cast<std::uint32_t>(id), static_cast<std::uint32_t>(values.size() * 4), 4);
        values.push_back(value);
    }
    const vk::SpecializationInfo specialization(static_cast<std::uint32_t>(entries.size()), entries.data(),
                                                values.size() * 4, values.data());
    const auto words = shader_words(key.shader);
    const vk::raii::ShaderModule module_ = device.createShaderModule({{}, words.size_bytes(), words.data()});
    const vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *module_, "main",
                                                  &specialization);
    made.pipeline = device.createComputePipeline(nullptr, {{}, stage, *made.layout});
    return made;
}

} // namespace

const Pipeline& Pipelines::of(const vk::raii::Device& device, const Key& key) {
    const std::lock_guard alone(making_);
    const auto found = made_.find(key);
    return found != made_.end() ? found->second : made_.emplace(key, make(device, key)).first->second;
}

} // namespace scanshade::gpu
