// The result of one frame: a row of frames.csv, a line of the journal.
#pragma once

#include "ao/base/method.h"
#include "io/captures/capture.h"
#include "projection/base/finding.h"
#include "projection/camera.h"

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// Doubtful: computed and written, but the result is implausible; FrameRow::findings has the reasons.
enum class FrameStatus { ok, doubtful, failed, skipped };
[[nodiscard]] std::string_view name_of(FrameStatus status);
/// Whether the frame has results.
[[nodiscard]] constexpr bool is_done(FrameStatus status) {
    return status == FrameStatus::ok || status == FrameStatus::doubtful;
}

/// Milliseconds that one frame spent in each stage of the walk.
struct StageTimes {
    double load = 0, project = 0, compute = 0, attach = 0, write = 0;
};
/// Sums; a time that is not known (NaN) counts as none.
[[nodiscard]] StageTimes operator+(const StageTimes& a, const StageTimes& b);

/// The cause of a frame without a result. Only an outage is worth another try.
enum class Fault { none, input, outage, internal, crash };
[[nodiscard]] std::string_view name_of(Fault fault);

/// Values of steps that a frame did not reach are NaN or empty.
struct FrameRow {
    std::size_t index = 0; ///< in capture.entries
    std::string name;
    FrameStatus status = FrameStatus::skipped;
    std::string why;   ///< of a failed or skipped frame
    Findings findings; ///< a doubtful frame has doubts in them
    Fault fault = Fault::none;
    cv::Size size;
    double valid_share = 0; ///< pixels or points with a depth / all of them
    double coverage = 0;    ///< pixels or points with a visibility / those with a depth
    double mean_visibility = 0;
    double expected_error = 0;    ///< RMS of visibility over the frame; NaN = unknown
    std::size_t other_frames = 0; ///< how many of the recording it was computed with
    Camera camera;                ///< as used
    StageTimes ms;
    Timings passes; ///< the method's own account of `ms.compute`
    std::vector<std::string> warnings;
    std::vector<std::string> notes;           ///< what was chosen for this frame, and why
    std::vector<std::filesystem::path> files; ///< written, relative to Outputs::folder
};

/// Frees what the journal keeps and only the manifest needs: camera, passes, notes and files. For thousands of frames
/// these would take most of a run's memory. Of the findings doubts stay.
void shorten(FrameRow& row);

/// `why`, or the doubts as one line; empty for a frame that is ok.
[[nodiscard]] std::string reason_of(const FrameRow& row);

/// The row of a frame that was not begun.
[[nodiscard]] FrameRow skipped_row(const Capture& capture, std::size_t index);

} // namespace scanshade
