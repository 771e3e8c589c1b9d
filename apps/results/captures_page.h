// The page of several captures, made from the rows of their frames.
#pragma once

#include "apps/frame/frame_row.h"
#include "apps/page/list_page.h"
#include "apps/results/task_sums.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace scanshade {

/// Collects the captures of a run or a job. Their results are in folders under that of the page.
class CapturesPage {
  public:
    explicit CapturesPage(std::filesystem::path folder) : folder_(std::move(folder)) {}

    /// A capture of so many frames, whose files are in `sources`, which reasons are told without. Returns its index;
    /// those of one folder of results that follow each other are one.
    std::size_t add(const std::string& name, const std::filesystem::path& results, std::size_t frames,
                    std::vector<std::string> sources = {});
    /// Rows of its frames; those without a row, and those that an outage ended, are left to be done. Calls for
    /// different captures may overlap.
    void take(std::size_t capture, const std::vector<FrameRow>& rows);
    /// Written once the captures' own pages are there. The title is the folder's name.
    void write(const std::string& subtitle, std::vector<std::string> notes) const;

  private:
    struct OneCapture {
        std::filesystem::path results;
        page::ListRow sums; ///< coverage, visibility and ms: sums over finished frames
        std::vector<std::string> sources = {};
        TaskSums reasons = {};
        std::string pictured = {}; ///< the frame that stands for it: the first doubtful one, or the first
        bool pictured_is_doubtful = false;
    };

    [[nodiscard]] page::ListRow with_means(const OneCapture& capture) const;
    /// Those of all captures, the most frequent first, failures before doubts.
    [[nodiscard]] std::vector<page::ListReason> reasons() const;

    std::filesystem::path folder_;
    std::vector<OneCapture> captures_;
};

} // namespace scanshade
