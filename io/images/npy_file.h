// Arrays as NumPy's .npy files, for the data between a method's passes.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// Writes one array, version 1.0 of the format (NEP 1). `type` is NumPy's name of a little-endian element ("f4", "u4"),
/// `shape` outermost first. Throws Error naming the file where the bytes are not as many as type and shape say.
void write_npy(const std::filesystem::path& file, const std::string& type, const std::vector<int>& shape,
               std::span<const std::byte> data);

} // namespace scanshade
