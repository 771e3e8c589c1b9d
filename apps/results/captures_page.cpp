#include "apps/results/captures_page.h"

#include "apps/page/run_page.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

std::size_t CapturesPage::add(const std::string& name, const fs::path& results, std::size_t frames) {
    if (captures_.empty() || captures_.back().results != results)
        captures_.push_back({results, {.name = name}});
    captures_.back().sums.frames += frames;
    return captures_.size() - 1;
}

void CapturesPage::take(std::size_t capture, const std::vector<FrameRow>& rows) {
    page::ListRow& sums = captures_.at(capture).sums;
    for (const FrameRow& row : rows) {
        sums.ok += row.status == FrameStatus::ok;
        sums.doubtful += row.status == FrameStatus::doubtful;
        sums.failed += row.status == FrameStatus::failed && row.fault != Fault::outage;
        if (!is_done(row.status))
            continue;
        const StageTimes ms = row.ms + StageTimes{};
        sums.coverage += row.coverage;
        sums.visibility += std::isfinite(row.mean_visibility) ? row.mean_visibility : 0;
        sums.ms += ms.load + ms.project + ms.compute + ms.attach + ms.write;
    }
}

page::ListRow CapturesPage::with_means(const OneCapture& capture) const {
    page::ListRow row = capture.sums;
    row.left = row.frames - std::min(row.frames, row.ok + row.doubtful + row.failed);
    const auto done = static_cast<double>(row.ok + row.doubtful);
    for (double* mean : {&row.coverage, &row.visibility, &row.ms})
        *mean = done > 0 ? *mean / done : std::nan("");
    if (page::has_page(capture.results))
        row.page = (capture.results / "index.html").lexically_relative(folder_).generic_string();
    return row;
}

void CapturesPage::write(const std::string& subtitle, std::vector<std::string> notes,
                         std::vector<page::ListReason> reasons) const {
    const fs::path whole = fs::weakly_canonical(folder_);
    page::ListPage list{.title = (whole.has_filename() ? whole : whole.parent_path()).filename().string(),
                        .subtitle = subtitle,
                        .notes = std::move(notes),
                        .reasons = std::move(reasons),
                        .rows = {}};
    for (const OneCapture& capture : captures_)
        list.rows.push_back(with_means(capture));
    page::write_list(folder_, list);
}

} // namespace scanshade
