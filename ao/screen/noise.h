// The noise of the screen-space methods: two numbers per pixel, spread evenly over any neighbourhood of the image.
#pragma once

#include <cstdint>
#include <vector>

namespace scanshade {

/// Index of (x, y) on the Hilbert curve through a 64x64 square, 0 .. 4095; neighbours on the curve are neighbours in
/// the square.
[[nodiscard]] std::uint32_t hilbert_index(std::uint32_t x, std::uint32_t y);

/// Roberts' R2 sequence along that curve, two numbers in [0, 1) a pixel, row by row; the image repeats it. Each seed
/// moves 288 indices along the sequence, as XeGTAO does per frame.
[[nodiscard]] std::vector<float> noise_table(int seed);

} // namespace scanshade
