#include "apps/results/captures_page.h"

#include "apps/page/run_page.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

std::size_t CapturesPage::add(const std::string& name, const fs::path& results, std::size_t frames,
                              std::vector<std::string> sources) {
    if (captures_.empty() || captures_.back().results != results)
        captures_.push_back({results, {.name = name}, std::move(sources)});
    captures_.back().sums.frames += frames;
    return captures_.size() - 1;
}

void CapturesPage::take(std::size_t capture, const std::vector<FrameRow>& rows) {
    OneCapture& one = captures_.at(capture);
    page::ListRow& sums = one.sums;
    for (const FrameRow& row : rows) {
        if (row.status != FrameStatus::skipped)
            one.reasons.add(row, one.sources);
        sums.ok += row.status == FrameStatus::ok;
        sums.doubtful += row.status == FrameStatus::doubtful;
        sums.failed += row.status == FrameStatus::failed && row.fault != Fault::outage;
        if (!is_done(row.status))
            continue;
        const bool doubtful = row.status == FrameStatus::doubtful;
        if (one.pictured.empty() || (doubtful && !one.pictured_is_doubtful))
            one.pictured = row.name, one.pictured_is_doubtful = doubtful;
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
    if (capture.pictured.empty())
        return row;
    for (const char* kind : {"shaded", "panel", "ao"})
        if (const fs::path picture = capture.results / kind / (capture.pictured + ".png");
            row.picture.empty() && fs::exists(picture))
            row.picture = picture.lexically_relative(folder_).generic_string();
    return row;
}

std::vector<page::ListReason> CapturesPage::reasons() const {
    ReasonGroups failed, doubtful;
    const auto join = [](ReasonGroups& all, const ReasonGroups& more, const std::string& capture) {
        for (const auto& [reason, group] : more) {
            ReasonGroup& one = all[reason];
            if (one.frames == 0)
                one.example = capture + " " + group.example;
            one.frames += group.frames;
        }
    };
    for (const OneCapture& capture : captures_) {
        join(failed, capture.reasons.reasons, capture.sums.name);
        join(doubtful, capture.reasons.doubts, capture.sums.name);
    }
    std::vector<page::ListReason> all;
    for (const auto& [kind, groups] : {std::pair("failed", &failed), std::pair("doubtful", &doubtful)}) {
        const auto begin = static_cast<std::ptrdiff_t>(all.size());
        for (const auto& [reason, group] : *groups)
            all.push_back({kind, group.frames, reason, group.example});
        std::ranges::stable_sort(all.begin() + begin, all.end(), std::greater(), &page::ListReason::frames);
    }
    return all;
}

void CapturesPage::write(const std::string& subtitle, std::vector<std::string> notes) const {
    const fs::path whole = fs::weakly_canonical(folder_);
    page::ListPage list{.title = (whole.has_filename() ? whole : whole.parent_path()).filename().string(),
                        .subtitle = subtitle,
                        .notes = std::move(notes),
                        .reasons = reasons(),
                        .rows = {}};
    for (const OneCapture& capture : captures_)
        list.rows.push_back(with_means(capture));
    page::write_list(folder_, list);
}

} // namespace scanshade
