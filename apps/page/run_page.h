// The page of a run: index.html, the same for all, and index.js with the run's numbers, a line per frame.
#pragma once

#include "apps/json.h"

#include <array>
#include <cstddef>
#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace scanshade::page {

/// The cloud of all frames for the page: recording.000.js and on, beside it.
inline constexpr const char* recording_stem = "recording";

/// A frame's line. Numbers that are not known are NaN.
struct Row {
    std::size_t index = 0;
    std::string name, status, why, fault;
    int width = 0, height = 0;
    double valid_share = 0, coverage = 0, mean_visibility = 0;
    std::array<double, 5> ms{}; ///< load, project, compute, attach, write
    std::vector<std::string> warnings, notes;
    std::vector<std::string> files; ///< "ao/NAME.png": a folder beside the page, the frame's name, what comes behind it
    std::optional<Eigen::Isometry3d> world_from_camera;
    std::vector<std::pair<std::string, double>> errors = {}; ///< of a comparison: "rmse" ...; of a run: "expected"
};

/// Collects the lines of a page, about 200 bytes a frame, and writes it.
class RunPage {
  public:
    void add(const Row& row);
    /// `head`: run_head() or the like. Both files are atomic, index.html last: it says that the rest is there.
    void write(const std::filesystem::path& folder, json head) const;

  private:
    using FileSet = std::vector<std::pair<std::string, std::string>>; ///< folder, and what follows the name
    std::string lines_;
    std::vector<FileSet> sets_;
    std::map<FileSet, std::size_t> known_;
};

/// The head of a run's page, from its manifest's members (without frames).
[[nodiscard]] json run_head(const json& manifest);

/// Whether a folder has a page.
[[nodiscard]] bool has_page(const std::filesystem::path& folder);
/// Removes a page that no longer fits the results, and the cloud of all frames. Previews and points of frames belong to
/// these and stay.
void remove_page(const std::filesystem::path& folder);

/// The page of results from their manifests: of a whole capture, or of its blocks, in order. Frames are read one by
/// one, so memory does not grow by more than the page's own lines. Throws Error naming file and member.
void write_from_manifests(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& manifests);

} // namespace scanshade::page
