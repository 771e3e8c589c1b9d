// Cloud files that are tiles of one survey, told by the boxes that their points lie in.
#pragma once

#include <cstddef>
#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// What is known of a file before its points are read.
struct SurveyTile {
    Eigen::AlignedBox3d box;
    std::string kind; ///< tiles of one survey have equal ones: format, reference system, fields of normals
};

/// Files of equal kind whose boxes adjoin, or overlap by less than a fifth of the smaller footprint, belong together,
/// and so do those that others join. Where any two of them overlap by more, as scans of one place do, none of these do.
/// Each group has two files or more, by their numbers.
[[nodiscard]] std::vector<std::vector<std::size_t>> surveys_in(const std::vector<std::optional<SurveyTile>>& files);

} // namespace scanshade
