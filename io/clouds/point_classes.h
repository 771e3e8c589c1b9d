// What surveys say of each point besides its place: class and return.
#pragma once

#include "projection/frame.h"

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace scanshade {

/// The field `classification`, without the flags that share its byte in LAS; empty where the file has none.
[[nodiscard]] std::vector<std::uint8_t> classes_of(const Cloud& cloud, const std::filesystem::path& file);
/// LAS: which of its pulse's echoes each point is, from 1 on; empty for other formats.
[[nodiscard]] std::vector<std::uint8_t> returns_of(const Cloud& cloud, const std::filesystem::path& file);
/// As the specification calls a class (ASPRS, "LAS Specification 1.4 - R15", table 17).
[[nodiscard]] std::string_view class_name(std::uint8_t code);

} // namespace scanshade
