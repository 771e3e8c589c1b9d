// The result of one frame: a row of frames.csv, a line of the journal.
#include "apps/frame/frame_row.h"

#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>

namespace scanshade {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

std::string_view name_of(FrameStatus status) {
    switch (status) {
    case FrameStatus::ok:
        return "ok";
    case FrameStatus::doubtful:
        return "doubtful";
    case FrameStatus::failed:
        return "failed";
    case FrameStatus::skipped:
        return "skipped";
    }
    return "";
}

StageTimes operator+(const StageTimes& a, const StageTimes& b) {
    const auto sum = [](double x, double y) { return (std::isnan(x) ? 0 : x) + (std::isnan(y) ? 0 : y); };
    return {sum(a.load, b.load), sum(a.project, b.project), sum(a.compute, b.compute), sum(a.attach, b.attach),
            sum(a.write, b.write)};
}

std::string_view name_of(Fault fault) {
    switch (fault) {
    case Fault::none:
        return "none";
    case Fault::input:
        return "input";
    case Fault::outage:
        return "outage";
    case Fault::internal:
        return "internal";
    case Fault::crash:
        return "crash";
    }
    return "";
}

void shorten(FrameRow& row) {
    row.camera = {};
    row.passes = {}; // not clear(): that would keep the memory
    row.notes = {};
    row.files = {};
    std::erase_if(row.findings, [](const Finding& finding) { return !is_doubt(finding); });
}

std::string reason_of(const FrameRow& row) {
    return any_doubt(row.findings) ? fmt::format("{}", fmt::join(doubts_in(row.findings), " ")) : row.why;
}

FrameRow skipped_row(const Capture& capture, std::size_t index) {
    FrameRow row;
    row.index = index;
    row.name = capture.entries.at(index).name;
    row.why = "interrupted";
    row.valid_share = row.coverage = row.mean_visibility = row.expected_error = unknown;
    row.ms = {unknown, unknown, unknown, unknown, unknown};
    return row;
}

} // namespace scanshade
