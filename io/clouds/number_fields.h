// The numbers that a cloud file holds of each point besides place, colour and normal, as people know them.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

struct CloudRecords;

/// A field of numbers, or some of its bits.
struct NumberField {
    std::string name; ///< of the file; LAS's bits: "return", "returns", "classification" without flags
    std::size_t field = 0;
    bool whole = false;           ///< integers
    unsigned shift = 0, mask = 0; ///< the bits of an integer; mask 0 = all
    double scale = 1, offset = 0; ///< the value is what is stored times scale plus offset
};

/// Those that have one number a point, in the file's order; without AO and confidence of an earlier run.
[[nodiscard]] std::vector<NumberField> number_fields(const CloudRecords& records);

/// One point's values, in the order of `fields`; NaN where text is no number.
void read_numbers(const CloudRecords& records, std::span<const NumberField> fields, std::size_t point,
                  std::span<double> values);

/// How LAS says that an extra field is meant: what is stored times `factor` plus `offset`.
struct LasScale {
    double factor = 1, offset = 0;
};
[[nodiscard]] LasScale las_scale(const CloudRecords& records, std::string_view field);

} // namespace scanshade
