// Points of LAS, LAZ and other clouds that are one survey, and which of them make the surface.
#pragma once

#include "io/rasters/crs.h"

#include <cstdint>
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace scanshade::relief {

enum class Surface {
    ground, ///< by the file's classes, or by a filter
    top,    ///< the highest point of each cell
    all,    ///< the mean of all points
};

/// Where a cell has its height from.
enum class Source : std::uint8_t { nothing = 0, measured = 1, interpolated = 2 };

/// Points in the unit of their coordinate system, of one file or of several that are one survey.
struct SurveyPoints {
    std::vector<Eigen::Vector3d> points; ///< NaN: not to be used
    std::vector<std::uint8_t> classes;   ///< of LAS; 0 where the file has none
    bool ground_classified = false;      ///< a point of class 2 is there
    rasters::Crs crs;
    std::vector<std::filesystem::path> files;
    std::vector<std::string> extensions; ///< ".laz" ..., as clouds are written again
    std::vector<std::size_t> ends;       ///< behind each file's points
    double step = 0;                     ///< to which coordinates are rounded; 0: not known to be
    std::vector<std::string> notes{};    ///< sentences
    std::vector<std::string> warnings{}; ///< sentences that name their file
};

/// Throws Error naming the file for what is damaged, in degrees, or in another coordinate system than the files before.
[[nodiscard]] SurveyPoints read_survey(const std::vector<std::filesystem::path>& files);

/// Points of one more file. Throws as read_survey().
void add_file(SurveyPoints& survey, const std::filesystem::path& file);

/// Sentences about the whole, once all files are there.
void finish_notes(SurveyPoints& survey);

/// Whether a point is one of the surface.
using Taken = std::vector<bool>;

/// By classes, or by the filter where no point is classified; `notes` says so.
[[nodiscard]] Taken points_taken(const SurveyPoints& survey, Surface surface, std::vector<std::string>& notes);

/// Files without a point of the ground, while others have some.
[[nodiscard]] std::string unclassified_note(const std::filesystem::path& file);

} // namespace scanshade::relief
