// What a run leaves beside its pictures: frames.csv, a row per frame, and manifest.json, enough to run it again.
#pragma once

#include "ao/gpu/device.h"
#include "apps/command.h"
#include "apps/json.h"
#include "apps/walk/frame_row.h"
#include "io/captures/capture.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace scanshade {

/// Everything there is to know about the run of one capture.
struct RunReport {
    std::chrono::system_clock::time_point started;
    gpu::DeviceInfo device;
    std::size_t devices = 1; ///< of its kind
    std::size_t at_once = 1; ///< frames computed at the same time, on all of them
    std::string method;
    std::vector<Stage> settings; ///< every row as used
    const Capture& capture;
    Registration registration = Registration::unknown; ///< as used
    std::string registration_reason;
    std::string depth_noise;         ///< of the recorded depth, who says so, and what is done about it
    std::vector<std::string> budget; ///< what an error or time budget picked, expects and found; empty without one
    std::string shading;             ///< what the shaded pictures show, and why
    std::vector<FrameRow> frames;    ///< shortened
    std::size_t done_now = 0;        ///< frames that this process did; others were done before
    StageTimes ms_now{};             ///< what they spent in each stage, summed
    double took_ms = 0;              ///< from the first frame's begin to the last one's end
};

/// Frames per second of the pipeline, and of each stage had it the machine as it was to itself: as many frames at once
/// as there are cores, in `compute` RunReport::at_once. Where the device is the same cores, stages slow each other
/// down.
struct Rates {
    double pipeline = 0;
    StageTimes stage{};          ///< frames per second, not milliseconds
    std::string slowest;         ///< the stage that sets the pace
    double share_of_slowest = 0; ///< the pipeline's rate / that stage's
    double device_busy = 0;      ///< share of the time that `compute` was at work, of all it could
};
[[nodiscard]] Rates rates_of(const RunReport& report);
/// "12.3 frames/s, 94 % of compute alone"
[[nodiscard]] std::string describe(const Rates& rates);

/// frames.csv's first line, and a frame's; of a job, with the capture in front.
[[nodiscard]] std::string csv_head();
[[nodiscard]] std::string csv_line(const FrameRow& row);
[[nodiscard]] std::string csv_line(const std::string& capture, const FrameRow& row);
/// {"load": ms, ...}, rounded.
[[nodiscard]] json stage_json(const StageTimes& ms);

/// Header and one line per frame, in the report's order. Fields with commas, quotes or line ends are quoted. Atomic.
void write_frames_csv(const std::filesystem::path& file, const std::vector<FrameRow>& frames);

/// Written last, so that its presence says that the run came to its end. `whole` gives back what shorten() took of a
/// row. Atomic.
void write_manifest(const std::filesystem::path& file, const RunReport& report,
                    const std::function<FrameRow(const FrameRow&)>& whole);

/// How many of the rows have that status.
[[nodiscard]] std::size_t count(const std::vector<FrameRow>& rows, FrameStatus status);

} // namespace scanshade
