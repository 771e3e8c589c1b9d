// What a run leaves beside its pictures: frames.csv, a row per frame, and manifest.json, enough to run it again.
#pragma once

#include "ao/gpu/device.h"
#include "apps/batch.h"
#include "apps/command.h"
#include "apps/json.h"

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace scanshade {

/// Everything there is to know about the run of one capture.
struct RunReport {
    std::chrono::system_clock::time_point started;
    gpu::DeviceInfo device;
    std::string method;
    std::vector<Stage> settings; ///< every row as used
    const Capture& capture;
    Registration registration = Registration::unknown; ///< as used
    std::string registration_reason;
    std::string depth_noise; ///< of the recorded depth, who says so, and what is done about it
    std::vector<std::string> budget; ///< what an error or time budget picked, expects and found; empty without one
    std::string shading; ///< what the shaded pictures show, and why
    std::vector<FrameRow> frames;
    double took_ms = 0; ///< from the first frame's begin to the last one's end
};

/// frames.csv's first line, and a frame's; of a job, with the capture in front.
[[nodiscard]] std::string csv_head();
[[nodiscard]] std::string csv_line(const FrameRow& row);
[[nodiscard]] std::string csv_line(const std::string& capture, const FrameRow& row);
/// {"load": ms, ...}, rounded.
[[nodiscard]] json stage_json(const StageTimes& ms);

/// Header and one line per frame, in the report's order. Fields with commas, quotes or line ends are quoted. Atomic.
void write_frames_csv(const std::filesystem::path& file, const std::vector<FrameRow>& frames);

/// Written last, so that its presence says that the run came to its end. Atomic.
void write_manifest(const std::filesystem::path& file, const RunReport& report);

/// How many of the rows have that status.
[[nodiscard]] std::size_t count(const std::vector<FrameRow>& rows, FrameStatus status);

} // namespace scanshade
