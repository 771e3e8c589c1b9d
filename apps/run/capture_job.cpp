#include "apps/run/capture_job.h"

#include "apps/page/run_page.h"
#include "apps/results/journal.h"
#include "apps/results/mcap_recording.h"
#include "apps/walk/resume.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <fmt/format.h>
#include <thread>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// The size of a capture's depth images; empty for clouds, and where no header can be read.
cv::Size depth_size_in(const CaptureJob& job) {
    if (job.capture.camera && !job.capture.camera->pinhole.size.empty())
        return job.capture.camera->pinhole.size;
    if (job.batch.frames.empty())
        return {};
    const CaptureEntry& first = job.capture.entries[job.batch.frames.front()];
    try {
        return first.depth.empty() ? cv::Size() : depth_size_of(first);
    } catch (const Outage&) {
        throw;
    } catch (const Error&) { // loading that frame reports the error
        return {};
    }
}

} // namespace

std::string folder_name(const fs::path& path, std::set<std::string>& taken) {
    const fs::path whole = fs::weakly_canonical(path);
    const fs::path last = whole.has_filename() ? whole.filename() : whole.parent_path().filename();
    constexpr std::size_t longest = 200; // of the 255 bytes that file systems have
    const std::string stem =
        shortened(is_folder(path) && !is_tar(path) ? last.string() : last.stem().string(), longest);
    std::string name = stem.empty() ? "capture" : stem;
    for (int n = 2; !taken.insert(name).second; ++n)
        name = fmt::format("{}-{}", stem, n);
    return name;
}

void refuse_foreign_page(const fs::path& folder) {
    if (const fs::path page = folder / "index.html"; fs::exists(page) && !fs::exists(folder / "index.js"))
        throw Misuse(page.string() + " exists already and is no page of a run: choose another -o");
}

void refuse_to_overwrite(const CaptureJob& job) {
    const Outputs& outputs = job.batch.outputs;
    const auto refuse = [](const std::vector<fs::path>& files) {
        const auto there = std::ranges::find_if(files, [](const fs::path& file) { return fs::exists(file); });
        if (there != files.end())
            throw Misuse(there->string() +
                         " exists already: --resume goes on with an earlier run, --overwrite replaces its "
                         "results, or choose another -o");
    };
    const fs::path journal = journal_file(outputs.folder, "");
    if (!fs::exists(journal) || has_results(outputs.folder))
        refuse(
            {outputs.folder / "manifest.json", outputs.folder / "frames.csv", outputs.folder / "checks.json", journal});
    if (outputs.mcap)
        refuse({mcap_file(outputs.folder, job.block)});
    refuse_foreign_page(outputs.folder);
    for (const std::size_t index : job.batch.frames)
        refuse(files_of(job.capture.entries[index], outputs));
}

void refuse_another_captures_results(const CaptureJob& job) {
    if (const auto other = other_capture_in(job.folder(), job.capture))
        throw Misuse(fmt::format("{} has results of {}, not of {}: choose another -o, or --overwrite replaces them",
                                 job.folder().string(), *other, job.capture.path.string()));
}

void require_folders(const fs::path& folder) {
    require_folder(folder);
    std::vector<fs::path> parts(result_folders.begin(), result_folders.end());
    parts.emplace_back(tar_folder);
    for (const fs::path& part : parts) {
        const fs::path inside = folder / part;
        std::error_code ignored;
        if (fs::is_symlink(fs::symlink_status(inside, ignored)))
            throw Misuse(inside.string() + ": is a symbolic link, and results are neither written nor removed through "
                                           "one: make a folder of it, or choose another -o");
        if (fs::exists(inside, ignored))
            require_folder(inside);
    }
}

void prepare_folder(const CaptureJob& job, const ReportFiles& reports, bool first) {
    std::set<std::string, std::less<>> stems;
    if (job.block.empty()) // of any frame: the earlier run may have taken others
        for (const CaptureEntry& entry : job.capture.entries)
            stems.insert(entry.name);
    for (const std::size_t index : job.batch.frames) // of a block: others may be under work
        stems.insert(job.capture.entries[index].name);
    for (const fs::path& report : {reports.table, reports.manifest, reports.checks}) {
        stems.insert(report.stem().string());
        fs::remove(report);
    }
    stems.insert("index");
    stems.insert(page::recording_stem);
    page::remove_page(job.folder());
    if (first && !job.block.empty())
        return;
    const auto ours = [&](std::string_view stem) { // "office", or "office.003" of a cloud's chunks
        const std::size_t dot = stem.rfind('.');
        return stems.contains(stem) || (dot != std::string_view::npos && whole_number(stem.substr(dot + 1)) &&
                                        stems.contains(stem.substr(0, dot)));
    };
    remove_leftovers(job.folder(), ours);
    for (const char* part : result_folders)
        remove_leftovers(job.folder() / part, ours);
}

void fit_into_memory(CaptureJob& job, bool on_cpu) {
    // Per pixel: depth and visibility; confidence, clay and its cosines; points, a message or file of them, and that
    // packed; CACAO's buffers.
    constexpr std::uint64_t maps = 12, pictures = 13, points = 100, device = 24;
    const Outputs& outputs = job.batch.outputs;
    const bool finished = outputs.confidence || outputs.error || outputs.shaded || outputs.panel || outputs.mcap;
    const cv::Size size = depth_size_in(job);
    const std::uint64_t bytes =
        static_cast<std::uint64_t>(size.area()) *
        (maps + (finished ? pictures : 0) + (outputs.mcap || outputs.glb ? points : 0) + (on_cpu ? device : 0));
    require_memory(bytes,
                   fmt::format("{}: a frame of {}x{} pixels", job.capture.path.string(), size.width, size.height));
    constexpr std::uint64_t always_fits = 128 << 20;
    const std::uint64_t usual = std::thread::hardware_concurrency() + 8;
    if (bytes < always_fits)
        return;
    if (const std::uint64_t fit = free_memory() / bytes; fit < usual)
        job.batch.frames_in_memory = std::max(1, static_cast<int>(fit));
}

} // namespace scanshade
