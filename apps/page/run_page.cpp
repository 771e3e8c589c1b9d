// The page of a run. run.js reads what is written here.
#include "apps/page/run_page.h"

#include "apps/page/shell.h"
#include "apps/page/text.h"
#include "io/output_file.h"
#include "io/shallow_json.h"
#include "io/text.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

namespace scanshade::page {
namespace {

namespace fs = std::filesystem;

constexpr std::array stage_names = {"load", "project", "compute", "attach", "write"};

json known(double value, int digits) {
    const double scale = std::pow(10.0, digits);
    return std::isfinite(value) ? json(std::round(value * scale) / scale) : json();
}

/// Trailing nulls of a line say nothing.
void trim(json& line) {
    while (!line.empty() && line.back().is_null())
        line.erase(line.size() - 1);
}

json pose_json(const std::optional<Eigen::Isometry3d>& pose) {
    if (!pose)
        return {};
    json numbers = json::array();
    for (int i = 0; i < 12; ++i)
        numbers.push_back(known(pose->matrix()(i / 4, i % 4), 6));
    return numbers;
}

// ------------------------------------------------------------------------------------------------- from a manifest

std::string text_at(const json& object, const char* key) {
    const auto found = object.find(key);
    return found == object.end() || !found->is_string() ? "" : found->get<std::string>();
}

double number_at(const json& object, const char* key) {
    const auto found = object.find(key);
    return found == object.end() || !found->is_number() ? std::nan("") : found->get<double>();
}

std::vector<std::string> texts_at(const json& object, const char* key) {
    std::vector<std::string> texts;
    if (const auto found = object.find(key); found != object.end() && found->is_array())
        for (const json& text : *found)
            if (text.is_string())
                texts.push_back(text);
    return texts;
}

std::optional<Eigen::Isometry3d> pose_at(const json& object, const char* key) {
    const auto found = object.find(key);
    if (found == object.end() || !found->is_array() || found->size() != 12)
        return std::nullopt;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (int i = 0; i < 12; ++i)
        pose.matrix()(i / 4, i % 4) = (*found)[static_cast<std::size_t>(i)].get<double>();
    return pose;
}

Row row_of(const json& frame) {
    Row row{.index = count_at(frame, "index"),
            .name = frame.at("name"),
            .status = frame.at("status"),
            .why = text_at(frame, "why"),
            .fault = text_at(frame, "fault"),
            .valid_share = number_at(frame, "valid_share"),
            .coverage = number_at(frame, "coverage"),
            .mean_visibility = number_at(frame, "mean_visibility"),
            .warnings = texts_at(frame, "warnings"),
            .notes = texts_at(frame, "notes"),
            .files = texts_at(frame, "files"),
            .world_from_camera = pose_at(frame, "world_from_camera")};
    if (const double expected = number_at(frame, "expected_error"); std::isfinite(expected))
        row.errors = {{"expected", expected}};
    for (const std::string& doubt : texts_at(frame, "doubts"))
        row.why += (row.why.empty() ? "" : "; ") + doubt;
    if (const auto size = frame.find("size"); size != frame.end()) {
        row.width = size->at(0);
        row.height = size->at(1);
    }
    const json ms = frame.value("ms", json::object());
    for (std::size_t i = 0; i < stage_names.size(); ++i)
        row.ms[i] = number_at(ms, stage_names[i]);
    return row;
}

/// The manifest without its frames, each of which `use` gets.
json read_manifest(const fs::path& file, const std::function<void(const json&)>& use) {
    return reading_json(file.string(), [&] {
        bool among_frames = false;
        const auto keep = [&](int depth, json::parse_event_t event, json& value) {
            if (depth > deepest_json)
                throw Error(fmt::format("JSON nested deeper than {} levels", deepest_json));
            if (depth == 1 && event == json::parse_event_t::key)
                among_frames = value == "frames";
            if (depth != 2 || event != json::parse_event_t::object_end || !among_frames)
                return true;
            use(value);
            return false;
        };
        json manifest = json::parse(read_bytes(file), keep);
        if (!manifest.is_object())
            throw Error("a JSON object expected");
        manifest.erase("frames");
        return manifest;
    });
}

/// Numbers, words and lists as people read them.
std::string said(const json& value) {
    if (value.is_string())
        return value;
    return value.is_null() ? "none" : value.dump(-1, ' ', false, json::error_handler_t::replace);
}

} // namespace

void RunPage::add(const Row& row) {
    FileSet files;
    for (const std::string& file : row.files) {
        const std::size_t folder = file.find('/');
        if (folder == std::string::npos || file.find('/', folder + 1) != std::string::npos || file.starts_with('.') ||
            row.name.find('/') != std::string::npos)
            continue; // of a manifest that was tampered with: nothing outside the page's folder is shown
        if (std::string_view(file).substr(folder + 1).starts_with(row.name))
            files.emplace_back(file.substr(0, folder), file.substr(folder + 1 + row.name.size()));
    }
    const auto [set, is_new] = known_.try_emplace(files, sets_.size());
    if (is_new)
        sets_.push_back(files);
    json ms = json::array(), errors = json::object();
    for (const double each : row.ms)
        ms.push_back(known(each, 3));
    trim(ms);
    for (const auto& [name, value] : row.errors)
        errors[name] = known(value, 5);
    json line = {row.index,
                 row.name,
                 row.status,
                 row.why,
                 row.fault,
                 row.width,
                 row.height,
                 known(row.valid_share, 4),
                 known(row.coverage, 4),
                 known(row.mean_visibility, 4),
                 ms.empty() ? json() : ms,
                 row.warnings,
                 row.notes,
                 set->second,
                 pose_json(row.world_from_camera),
                 row.errors.empty() ? json() : errors};
    trim(line);
    lines_ += (lines_.empty() ? "" : ",\n") + for_script(json_line(line));
}

void RunPage::write(const fs::path& folder, json head) const {
    head["file_sets"] = json::array();
    for (const FileSet& set : sets_) {
        json files = json::array();
        for (const auto& [part, extension] : set)
            files.push_back({part, extension});
        head["file_sets"].push_back(files);
    }
    write_atomically(folder / "index.js", [&](const fs::path& file) { // piece by piece: no second copy of the lines
        std::ofstream stream(file, std::ios::binary);
        stream.exceptions(std::ios::failbit | std::ios::badbit);
        stream << "scanshade.set_head(" << for_script(json_line(head)) << ");\nscanshade.add_rows([\n"
               << lines_ << "\n]);\n";
        stream.flush();
    });
    write_atomically(folder / "index.html", run_shell(as_utf8(head.at("title").get<std::string>()) + " - scanshade"));
}

json run_head(const json& manifest) {
    const json capture = manifest.value("capture", json::object()), totals = manifest.value("totals", json::object()),
               device = manifest.value("device", json::object());
    const fs::path path = text_at(capture, "path");
    const std::string name = (path.has_filename() ? path.filename() : path.parent_path().filename()).string();
    json head{{"kind", "run"}, {"version", text_at(manifest, "version")}, {"title", name.empty() ? "run" : name}};
    head["subtitle"] = fmt::format("{} · {} on {} · {}", text_at(capture, "kind"), text_at(manifest, "method"),
                                   text_at(device, "name"), text_at(manifest, "started"));
    json facts = json::array();
    const auto fact = [&](const char* title, double value, int digits, const char* unit) {
        if (std::isfinite(value))
            facts.push_back({title, fmt::format("{:.{}f}{}", value, digits, unit)});
    };
    fact("took", number_at(totals, "took_ms") / 1000, 1, " s");
    fact("frames/s", number_at(totals, "frames_per_second"), 1, "");
    if (const std::string slowest = text_at(totals, "slowest_stage"); !slowest.empty())
        facts.push_back({"slowest stage", slowest});
    fact("peak memory", number_at(totals, "peak_memory_mib"), 0, " MiB");
    head["facts"] = facts;
    json notes = json::array();
    std::vector<std::string> first = texts_at(manifest, "budget");
    std::ranges::move(texts_at(manifest, "outlook"), std::back_inserter(first));
    for (const std::string& sentence : first) // what to expect comes first
        head.contains("lead") ? notes.push_back(sentence) : void(head["lead"] = sentence);
    for (const auto& [key, title] : {std::pair{"radius", "radius: "}, std::pair{"depth_noise", "depth noise: "},
                                     std::pair{"shading", ""}, std::pair{"light", ""}})
        if (const std::string sentence = text_at(manifest, key); !sentence.empty())
            notes.push_back(title + sentence);
    for (const std::string& warning : texts_at(capture, "warnings"))
        notes.push_back("warning: " + warning);
    head["notes"] = notes;
    json details = json::object();
    details["run"] = {{"command line", text_at(manifest, "command_line")},
                      {"capture", text_at(capture, "path")},
                      {"device", fmt::format("{}, {}, {}", text_at(device, "name"), text_at(device, "kind"),
                                             text_at(device, "driver"))},
                      {"camera", said(capture.value("camera", json()))}};
    const json settings = manifest.value("settings", json::object());
    for (const auto& [stage, rows] : settings.items()) {
        json values = json::object();
        for (const auto& [setting, value] : rows.items())
            values[setting] = said(value);
        details[stage] = values;
    }
    head["details"] = details;
    if (const auto cloud = manifest.find("recording_points"); cloud != manifest.end())
        head["recording_points"] = *cloud;
    return head;
}

bool has_page(const fs::path& folder) {
    std::error_code none_there;
    return fs::exists(folder / "index.html", none_there) && fs::exists(folder / "index.js", none_there);
}

void remove_page(const fs::path& folder) {
    for (const char* file : {"index.html", "index.js"}) {
        std::error_code gone_already;
        fs::remove(folder / file, gone_already);
    }
    std::error_code trouble;
    for (int part = 0; fs::remove(folder / fmt::format("{}.{:03}.js", recording_stem, part), trouble); ++part)
        continue;
}

void write_from_manifests(const fs::path& folder, const std::vector<fs::path>& manifests) {
    RunPage page;
    json first;
    for (const fs::path& file : manifests) {
        const json manifest = read_manifest(
            file, [&](const json& frame) { page.add(reading_json(file.string(), [&] { return row_of(frame); })); });
        if (first.is_null())
            first = manifest;
    }
    if (first.is_null())
        throw Error(folder.string() + ": no manifest.json, so nothing says what was run");
    if (manifests.size() > 1)
        first.erase("totals");       // of one block; several may have run at the same time
    first.erase("recording_points"); // a path of the manifest's own could lead out of the folder
    if (fs::exists(folder / fmt::format("{}.000.js", recording_stem)))
        first["recording_points"] = recording_stem;
    page.write(folder, reading_json(manifests.front().string(), [&] { return run_head(first); }));
}

} // namespace scanshade::page
