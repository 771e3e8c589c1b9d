// The page of several captures: a row each, with a link to its own page.
#pragma once

#include "apps/json.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace scanshade::page {

/// One capture. Means are over its finished frames; NaN where there are none.
struct ListRow {
    std::string name;
    std::size_t frames = 0, ok = 0, doubtful = 0, failed = 0, left = 0;
    double coverage = 0, visibility = 0, ms = 0;
    std::string page = {};    ///< "office/index.html", from the list's folder; empty = it has none
    std::string picture = {}; ///< of a frame that stands for it, "office/shaded/000.png"; likewise
};

/// Frames that share a reason.
struct ListReason {
    std::string kind; ///< "failed" or "doubtful"
    std::size_t frames = 0;
    std::string reason, first; ///< `first`: a frame
};

struct ListPage {
    std::string title, subtitle;
    std::vector<std::string> notes;
    std::vector<ListReason> reasons;
    std::vector<ListRow> rows;
};

/// index.html and index.js in the folder; both atomic, index.html last.
void write_list(const std::filesystem::path& folder, const ListPage& list);

} // namespace scanshade::page
