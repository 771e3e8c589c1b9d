// One capture to compute, and the folder of its results: what is refused there, and what is cleared before a run.
#pragma once

#include "apps/session/capture_look.h"
#include "apps/walk/batch_options.h"
#include "io/captures/capture.h"

#include <cstddef>
#include <filesystem>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace scanshade {

/// A capture, opened once for all blocks of it that a process computes: a listing of a million frames takes a minute.
struct OpenedCapture {
    Capture capture;
    std::vector<std::size_t> of; ///< all its frames to compute
    /// Made by the first block that needs them.
    std::once_flag check, make_key;
    std::string task_key = {};
    CaptureFindings findings = {};
};

/// One capture, the frames to take of it, and where its results go.
struct CaptureJob {
    explicit CaptureJob(std::shared_ptr<OpenedCapture> capture_of_blocks)
        : opened(std::move(capture_of_blocks)), capture(opened->capture), of(opened->of) {}

    std::shared_ptr<OpenedCapture> opened;
    Capture& capture; ///< of `opened`, as is
    const std::vector<std::size_t>& of;
    BatchOptions batch = {};  ///< batch.frames may be a block of `of`
    std::string block = {};   ///< "" = all, else as Task::block() says
    LoadedFrames loaded = {}; ///< decoded for the first look; the walk takes them
    CaptureLook look = {};

    [[nodiscard]] const std::filesystem::path& folder() const { return batch.outputs.folder; }
};

/// "frames.csv", "manifest.json" and "checks.json", or "frames.0-500.csv" of a block.
struct ReportFiles {
    ReportFiles(const std::filesystem::path& folder, const std::string& block)
        : table(folder / named("frames", block, ".csv")), manifest(folder / named("manifest", block, ".json")),
          checks(folder / named("checks", block, ".json")) {}
    std::filesystem::path table, manifest, checks;

  private:
    static std::string named(const std::string& stem, const std::string& block, const char* extension) {
        return block.empty() ? stem + extension : stem + "." + block + extension;
    }
};

/// "office" of captures/office/ and captures/office.pcd; "office-2" when another capture has that name.
std::string folder_name(const std::filesystem::path& path, std::set<std::string>& taken);
/// Somebody else's index.html: a page of ours has its data beside it.
void refuse_foreign_page(const std::filesystem::path& folder);
/// Results of an earlier run are replaced only with --overwrite. The reports of a run that did nothing are no results.
void refuse_to_overwrite(const CaptureJob& job);
/// --resume continues a run of the same capture only: frames of two captures would share names and reports.
void refuse_another_captures_results(const CaptureJob& job);
/// Refuses a folder of results that cannot be written, or one in it that an earlier run has left.
void require_folders(const std::filesystem::path& folder);
/// Removes files of a killed run, and the report of an earlier one: a manifest means that the results next to it are
/// complete. The caller holds the journal. `first`: no process was at work on these frames before, so that the folder
/// of a million files is not searched for every block.
void prepare_folder(const CaptureJob& job, const ReportFiles& reports, bool first);
/// Refuses frames too large for the memory, and takes fewer at once where not all fit that the cores could use.
/// `on_cpu`: the device's images are in the same memory.
void fit_into_memory(CaptureJob& job, bool on_cpu);

} // namespace scanshade
