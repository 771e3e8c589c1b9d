#include "apps/walk/progress.h"

#include "apps/json.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <mutex>
#include <nlohmann/json.hpp>
#include <unistd.h>
#include <utility>

namespace scanshade {
namespace {

const char* const clear_line = "\r\033[K";

/// Seconds between lines about frames without problems, where there is no terminal.
constexpr double between_lines_s = 5;

bool as_json = false, quiet = false; // set once, before there are threads

} // namespace

struct OrderedOutput::Buffer {
    std::string capture, text;
    bool ended = false;
};

namespace {

std::mutex output_mutex;
std::deque<std::shared_ptr<OrderedOutput::Buffer>> buffers; // the first one prints, the others wait
thread_local std::shared_ptr<OrderedOutput::Buffer> own_buffer;

/// Whether lines of this buffer, or of none, are printed at once. The caller holds `output_mutex`.
bool writes_now(const std::shared_ptr<OrderedOutput::Buffer>& buffer) { return !buffer || buffers.front() == buffer; }

/// Prints the text, which includes its line breaks, or appends it to a buffer that waits.
void tell(const std::shared_ptr<OrderedOutput::Buffer>& buffer, const std::string& text) {
    const std::lock_guard alone(output_mutex);
    if (!writes_now(buffer)) {
        buffer->text += text;
        return;
    }
    std::fputs(text.c_str(), stderr);
    std::fflush(stderr);
}

/// Prints text that the next one overwrites. Drops it if the buffer has to wait.
void tell_for_now(const std::shared_ptr<OrderedOutput::Buffer>& buffer, const std::string& latest) {
    const std::lock_guard alone(output_mutex);
    if (!writes_now(buffer))
        return;
    std::fputs(latest.c_str(), stderr);
    std::fflush(stderr);
}

void log(const std::shared_ptr<OrderedOutput::Buffer>& buffer, const json& object) {
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    json line{{"time", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now))}};
    if (buffer && !buffer->capture.empty())
        line["capture"] = buffer->capture;
    line.update(object);
    const std::lock_guard alone(output_mutex);
    fmt::print(stderr, "{}\n", json_line(line));
}

std::string line_of(const FrameRow& row) {
    if (!is_done(row.status))
        return fmt::format("{}: {}: {}", row.name, name_of(row.status), row.why);
    const StageTimes& ms = row.ms;
    const std::string visibility =
        std::isnan(row.mean_visibility)
            ? "no visibility"
            : fmt::format("visibility {:.3f}{}", row.mean_visibility,
                          std::isnan(row.expected_error) ? ""
                                                         : fmt::format(", expected error {:.3f}", row.expected_error));
    std::string line = fmt::format("{}: {}, valid {:.1f} %, coverage {:.1f} %, {}, {:.0f} ms", row.name,
                                   name_of(row.status), 100 * row.valid_share, 100 * row.coverage, visibility,
                                   ms.load + ms.project + ms.compute + ms.attach + ms.write);
    for (const std::string& doubt : doubts_in(row.findings))
        line += "; doubtful: " + doubt;
    for (const std::string& warning : row.warnings)
        line += "; warning: " + warning;
    for (const std::string& note : row.notes)
        line += "\n    " + note;
    return line;
}

} // namespace

void log_as_json() { as_json = true; }

void be_quiet() { quiet = true; }

void say(const std::string& line) {
    if (!quiet)
        warn(line);
}

void warn(const std::string& line) {
    if (as_json)
        log(own_buffer, {{"message", line}});
    else
        tell(own_buffer, line + "\n");
}

OrderedOutput::OrderedOutput() : buffer_(std::make_shared<Buffer>()) {
    const std::lock_guard alone(output_mutex);
    buffers.push_back(buffer_);
    own_buffer = buffer_;
}

OrderedOutput::~OrderedOutput() {
    const std::lock_guard alone(output_mutex);
    own_buffer = nullptr;
    buffer_->ended = true;
    while (!buffers.empty() && buffers.front()->ended) {
        buffers.pop_front();
        if (!buffers.empty())
            std::fputs(std::exchange(buffers.front()->text, "").c_str(), stderr);
    }
    std::fflush(stderr);
}

void OrderedOutput::set_capture(const std::string& capture) { buffer_->capture = capture; }

std::string duration_text(double seconds) {
    const auto whole = static_cast<long>(std::lround(std::max(seconds, 0.0)));
    const long h = whole / 3600, m = whole / 60 % 60, s = whole % 60;
    return h > 0 ? fmt::format("{}:{:02}:{:02}", h, m, s) : fmt::format("{}:{:02}", m, s);
}

std::string time_left_text(double seconds) { return duration_text(std::max(seconds, 1.0)); }

std::string percent_text(double share_done, bool anything_left, int digits) {
    const double step = std::pow(10.0, -digits);
    const double percent = std::floor(100 * std::clamp(share_done, 0.0, 1.0) / step) * step;
    return fmt::format("{:.{}f}", anything_left ? std::min(percent, 100 - step) : 100.0, digits);
}

Progress::Progress(std::size_t total)
    : total_(total), on_terminal_(!as_json && !quiet && isatty(STDERR_FILENO) == 1), buffer_(own_buffer) {}

void Progress::add(const FrameRow& row) {
    ++done_;
    const bool bad = row.status != FrameStatus::ok || !row.warnings.empty();
    if (quiet && !bad)
        return;
    if (as_json) {
        const StageTimes& ms = row.ms;
        const double sum_ms = ms.load + ms.project + ms.compute + ms.attach + ms.write;
        log(buffer_, {{"frame", row.name},
                      {"status", name_of(row.status)},
                      {"fault", name_of(row.fault)},
                      {"why", row.why},
                      {"doubts", doubts_in(row.findings)},
                      {"warnings", row.warnings},
                      {"ms", sum_ms},
                      {"done", done_},
                      {"of", total_},
                      {"left_s", seconds_left()}});
        return;
    }
    if (quiet) {
        tell(buffer_, fmt::format("{}: {}\n", buffer_ ? buffer_->capture : "", line_of(row)));
    } else if (on_terminal_ ? bad || !row.notes.empty() : bad || is_due()) {
        const std::string place = bad ? "" : fmt::format("  {}/{}", done_, total_);
        tell(buffer_, fmt::format("{}  {}\n", on_terminal_ ? clear_line : place, line_of(row)));
    }
    if (on_terminal_)
        tell_for_now(buffer_, bar());
}

bool Progress::is_due() {
    if (last_line_ && last_line_->seconds() < between_lines_s)
        return false;
    last_line_.emplace();
    return true;
}

double Progress::seconds_left() const {
    return stopwatch_.seconds() / static_cast<double>(done_) * static_cast<double>(total_ - done_);
}

std::string Progress::bar() const {
    constexpr std::size_t width = 30;
    const double rate = static_cast<double>(done_) / stopwatch_.seconds();
    const std::string left = done_ < total_ ? time_left_text(seconds_left()) : duration_text(0);
    const std::size_t filled = width * done_ / total_;
    return fmt::format("{}  [{:#<{}}{:.<{}}] {}/{}  {:.1f} frames/s  {} left", clear_line, "", filled, "",
                       width - filled, done_, total_, rate, left);
}

void Progress::end() {
    if (on_terminal_ && done_ > 0)
        tell_for_now(buffer_, "\n");
}

} // namespace scanshade
