// Captures, opened as the settings of `run` say, and what is computed of them.
#pragma once

#include "apps/run/capture_job.h"
#include "apps/session/settings.h"

#include <filesystem>
#include <memory>
#include <mutex>

namespace scanshade {

class Openings {
  public:
    explicit Openings(RunSettings& asked) : asked_(asked) {}

    /// Throws Error where the capture cannot be opened, or not with these settings.
    [[nodiscard]] std::shared_ptr<OpenedCapture> opened(const std::filesystem::path& path) const;
    /// The capture of a block that another block is at work on, or has been last, stays open. Others wait meanwhile.
    [[nodiscard]] std::shared_ptr<OpenedCapture> opened_for_blocks(const std::filesystem::path& path);
    /// All frames that were asked for, with results in `folder`.
    [[nodiscard]] CaptureJob job_from(std::shared_ptr<OpenedCapture> capture,
                                      const std::filesystem::path& folder) const;

  private:
    RunSettings& asked_;
    std::mutex opening_; ///< of captures that are computed in blocks
    std::shared_ptr<OpenedCapture> last_opened_;
    std::filesystem::path last_opened_path_;
};

} // namespace scanshade
