// The settings of `refine` and the refinement that they ask for, without files of results.
#pragma once

#include "apps/command.h"
#include "apps/refine/recording.h"

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace scanshade {

/// Settings as typed, or their defaults; filled through the rows of stages().
class RefineSettings {
  public:
    /// All rows but those of outputs, grouped as in the help. They are bound to this object.
    [[nodiscard]] std::vector<Stage> stages();
    /// Refines from pictures of a board if `board` is set, else from a capture. Throws Misuse for a setting, Error
    /// where no camera can be found.
    [[nodiscard]] RecordingResult refine(const std::filesystem::path& path);
    /// Takes sentences about what is being done; none: nobody waits for it.
    void report_to(std::function<void(const std::string&)> say) { options_.selection.say = std::move(say); }

  private:
    [[nodiscard]] calibration::Refinement from_boards(const std::filesystem::path& folder) const;
    [[nodiscard]] RecordingResult from_capture(const std::filesystem::path& path) const;

    std::string board_, target_ = "chessboard", dictionary_ = "4x4_50", lens_ = "brown", model_ = "selected",
                        outliers_ = "keep", depth_scale_;
    double square_m_ = 0.025, marker_m_ = 0;
    FirstCamera first_;
    RecordingOptions recording_;
    calibration::RefineOptions options_;
};

/// The refined poses in TUM's format: rows of time tx ty tz qx qy qz qw, camera to world. Only a comment without poses.
[[nodiscard]] std::string trajectory_of(const RecordingResult& result);

} // namespace scanshade
