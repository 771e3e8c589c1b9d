// How far a run has come: a bar with rate and remaining time on a terminal, one line per frame elsewhere. On stderr.
#include "apps/progress.h"

#include "apps/json.h"

#include <algorithm>
#include <cmath>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

namespace scanshade {
namespace {

const char* const clear_line = "\r\033[K";

bool as_json = false; // set once, before there are threads

void log(json object) {
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    json line{{"time", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now))}};
    line.update(object);
    fmt::print(stderr, "{}\n", line.dump(-1, ' ', false, json::error_handler_t::replace));
}

std::string line_of(const FrameRow& row) {
    if (row.status != FrameStatus::ok)
        return fmt::format("{}: {}: {}", row.name, name_of(row.status), row.why);
    const StageTimes& ms = row.ms;
    const std::string visibility =
        std::isnan(row.mean_visibility) ? "no visibility" : fmt::format("visibility {:.3f}", row.mean_visibility);
    std::string line =
        fmt::format("{}: ok, valid {:.1f} %, coverage {:.1f} %, {}, {:.0f} ms", row.name, 100 * row.valid_share,
                    100 * row.coverage, visibility, ms.load + ms.project + ms.compute + ms.attach + ms.write);
    for (const std::string& warning : row.warnings)
        line += "; warning: " + warning;
    for (const std::string& note : row.notes)
        line += "\n    " + note;
    return line;
}

} // namespace

void log_as_json() { as_json = true; }

void say(const std::string& line) {
    if (as_json)
        log({{"message", line}});
    else
        fmt::print(stderr, "{}\n", line);
}

std::string duration_text(double seconds) {
    const auto whole = static_cast<long>(std::lround(std::max(seconds, 0.0)));
    const long h = whole / 3600, m = whole / 60 % 60, s = whole % 60;
    return h > 0 ? fmt::format("{}:{:02}:{:02}", h, m, s) : fmt::format("{}:{:02}", m, s);
}

Progress::Progress(std::size_t total) : total_(total), on_terminal_(!as_json && isatty(STDERR_FILENO) == 1) {}

void Progress::add(const FrameRow& row) {
    ++done_;
    if (as_json) {
        const StageTimes& ms = row.ms;
        const double sum_ms = ms.load + ms.project + ms.compute + ms.attach + ms.write;
        log({{"frame", row.name},
             {"status", name_of(row.status)},
             {"fault", name_of(row.fault)},
             {"why", row.why},
             {"warnings", row.warnings},
             {"ms", sum_ms},
             {"done", done_},
             {"of", total_},
             {"left_s", seconds_left()}});
        return;
    }
    const bool remarkable = row.status != FrameStatus::ok || !row.warnings.empty() || !row.notes.empty();
    if (!on_terminal_ || remarkable)
        fmt::print(stderr, "{}  {}\n", on_terminal_ ? clear_line : "", line_of(row));
    if (on_terminal_)
        draw();
}

double Progress::seconds_left() const {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    return seconds / static_cast<double>(done_) * static_cast<double>(total_ - done_);
}

void Progress::draw() {
    constexpr std::size_t width = 30;
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    const double rate = static_cast<double>(done_) / seconds;
    const std::string left = duration_text(seconds_left());
    const std::size_t filled = width * done_ / total_;
    fmt::print(stderr, "{}  [{:#<{}}{:.<{}}] {}/{}  {:.1f} frames/s  {} left", clear_line, "", filled, "",
               width - filled, done_, total_, rate, left);
    std::fflush(stderr);
}

void Progress::end() {
    if (on_terminal_ && done_ > 0)
        fmt::print(stderr, "\n");
}

} // namespace scanshade
