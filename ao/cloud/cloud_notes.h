// What was done to a cloud, in sentences for its notes.
#pragma once

#include "ao/cloud/settled_sides.h"
#include "projection/base/finding.h"

#include <cstdint>
#include <optional>
#include <string>

namespace scanshade {

/// What fitting did to the points of a tile, its rim included.
struct FittedCounts {
    float noise = 0;
    double backs = 0; ///< BackShare::mean
    std::uint64_t moved = 0, kept = 0, from = 0;
};

/// About the points that a cloud's sides are of, in words: for notes. `recorded`: the normals were.
[[nodiscard]] std::string told_sides(const SettledSides& sides, bool recorded);
/// To which side sides were turned, and why.
[[nodiscard]] std::string turned_how(const SettledSides& sides);
/// As told_sides() about noise; none where no point was moved.
[[nodiscard]] std::optional<std::string> told_noise(const FittedCounts& fitted);

/// Whether noise was left in layers: by the share of rays that leave a front and meet a back.
void check_noise_left(const FittedCounts& fitted, Findings& findings);

/// About the expected error of a cloud, and what its check alone lets expect: very large, it is a doubt. A large
/// expected error is a property of the result, not a doubt.
struct ToldError {
    std::string note;
    Finding by_part;
};
[[nodiscard]] ToldError told_error(double error, double by_check);

} // namespace scanshade
