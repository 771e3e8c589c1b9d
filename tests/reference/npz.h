// NumPy archives (.npz) as the reference fixtures use them: named C-ordered arrays of little-endian numbers.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace scanshade::reference {

struct Array {
    std::string type; ///< "f4", "f2", "u1", "i1", "u4" ...
    std::vector<std::size_t> shape;
    std::vector<std::byte> data;

    [[nodiscard]] std::size_t count() const;
    /// Element i as a double, whatever the type.
    [[nodiscard]] double at(std::size_t i) const;
};

/// All arrays by name (without ".npy"). Throws Error naming file and array.
[[nodiscard]] std::map<std::string, Array> read_npz(const std::filesystem::path& file);

} // namespace scanshade::reference
