// The reports of a run: frames.csv, a row per frame, and manifest.json, which is enough to run it again.
#pragma once

#include "ao/gpu/device.h"
#include "apps/command.h"
#include "apps/frame/frame_row.h"
#include "apps/json.h"
#include "apps/page/run_page.h"
#include "io/captures/capture.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace scanshade {

/// Everything that the reports hold about the run of one capture.
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
    std::string radius = {};          ///< where the capture asked for another: which, and why
    std::string depth_noise;          ///< the noise, its origin, and how the depth is prepared
    std::vector<std::string> budget;  ///< what an error or time budget chose, expected and found; empty without one
    std::string shading;              ///< what the shaded pictures show, and why
    std::string colour_encoding = {}; ///< of unshaded, ambient, direct and indirect; empty = none is written
    std::string light = {};           ///< of the colours; empty = nothing needs it
    std::vector<std::string> outlook = {}; ///< the error to expect, and the cost of less
    std::vector<FrameRow> frames;          ///< shortened
    std::size_t done_now = 0;              ///< frames that this process computed; others were done before
    StageTimes ms_now{};                   ///< sums of their times in each stage
    double took_ms = 0;                    ///< from the first frame's begin to the last one's end
    double peak_mib = 0;                   ///< the process's memory when the reports are written
    std::string recording = {};            ///< "run.mcap", where this run has written it
    bool alone = true;                     ///< no other run writes to the same folder, as runs of a capture's blocks do
};

/// Frames per second of the pipeline, and of each stage if it had the machine to itself. A stage then works on as many
/// frames at once as there are cores, `compute` on RunReport::at_once. If the device is the same cores, stages slow
/// each other down.
struct Rates {
    double pipeline = 0;
    StageTimes stage{};          ///< frames per second, not milliseconds
    std::string slowest;         ///< the stage that sets the pace
    double share_of_slowest = 0; ///< the pipeline's rate / that stage's
    double device_busy = 0;      ///< share of its possible time in which `compute` worked
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

/// The manifest's members before "frames".
[[nodiscard]] json manifest_head(const RunReport& report);
/// A frame as its page lists it.
[[nodiscard]] page::Row page_row(const FrameRow& row, const CaptureEntry& entry, const LengthUnit& unit = {});

/// A frame's row with camera, pose and time, but without what differs from run to run: times and files.
[[nodiscard]] json sample_json(const FrameRow& row, const CaptureEntry& entry, const LengthUnit& unit);

/// Written last, so that its presence means that the run has ended. `whole` restores what shorten() removed from a row.
/// Atomic. Returns the files in the folders of results that are not of this run; the manifest lists them as such.
std::vector<std::string> write_manifest(const std::filesystem::path& file, const RunReport& report,
                                        const std::function<FrameRow(const FrameRow&)>& whole);

/// What every check found in every frame, doubtful or not: the first member describes the checks. `rows` calls its
/// argument with each whole row. Atomic.
using AddChecks = std::function<void(const FrameRow&)>;
void write_checks(const std::filesystem::path& file, const std::function<void(const AddChecks&)>& rows);

/// How many of the rows have that status.
[[nodiscard]] std::size_t count(const std::vector<FrameRow>& rows, FrameStatus status);

} // namespace scanshade
