#include "apps/results/task_sums.h"

#include "apps/results/report.h"

#include <array>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

/// A frame's failure or doubts without its name, its folder and numbers.
std::string reason_without_frame(const FrameRow& row, const std::vector<std::string>& folders) {
    std::string text = reason_of(row);
    for (const std::string& folder : folders)
        while (!folder.empty() && text.find(folder + "/") != std::string::npos)
            text.erase(text.find(folder + "/"), folder.size() + 1);
    if (const auto at = text.find(row.name); at != std::string::npos)
        text.replace(at, row.name.size(), "FRAME");
    const std::string reason = without_numbers(text);
    return row.status == FrameStatus::doubtful ? reason : fmt::format("{}: {}", name_of(row.fault), reason);
}

json groups_json(const ReasonGroups& groups) {
    json all = json::array();
    for (const auto& [reason, group] : groups)
        all.push_back({reason, group.frames, group.example});
    return all;
}

ReasonGroups groups_from(const json& text) {
    ReasonGroups groups;
    for (const json& each : text)
        groups[each.at(0).get<std::string>()] = {each.at(1).get<std::size_t>(), each.at(2).get<std::string>()};
    return groups;
}

constexpr std::array stage_times = {&StageTimes::load, &StageTimes::project, &StageTimes::compute, &StageTimes::attach,
                                    &StageTimes::write};

} // namespace

std::string without_numbers(const std::string& text) {
    std::string reason;
    for (const char c : text)
        if (const bool digit = c >= '0' && c <= '9'; !digit || reason.empty() || reason.back() != '#')
            reason += digit ? '#' : c;
    return reason;
}

void TaskSums::add(const FrameRow& row, const std::vector<std::string>& folders) {
    ms = ms + row.ms;
    const auto group = [&](ReasonGroups& groups) {
        ReasonGroup& one = groups[reason_without_frame(row, folders)];
        if (one.frames++ == 0)
            one.example = row.name;
    };
    if (row.fault == Fault::outage) {
        ++outages;
        return group(reasons);
    }
    if (row.status == FrameStatus::ok) {
        ++ok;
        return;
    }
    const bool is_doubtful = row.status == FrameStatus::doubtful;
    ++(is_doubtful ? doubtful : failed);
    group(is_doubtful ? doubts : reasons);
}

json to_json(const TaskSums& sums) {
    json text{{"ok", sums.ok}, {"doubtful", sums.doubtful}, {"failed", sums.failed}, {"ms", json::array()}};
    for (const auto stage : stage_times)
        text["ms"].push_back(sums.ms.*stage);
    text["reasons"] = groups_json(sums.reasons);
    text["doubts"] = groups_json(sums.doubts);
    return text;
}

TaskSums sums_from(const json& text) {
    TaskSums sums;
    sums.ok = count_at(text, "ok");
    sums.doubtful = count_at(text, "doubtful");
    sums.failed = count_at(text, "failed");
    for (std::size_t i = 0; i < stage_times.size(); ++i)
        sums.ms.*stage_times[i] = text.at("ms").at(i).get<double>();
    sums.reasons = groups_from(text.at("reasons"));
    sums.doubts = groups_from(text.at("doubts"));
    return sums;
}

} // namespace scanshade
