// The page of several captures, made from the rows of their frames.
#pragma once

#include "apps/frame/frame_row.h"
#include "apps/page/list_page.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace scanshade {

/// Collects the captures of a run or a job. Their results are in folders under that of the page.
class CapturesPage {
  public:
    explicit CapturesPage(std::filesystem::path folder) : folder_(std::move(folder)) {}

    /// A capture of so many frames. Returns its index; those of one folder that follow each other are one.
    std::size_t add(const std::string& name, const std::filesystem::path& results, std::size_t frames);
    /// Rows of its frames; those without a row, and those that an outage ended, are left to be done. Calls for
    /// different captures may overlap.
    void take(std::size_t capture, const std::vector<FrameRow>& rows);
    /// Written once the captures' own pages are there. The title is the folder's name.
    void write(const std::string& subtitle, std::vector<std::string> notes,
               std::vector<page::ListReason> reasons = {}) const;

  private:
    struct OneCapture {
        std::filesystem::path results;
        page::ListRow sums; ///< coverage, visibility and ms: sums over finished frames
    };

    [[nodiscard]] page::ListRow with_means(const OneCapture& capture) const;

    std::filesystem::path folder_;
    std::vector<OneCapture> captures_;
};

} // namespace scanshade
