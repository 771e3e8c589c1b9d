// Finds the frames that are left, and writes a line in the journal for each one done.
#include "apps/walk/resume.h"

#include "apps/json.h"
#include "io/content_hash.h"
#include "projection/base/error.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

namespace scanshade {
namespace {

std::string row_text(const Parameter& row) { return row.name + "=" + value_text(row); }

/// The outputs, each kind with the settings that affect it.
std::string outputs_text(const Outputs& outputs) {
    std::string text;
    const std::string colours = outputs.colour_cloud == CloudColours::kept     ? ""
                                : outputs.colour_cloud == CloudColours::shaded ? "coloured "
                                                                               : "coloured or grey ";
    if (outputs.ao)
        text += fmt::format("ao {};", static_cast<int>(outputs.format));
    if (outputs.confidence)
        text += fmt::format("confidence {};", static_cast<int>(outputs.format));
    if (outputs.error)
        text += fmt::format("error {};", static_cast<int>(outputs.format));
    if (outputs.shaded)
        text += "shaded;";
    if (outputs.panel)
        text += "panel;";
    if (outputs.unshaded)
        text += fmt::format("unshaded {};", outputs.shade_strength);
    if (outputs.indirect)
        text += "indirect;";
    if (outputs.light)
        text += "light;";
    if ((outputs.unshaded || outputs.indirect || outputs.light) && outputs.colour_format)
        text += fmt::format("colours {};", static_cast<int>(*outputs.colour_format));
    if (outputs.cloud)
        text += colours + "cloud;";
    if (outputs.depth_cloud)
        text += colours + "depth cloud;";
    if (outputs.shade != Shade::multiply && (outputs.shaded || outputs.panel || outputs.unshaded))
        text += fmt::format("shade {};", static_cast<int>(outputs.shade));
    if (outputs.shaded || outputs.panel || outputs.colour_cloud != CloudColours::kept)
        text += fmt::format("strength {};", outputs.shade_strength);
    if (outputs.glb)
        text += colours + "glb;";
    if (outputs.texture.wanted)
        text += fmt::format("texture {} {} {};", outputs.texture.size, outputs.texture.margin,
                            static_cast<int>(outputs.format));
    if (outputs.tiles3d)
        text += fmt::format("{}tiles3d {};", colours, outputs.tiles_crs);
    if (outputs.mcap) // whatever it holds follows from these
        text += fmt::format("mcap {} {} {} {};", static_cast<int>(outputs.format), colours, outputs.shade_strength,
                            outputs.colour_view);
    if (outputs.frames_in_tar > 0)
        text += fmt::format("tars of {};", outputs.frames_in_tar);
    if (outputs.preview)
        text += fmt::format("page {};", outputs.page_points);
    return text;
}

std::string camera_text(const Camera& camera) { return json_line(to_json(camera)); }

std::string capture_text(const Capture& capture) {
    const auto& [scale, offset_m, curve_per_m] = capture.depth_correction;
    std::string text =
        fmt::format("{} {} {} {} {}", capture.depth.name, capture.depth.units_per_metre, scale, offset_m, curve_per_m);
    if (capture.camera)
        text += camera_text(*capture.camera);
    if (capture.colour_camera)
        text += fmt::format("{} {}", camera_text(capture.colour_camera->camera),
                            fmt::join(capture.colour_camera->colour_from_depth.matrix().reshaped(), " "));
    return text;
}

std::string stamps(const CaptureEntry& entry) {
    return fmt::format("{} {} {} {} {}", entry.name, entry.problem, entry.colour.empty() ? "" : stamp_of(entry.colour),
                       entry.depth.empty() ? "" : stamp_of(entry.depth),
                       entry.cloud.empty() ? "" : stamp_of(entry.cloud));
}

/// What a frame's result depends on besides its own files: the frames within reach, and their poses.
std::string around(const Capture& capture, std::size_t index, std::size_t reach) {
    if (reach == 0)
        return "";
    std::string text;
    for (std::size_t i = index - std::min(index, reach); i <= std::min(index + reach, capture.entries.size() - 1);
         ++i) {
        const auto& pose = capture.entries[i].world_from_camera;
        text +=
            stamps(capture.entries[i]) + (pose ? fmt::format("{}", fmt::join(pose->matrix().reshaped(), " ")) : "none");
    }
    return text;
}

FrameRow crash_row(const Capture& capture, std::size_t index) {
    FrameRow row;
    row.index = index;
    row.name = capture.entries[index].name;
    row.status = FrameStatus::failed;
    row.fault = Fault::crash;
    row.why = "the process died while this frame was computed alone";
    row.valid_share = row.coverage = row.mean_visibility = row.expected_error =
        std::numeric_limits<double>::quiet_NaN();
    row.ms.load = row.ms.project = row.ms.compute = row.ms.attach = row.ms.write = row.valid_share;
    return row;
}

/// Runs each frame by itself, so that a crash names its frame. `killers` are known already and not tried.
std::vector<FrameRow> run_one_by_one(const Capture& capture, MethodPool& pool, BatchOptions options, Journal& journal,
                                     const std::set<std::size_t>& killers,
                                     const std::function<void(const FrameRow&)>& on_frame) {
    const std::string killer = journal.facts().begun;
    std::vector<FrameRow> rows;
    for (const std::size_t index : std::exchange(options.frames, {})) {
        if (capture.entries[index].name == killer || killers.contains(index)) {
            rows.push_back(crash_row(capture, index));
            for (const auto& file : files_of(capture.entries[index], options.outputs)) {
                std::error_code gone_already;
                std::filesystem::remove(file, gone_already);
            }
            on_frame(rows.back());
            continue;
        }
        if (!options.stop || !*options.stop)
            journal.begin_alone(capture.entries[index].name);
        options.frames = {index};
        std::ranges::move(run_batch(capture, pool, options, on_frame), std::back_inserter(rows));
        if (rows.back().status == FrameStatus::skipped && rows.back().fault == Fault::outage)
            break;
    }
    return rows;
}

} // namespace

std::string settings_key(const RunReport& report, const Outputs& outputs, const DepthNoise& noise,
                         const std::string& light) {
    std::vector<std::string> parts = {
        report.method, capture_text(report.capture), outputs_text(outputs), std::string(name_of(report.registration)),
        fmt::format("{} {} {} {}", noise.floor_m, noise.per_z2, noise.correlation_px, noise.flies())};
    if (!light.empty())
        parts.push_back(light);
    for (const Stage& stage : report.settings)
        for (const Parameter& row : stage.rows)
            if (row.affects == Affects::results) // of others the key has what follows from them
                parts.push_back(row_text(row));
    return key_of(parts);
}

std::string task_key(const std::vector<Stage>& settings, const Capture& capture, const std::vector<std::size_t>& frames,
                     bool together) {
    std::vector<std::string> parts = {capture_text(capture)};
    if (together && !capture.entries.empty())
        parts.push_back(around(capture, 0, capture.entries.size()));
    for (const Stage& stage : settings)
        for (const Parameter& row : stage.rows)
            if (row.affects != Affects::nothing)
                parts.push_back(row_text(row));
    std::string listed; // hashed from time to time: all stamps of a million frames would take as much as their listing
    constexpr std::size_t most = 1 << 20;
    for (const std::size_t index : frames) {
        listed += stamps(capture.entries[index]) + "\n";
        if (listed.size() > most)
            listed = hash_of(listed);
    }
    parts.push_back(std::move(listed));
    return key_of(parts);
}

std::optional<std::vector<FrameRow>> rows_if_complete(const Journal& journal, const std::string& task,
                                                      const Capture& capture, const std::vector<std::size_t>& frames,
                                                      bool retry) {
    if (journal.facts().complete != task)
        return std::nullopt;
    std::vector<FrameRow> rows;
    for (const std::size_t index : frames) {
        auto row = journal.done(capture.entries[index], std::nullopt, retry);
        if (!row)
            return std::nullopt;
        shorten(*row);
        rows.push_back(*std::move(row));
    }
    return rows;
}

std::vector<FrameRow> run_recorded(const Capture& capture, MethodPool& pool, const BatchOptions& options,
                                   const Recording& recording, const std::function<void(const FrameRow&)>& on_frame) {
    Journal& journal = recording.journal;
    const auto settings_of = [&](std::size_t index) {
        const std::string others = around(capture, index, options.sequence ? options.sequence->reach() : 0);
        return others.empty() ? recording.settings : key_of({recording.settings, others});
    };
    std::map<std::size_t, FrameRow> rows; // by index
    std::set<std::size_t> kept;           // in options.recording already
    BatchOptions left = options;
    left.frames.clear();
    left.short_rows = true;
    for (const std::size_t index : options.frames) {
        auto row = journal.done(capture.entries[index], settings_of(index), recording.retry);
        if (row && options.recording && is_done(row->status)) {
            // Killed before the file had the frame, or the file is gone.
            if (options.recording->has(capture.entries[index].name))
                kept.insert(index);
            else
                row.reset();
        }
        if (row) {
            shorten(*row);
            rows.emplace(index, *std::move(row)).first->second.index = index;
        } else {
            left.frames.push_back(index);
        }
    }
    std::set<std::size_t> killers; // that share a tar with a frame that is left
    if (recording.tars) {
        left.frames = recording.tars->with_neighbours(left.frames);
        for (const std::size_t index : left.frames)
            if (const auto row = rows.extract(index); !row.empty() && row.mapped().fault == Fault::crash)
                killers.insert(index);
    }
    journal.forget(capture, left.frames);
    if (options.recording)
        options.recording->begin(options.frames, std::move(kept));
    const auto record = [&](const FrameRow& row) {
        if (recording.tars) {
            FrameRow moved = row;
            const std::vector<std::uintmax_t> sizes = recording.tars->add(moved);
            journal.add(moved, capture.entries[row.index], settings_of(row.index), recording.device, &sizes);
        } else {
            journal.add(row, capture.entries[row.index], settings_of(row.index), recording.device);
        }
        if (recording.finished && row.status != FrameStatus::skipped && row.fault != Fault::outage)
            ++*recording.finished;
        if (on_frame)
            on_frame(row);
    };
    const bool one_by_one = recording.carefully || !killers.empty();
    for (FrameRow& row : one_by_one ? run_one_by_one(capture, pool, left, journal, killers, record)
                                    : run_batch(capture, pool, left, record))
        rows.insert_or_assign(row.index, std::move(row));
    if (recording.tars)
        for (const std::size_t index : left.frames)
            if (const auto row = rows.find(index);
                row != rows.end() && row->second.fault != Fault::outage && !recording.tars->has(index)) {
                row->second = skipped_row(capture, index);
                row->second.why = "the other frames of its tar are not done; --resume computes all of them";
            }
    std::vector<FrameRow> all;
    all.reserve(options.frames.size());
    bool finished = true;
    TaskSums sums;
    const std::vector<std::string> folders{capture.path.string(), journal.facts().stored.in};
    for (const std::size_t index : options.frames) {
        FrameRow row = rows.contains(index) ? std::move(rows.at(index)) : skipped_row(capture, index);
        finished = finished && row.status != FrameStatus::skipped && row.fault != Fault::outage;
        sums.add(row, folders);
        all.push_back(std::move(row));
    }
    if (finished)
        journal.complete(recording.task, sums);
    return all;
}

} // namespace scanshade
