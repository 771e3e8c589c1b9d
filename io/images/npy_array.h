// What NumPy's .npy files begin with, and their elements as images and numbers (NEP 1).
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

struct NpyArray {
    std::uint64_t data = 0; ///< where the elements begin
    char kind = 0;          ///< 'f', 'u' or 'i', as in NumPy's type strings
    std::uint64_t element_bytes = 0;
    bool swapped = false, column_major = false;
    std::vector<std::uint64_t> shape; ///< outermost first

    [[nodiscard]] std::uint64_t count() const;
    [[nodiscard]] std::uint64_t bytes() const { return count() * element_bytes; }
};

/// Enough of a file's first bytes for npy_array_in().
constexpr std::uint64_t most_npy_header = 1 << 12;

[[nodiscard]] bool is_npy(std::string_view start);
/// Throws Error, beginning with `where`, for what is no array of numbers, for more than 8 dimensions or 2^48 bytes,
/// and for a header that is longer than `start`.
[[nodiscard]] NpyArray npy_array_in(std::string_view start, const std::string& where);

/// `elements` in rows, one after the other; in columns where the array is column-major. One channel: CV_16U for 'u' of
/// two bytes, else CV_32F.
[[nodiscard]] cv::Mat npy_image(std::string_view elements, const NpyArray& array, cv::Size size);
/// The array's elements as they lie.
[[nodiscard]] std::vector<double> npy_numbers(std::string_view elements, const NpyArray& array);

} // namespace scanshade
