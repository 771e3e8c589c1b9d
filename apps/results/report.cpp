// The reports of a run: frames.csv, a row per frame, and manifest.json, which is enough to run it again.
#include "apps/results/report.h"

#include "apps/command_line.h"
#include "apps/csv.h"
#include "apps/doubts/checks.h"
#include "apps/frame/outputs.h"
#include "apps/json.h"
#include "io/output_file.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <tbb/info.h>
#include <type_traits>
#include <unordered_set>
#include <utility>

namespace scanshade {
namespace {

std::string number(double value, int digits) { return std::isnan(value) ? "" : fmt::format("{:.{}f}", value, digits); }

/// JSON has no NaN: unknown values are null.
json known(double value, int digits = 4) {
    const double scale = std::pow(10.0, digits);
    return std::isfinite(value) ? json(std::round(value * scale) / scale) : json();
}

/// Of a capture in an arbitrary unit, settings in metres are left out: they are not in metres there.
json settings_json(const std::vector<Stage>& stages, const LengthUnit& unit) {
    json settings = json::object();
    for (const Stage& stage : stages)
        for (const Parameter& row : stage.rows)
            if (!unit.arbitrary() || row.unit != "m")
                settings[stage.title][row.name] = value_json(row);
    return settings;
}

/// In the recording's own unit, or metres.
Eigen::Isometry3d told(Eigen::Isometry3d pose, const LengthUnit& unit) {
    if (unit.arbitrary())
        pose.translation() *= unit.units_per_length;
    return pose;
}

json capture_json(const RunReport& report) {
    const Capture& capture = report.capture;
    std::vector<std::string> warnings = capture.warnings;
    json text{{"path", capture.path.string()}, {"kind", capture.kind}, {"frames", capture.entries.size()}};
    text["camera"] = capture.camera ? to_json(*capture.camera) : json();
    text["depth"] = {{"encoding", capture.depth.name},
                     {"units_per_metre", capture.depth.units_per_metre},
                     {"origin", capture.depth.origin}};
    if (capture.unit.arbitrary()) {
        text["depth"].erase("units_per_metre");
        text["length_unit"] = {{"name", capture.unit.name()},
                               {"arbitrary", true},
                               {"median_depth_units", known(capture.unit.told(capture.median_depth), 9)}};
    }
    if (const DepthCorrection& c = capture.depth_correction; c.any())
        text["depth"]["correction"] = {{"scale", c.scale}, {"offset_m", c.offset_m}, {"curve_per_m", c.curve_per_m}};
    if (capture.colour_camera)
        text["colour_camera"] = to_json(*capture.colour_camera);
    text["registration"] = {{"registered", name_of(report.registration)}, {"reason", report.registration_reason}};
    text["warnings"] = warnings;
    return text;
}

json passes_json(const Timings& passes) {
    json text = json::array(); // a list: a pass may run twice under one name
    for (const auto& [pass, ms] : passes)
        text.push_back({{"pass", pass}, {"ms", known(ms)}});
    return text;
}

/// The upper three rows of world_from_camera, row by row.
json pose_json(const Eigen::Isometry3d& pose, int digits) {
    json numbers = json::array();
    for (int i = 0; i < 12; ++i)
        numbers.push_back(known(pose.matrix()(i / 4, i % 4), digits));
    return numbers;
}

json result_json(const FrameRow& row, bool with_camera, const CaptureEntry& entry, const LengthUnit& unit) {
    json text{{"index", row.index}, {"name", row.name}, {"status", name_of(row.status)}};
    if (!row.why.empty())
        text["why"] = row.why;
    if (any_doubt(row.findings))
        text["doubts"] = doubts_in(row.findings);
    if (!row.size.empty())
        text["size"] = {row.size.width, row.size.height};
    if (with_camera && !row.size.empty())
        text["camera"] = to_json(row.camera);
    if (row.fault != Fault::none)
        text["fault"] = name_of(row.fault);
    if (entry.world_from_camera)
        text["world_from_camera"] = pose_json(told(*entry.world_from_camera, unit), unit.arbitrary() ? 9 : 6);
    text["valid_share"] = known(row.valid_share);
    text["coverage"] = known(row.coverage);
    text["mean_visibility"] = known(row.mean_visibility);
    if (std::isfinite(row.expected_error))
        text["expected_error"] = known(row.expected_error, 5);
    if (row.other_frames > 0)
        text["other_frames"] = row.other_frames;
    text["warnings"] = row.warnings;
    return text;
}

json frame_json(const FrameRow& row, bool with_camera, const CaptureEntry& entry, const LengthUnit& unit) {
    json text = result_json(row, with_camera, entry, unit);
    text["ms"] = stage_json(row.ms);
    text["passes"] = passes_json(row.passes);
    if (!row.notes.empty())
        text["notes"] = row.notes;
    text["files"] = json::array();
    for (const auto& file : row.files)
        text["files"].push_back(file.generic_string());
    return text;
}

/// With `blanks` before every line but the first.
std::string indented(const std::string& text, const std::string& blanks) {
    std::string result;
    for (const char c : text)
        c == '\n' ? result += '\n' + blanks : result += c;
    return result;
}

json totals_json(const RunReport& report) {
    StageTimes sum;
    for (const FrameRow& row : report.frames)
        sum = sum + row.ms;
    const std::size_t ok = count(report.frames, FrameStatus::ok);
    const Rates rates = rates_of(report);
    return {{"frames", report.frames.size()},
            {"ok", ok},
            {"doubtful", count(report.frames, FrameStatus::doubtful)},
            {"failed", count(report.frames, FrameStatus::failed)},
            {"skipped", count(report.frames, FrameStatus::skipped)},
            {"took_ms", known(report.took_ms, 3)},
            {"done_now", report.done_now},
            {"frames_per_second", known(rates.pipeline, 2)},
            {"stage_frames_per_second", stage_json(rates.stage)},
            {"slowest_stage", rates.slowest},
            {"share_of_slowest_stage", known(rates.share_of_slowest)},
            {"device_busy_share", known(rates.device_busy)},
            {"stage_ms", stage_json(sum)},
            {"peak_memory_mib", known(report.peak_mib, 1)}};
}

constexpr const char* whole_recording = "run.mcap"; ///< of a capture, not of a block of it

/// What the folder of results lists of a file: ao/NAME.png, but of a tar's or a tileset's files these.
std::string entry_of(const std::filesystem::path& file) {
    std::filesystem::path entry;
    int parts = 0;
    for (const std::filesystem::path& part : file)
        if (++parts <= 2)
            entry /= part;
    return entry.generic_string();
}

/// The files in the folders of results without those in `own`, sorted.
std::vector<std::string> files_of_others(const std::filesystem::path& folder,
                                         const std::unordered_set<std::string>& own) {
    std::vector<std::string> others;
    std::vector<std::string> parts(result_folders.begin(), result_folders.end());
    parts.emplace_back(tar_folder);
    for (const std::string& part : parts) {
        std::error_code none_there;
        for (const auto& entry : std::filesystem::directory_iterator(folder / part, none_there)) {
            const std::string name = entry.path().filename().string(), whole = fmt::format("{}/{}", part, name);
            if (!name.starts_with('.') && !own.contains(whole))
                others.push_back(whole);
        }
    }
    if (std::error_code ignored;
        !own.contains(whole_recording) && std::filesystem::exists(folder / whole_recording, ignored))
        others.emplace_back(whole_recording);
    std::ranges::sort(others);
    return others;
}

std::string utc(std::chrono::system_clock::time_point time) {
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::to_time_t(time)));
}

} // namespace

std::string csv_head() {
    return "index,name,status,why,width,height,valid_share,coverage,mean_visibility,expected_error,"
           "load_ms,project_ms,compute_ms,attach_ms,write_ms,warnings\n";
}

std::string csv_line(const FrameRow& row) {
    const auto ms = [](double value) { return number(value, 2); };
    const bool loaded = !row.size.empty();
    return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", row.index, csv_field(row.name),
                       name_of(row.status), csv_field(reason_of(row)), loaded ? std::to_string(row.size.width) : "",
                       loaded ? std::to_string(row.size.height) : "", number(row.valid_share, 4),
                       number(row.coverage, 4), number(row.mean_visibility, 4), number(row.expected_error, 4),
                       ms(row.ms.load), ms(row.ms.project), ms(row.ms.compute), ms(row.ms.attach), ms(row.ms.write),
                       csv_field(fmt::format("{}", fmt::join(row.warnings, "; "))));
}

std::string csv_line(const std::string& capture, const FrameRow& row) {
    return csv_field(capture) + "," + csv_line(row);
}

json stage_json(const StageTimes& ms) {
    return {{"load", known(ms.load, 3)},
            {"project", known(ms.project, 3)},
            {"compute", known(ms.compute, 3)},
            {"attach", known(ms.attach, 3)},
            {"write", known(ms.write, 3)}};
}

Rates rates_of(const RunReport& report) {
    const auto done = static_cast<double>(report.done_now);
    const int cores = tbb::info::default_concurrency();
    Rates rates;
    rates.pipeline = report.took_ms > 0 ? done * 1000 / report.took_ms : 0;
    const double could_ms = report.took_ms * static_cast<double>(report.at_once);
    rates.device_busy = could_ms > 0 ? report.ms_now.compute / could_ms : 0;
    double least = std::numeric_limits<double>::infinity();
    const auto stage = [&](const char* name, double StageTimes::*ms, int at_once) {
        const double rate =
            report.ms_now.*ms > 0 && done > 0 ? done * 1000 * at_once / report.ms_now.*ms : std::nan("");
        rates.stage.*ms = rate;
        if (rate < least) {
            least = rate;
            rates.slowest = name;
            rates.share_of_slowest = rates.pipeline / rate;
        }
    };
    stage("load", &StageTimes::load, cores);
    stage("project", &StageTimes::project, cores);
    stage("compute", &StageTimes::compute, static_cast<int>(report.at_once));
    stage("attach", &StageTimes::attach, cores);
    stage("write", &StageTimes::write, cores);
    return rates;
}

std::string describe(const Rates& rates) {
    const std::string share =
        rates.slowest.empty() ? "" : fmt::format(", {:.0f} % of {} alone", 100 * rates.share_of_slowest, rates.slowest);
    return fmt::format("{:.1f} frames/s{}", rates.pipeline, share);
}

std::size_t count(const std::vector<FrameRow>& rows, FrameStatus status) {
    return static_cast<std::size_t>(
        std::count_if(rows.begin(), rows.end(), [&](const FrameRow& row) { return row.status == status; }));
}

void write_frames_csv(const std::filesystem::path& file, const std::vector<FrameRow>& frames) {
    std::string text = csv_head();
    for (const FrameRow& row : frames)
        text += csv_line(row);
    write_atomically(file, text);
}

json manifest_head(const RunReport& report) {
    json head{{"program", "scanshade"},
              {"version", SCANSHADE_VERSION},
              {"command_line", command_line()},
              {"started", utc(report.started)},
              {"device",
               {{"name", report.device.name},
                {"kind", report.device.kind},
                {"driver", report.device.driver},
                {"api", report.device.api},
                {"count", report.devices},
                {"frames_at_once", report.at_once}}},
              {"method", report.method},
              {"settings", settings_json(report.settings, report.capture.unit)},
              {"capture", capture_json(report)},
              {"depth_noise", report.depth_noise},
              {"budget", report.budget},
              {"outlook", report.outlook},
              {"shading", report.shading},
              {"recording", report.recording.empty() ? json() : json(report.recording)},
              {"totals", totals_json(report)}};
    if (!report.radius.empty())
        head["radius"] = report.radius;
    if (!report.light.empty())
        head["light"] = report.light;
    if (!report.colour_encoding.empty())
        head["colour_encoding"] = report.colour_encoding;
    return head;
}

page::Row page_row(const FrameRow& row, const CaptureEntry& entry, const LengthUnit& unit) {
    page::Row shown{.index = row.index,
                    .name = row.name,
                    .status = std::string(name_of(row.status)),
                    .why = reason_of(row),
                    .fault = row.fault == Fault::none ? "" : std::string(name_of(row.fault)),
                    .width = row.size.width,
                    .height = row.size.height,
                    .valid_share = row.valid_share,
                    .coverage = row.coverage,
                    .mean_visibility = row.mean_visibility,
                    .ms = {row.ms.load, row.ms.project, row.ms.compute, row.ms.attach, row.ms.write},
                    .warnings = row.warnings,
                    .notes = row.notes,
                    .files = {},
                    .world_from_camera = {}};
    if (entry.world_from_camera)
        shown.world_from_camera = told(*entry.world_from_camera, unit);
    if (std::isfinite(row.expected_error))
        shown.errors = {{"expected", row.expected_error}};
    for (const auto& file : row.files)
        shown.files.push_back(file.generic_string());
    return shown;
}

json sample_json(const FrameRow& row, const CaptureEntry& entry, const LengthUnit& unit) {
    json text = result_json(row, true, entry, unit);
    if (entry.stamp_s)
        text["stamp_s"] = *entry.stamp_s;
    return text;
}

std::vector<std::string> write_manifest(const std::filesystem::path& file, const RunReport& report,
                                        const std::function<FrameRow(const FrameRow&)>& whole) {
    std::vector<std::string> left_alone;
    const std::string all = text_of(manifest_head(report)), head = all.substr(0, all.rfind("\n}"));
    write_atomically(file, [&](const std::filesystem::path& target) {
        std::ofstream stream(target, std::ios::binary);
        stream.exceptions(std::ios::failbit | std::ios::badbit);
        stream << head
               << ",\n  \"frames\": ["; // one by one: thousands in one value would take most of the run's memory
        const char* between = "";
        std::unordered_set<std::string> own{report.recording};
        for (const FrameRow& row : report.frames) {
            const FrameRow all_of_row = whole(row);
            for (const auto& each : all_of_row.files)
                own.insert(entry_of(each));
            stream << std::exchange(between, ",") << "\n    "
                   << indented(text_of(frame_json(all_of_row, !report.capture.camera || report.capture.unit.arbitrary(),
                                                  report.capture.entries.at(row.index), report.capture.unit)),
                               "    ");
        }
        stream << (report.frames.empty() ? "]" : "\n  ]");
        left_alone = report.alone ? files_of_others(file.parent_path(), own) : std::vector<std::string>();
        stream << ",\n  \"not_of_this_run\": " << indented(text_of(json(left_alone)), "  ") << "\n}\n";
        stream.flush();
    });
    return left_alone;
}

void write_checks(const std::filesystem::path& file, const std::function<void(const AddChecks&)>& rows) {
    json checks = json::object();
    for (const CheckRow& row : all_checks())
        checks[row.name] = {{"of", row.subject}, {"value", row.statistic}, {"doubtful", row.doubtful}};
    const auto number = [](double value) { return std::isfinite(value) ? fmt::format("{:.6g}", value) : "null"; };
    write_atomically(file, [&](const std::filesystem::path& target) {
        std::ofstream stream(target, std::ios::binary);
        stream.exceptions(std::ios::failbit | std::ios::badbit);
        stream << "{\n  \"checks\": " << indented(text_of(checks), "  ") << ",\n  \"frames\": [";
        const char* between = "";
        rows([&](const FrameRow& row) {
            std::string found; // by hand: values of JSON for each number would take a tenth of a fast run
            for (const Finding& finding : row.findings)
                fmt::format_to(std::back_inserter(found), R"({}{{"check":"{}","value":{},"limit":{},"doubtful":{}}})",
                               found.empty() ? "" : ",", row_of(finding.check).name, number(finding.value),
                               number(finding.limit), is_doubt(finding));
            stream << std::exchange(between, ",") << "\n    {\"index\":" << row.index
                   << ",\"name\":" << json(row.name).dump(-1, ' ', false, json::error_handler_t::replace)
                   << ",\"found\":[" << found << "]}";
        });
        stream << (*between ? "\n  ]\n}\n" : "]\n}\n");
        stream.flush();
    });
}

} // namespace scanshade
