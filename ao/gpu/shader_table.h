// The compiled shaders, embedded: name -> SPIR-V words.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace scanshade::gpu {

/// SPIR-V of "cacao/blur" and the like; throws Error naming a shader that is not there.
[[nodiscard]] std::span<const std::uint32_t> shader_words(std::string_view name);

} // namespace scanshade::gpu
