// Lines of JSON, one write and one sync each; the last line on a frame counts.
#include "apps/results/journal.h"

#include "apps/doubts/checks.h"
#include "apps/json.h"
#include "io/content_hash.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <sys/file.h>
#include <unistd.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

// ---------------------------------------------------------------------------------------------------- rows as JSON

constexpr std::array stages = {std::pair("load", &StageTimes::load), std::pair("project", &StageTimes::project),
                               std::pair("compute", &StageTimes::compute), std::pair("attach", &StageTimes::attach),
                               std::pair("write", &StageTimes::write)};

double number_or_nan(const json& value) {
    return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

json findings_json(const Findings& findings) {
    json text = json::array();
    for (const Finding& finding : findings) {
        text.push_back({row_of(finding.check).name, finding.value, finding.limit});
        if (!finding.sentence.empty())
            text.back().push_back(finding.sentence);
    }
    return text;
}

Findings findings_from(const json& text) {
    Findings findings;
    for (const json& each : text)
        findings.push_back({check_named(each.at(0).get<std::string>()), number_or_nan(each.at(1)),
                            number_or_nan(each.at(2)), each.size() > 3 ? each.at(3).get<std::string>() : ""});
    return findings;
}

json row_json(
    const FrameRow& row) { // nlohmann writes NaN as null and every other double so that it reads back the same
    json text{{"index", row.index},
              {"name", row.name},
              {"status", name_of(row.status)},
              {"why", row.why},
              {"fault", name_of(row.fault)},
              {"size", {row.size.width, row.size.height}},
              {"valid", row.valid_share},
              {"coverage", row.coverage},
              {"visibility", row.mean_visibility},
              {"camera", to_json(row.camera)},
              {"warnings", row.warnings}};
    for (const auto& [name, stage] : stages)
        text["ms"][name] = row.ms.*stage;
    text["passes"] = json::array();
    for (const auto& [pass, ms] : row.passes)
        text["passes"].push_back({pass, ms});
    text["files"] = json::array();
    for (const fs::path& file : row.files)
        text["files"].push_back(file.generic_string());
    if (!row.notes.empty())
        text["notes"] = row.notes;
    if (!row.findings.empty())
        text["findings"] = findings_json(row.findings);
    if (std::isfinite(row.expected_error))
        text["expected_error"] = row.expected_error;
    if (row.other_frames > 0)
        text["other_frames"] = row.other_frames;
    return text;
}

Camera camera_from(const json& text) {
    Camera camera;
    camera.pinhole = {text.at("fx"), text.at("fy"), text.at("cx"), text.at("cy"),
                      cv::Size(text.at("width").get<int>(), text.at("height").get<int>())};
    if (text.contains("fisheye"))
        camera.distortion = kannala_brandt(text["fisheye"].get<std::vector<double>>());
    else if (text.contains("distortion"))
        camera.distortion = brown_conrady(text["distortion"].get<std::vector<double>>());
    camera.origin = text.at("origin");
    return camera;
}

template <class Enum>
Enum named(const std::string& name, std::initializer_list<Enum> all) {
    for (const Enum each : all)
        if (name_of(each) == name)
            return each;
    throw Error("'" + name + "' is unknown");
}

FrameRow row_from(const json& text) {
    FrameRow row;
    row.index = count_at(text, "index");
    row.name = text.at("name");
    row.status =
        named(text.at("status"), {FrameStatus::ok, FrameStatus::doubtful, FrameStatus::failed, FrameStatus::skipped});
    row.why = text.at("why");
    row.fault = named(text.at("fault"), {Fault::none, Fault::input, Fault::outage, Fault::internal, Fault::crash});
    row.size = {text.at("size").at(0).get<int>(), text.at("size").at(1).get<int>()};
    row.valid_share = number_or_nan(text.at("valid"));
    row.coverage = number_or_nan(text.at("coverage"));
    row.mean_visibility = number_or_nan(text.at("visibility"));
    row.expected_error = text.contains("expected_error") ? number_or_nan(text["expected_error"]) : std::nan("");
    row.other_frames = text.contains("other_frames") ? count_at(text, "other_frames") : 0;
    row.camera = camera_from(text.at("camera"));
    row.warnings = text.at("warnings").get<std::vector<std::string>>();
    for (const auto& [name, stage] : stages)
        row.ms.*stage = number_or_nan(text.at("ms").at(name));
    for (const json& pass : text.at("passes"))
        row.passes.emplace_back(pass.at(0).get<std::string>(), number_or_nan(pass.at(1)));
    for (const json& file : text.at("files"))
        row.files.emplace_back(file.get<std::string>());
    if (text.contains("notes"))
        row.notes = text["notes"].get<std::vector<std::string>>();
    if (text.contains("findings"))
        row.findings = findings_from(text["findings"]);
    if (text.contains("doubts")) // of a version without checks
        for (const json& doubt : text["doubts"])
            row.findings.push_back({Check::other, 1, 0.5, doubt.get<std::string>()});
    return row;
}

Record record_from(const json& line) {
    Record record{row_from(line.at("frame")), line.at("settings"), line.at("stamp"), line.at("input"),
                  line.at("sizes").get<std::vector<std::uintmax_t>>()};
    if (record.sizes.size() != record.row.files.size())
        throw Error("not a size for each file");
    return record;
}

/// The kind of a line: its first key.
std::string kind_of(const json& line) { return line.empty() ? "" : line.begin().key(); }

void take_stored(const std::string& kind, const json& line, StoredFacts& stored) {
    if (kind == "fetched") {
        stored.in = line["fetched"];
        stored.frames = count_at(line, "frames");
        stored.trouble.clear();
    } else if (kind == "hook") {
        stored.trouble = line["hook"].get<std::string>() + ": " + line.at("why").get<std::string>();
    } else if (kind == "computed") {
        stored.computed = line["computed"];
        stored.code = line.at("code");
    } else if (kind == "refused") {
        stored.refused = line["refused"];
    } else if (kind == "ended") {
        stored.ended = line["ended"];
        stored.trouble.clear();
    }
}

void take_line(const json& line, JournalFacts& facts) {
    const std::string kind = kind_of(line);
    if (kind == "frame") {
        Record record = record_from(line);
        if (facts.begun == record.row.name)
            facts.begun.clear();
        facts.complete.clear();
        facts.stored.computed.clear();
        facts.stored.ended.clear();
        facts.records.insert_or_assign(record.row.name, std::move(record));
    } else if (kind == "process") {
        facts.host = line["process"].at("host");
        facts.device = line["process"].at("device");
        facts.started = line["process"].at("started");
        facts.begun.clear();
    } else if (kind == "again") {
        for (const std::string& name : line["again"].get<std::vector<std::string>>())
            facts.records.erase(name);
        facts.complete.clear();
        facts.stored.computed.clear();
        facts.stored.ended.clear();
    } else if (kind == "begun") {
        facts.begun = line["begun"];
    } else if (kind == "complete") {
        facts.complete = line["complete"];
    } else {
        take_stored(kind, line, facts.stored);
    }
}

/// Calls take(line, where it begins) for every line of JSON; skips lines that `take` cannot read.
void for_each_line(const fs::path& file, const std::function<void(const json&, std::int64_t)>& take) {
    std::ifstream stream(file, std::ios::binary);
    std::int64_t at = 0;
    for (std::string line; std::getline(stream, line); at += static_cast<std::int64_t>(line.size()) + 1) {
        const json text = parsed_or_discarded(line);
        if (!text.is_object())
            continue;
        try {
            take(text, at);
        } catch (const std::exception&) { // another version's line: its frame is done again
            continue;
        }
    }
}

// ---------------------------------------------------------------------------------------------------- inputs

std::vector<fs::path> inputs_of(const CaptureEntry& entry) {
    std::vector<fs::path> files;
    for (const StoredPath* file : {&entry.colour, &entry.depth, &entry.cloud})
        if (!file->empty())
            files.push_back(*file);
    return files;
}

/// What a frame's results depend on besides its files. The position of colour depends on the camera's motion.
std::string listed(const CaptureEntry& entry) {
    const Motion motion = entry.motion.value_or({});
    const double between_s = entry.stamp_s && entry.colour_stamp_s ? *entry.colour_stamp_s - *entry.stamp_s : 0;
    return fmt::format("{}|{}|{}|{}|", entry.problem, between_s, fmt::join(motion.rotation_per_s, " "),
                       fmt::join(motion.translation_per_s, " "));
}

std::string stamps_of(const CaptureEntry& entry) {
    std::string all = listed(entry);
    for (const fs::path& file : inputs_of(entry))
        all += fmt::format("{}|", stamp_of(file));
    return all;
}

/// Unreadable content is a content of its own: the frame fails again until it can be read.
std::string hashes_of(const CaptureEntry& entry) { return listed(entry) + content_hash_of(entry); }

/// Of a journal that ends with its task's sums, enough for these and what hooks add.
constexpr std::streamoff journal_end_bytes = 1 << 15;

std::string host_name() {
    std::array<char, 256> name = {};
    ::gethostname(name.data(), name.size() - 1);
    return name.data();
}

[[noreturn]] void fail(const fs::path& file, const std::string& what) {
    throw Outage(fmt::format("{}: {}: {}", file.string(), what, std::strerror(errno)));
}

/// On file systems without locks (Lustre without flock) every run counts as the only one in its folder.
bool no_locks_here(int error) { return error == ENOSYS || error == EOPNOTSUPP || error == ENOLCK; }

bool is_journal(const fs::path& file) {
    const std::string name = file.filename().string();
    return name.starts_with("journal") && name.ends_with(".jsonl");
}

/// Independent of the folder that the program was started in; JSON holds UTF-8.
std::string path_of(const Capture& capture) {
    std::error_code ignored;
    return as_utf8(fs::weakly_canonical(capture.path, ignored).string());
}

std::vector<fs::path> journals_in(const fs::path& folder) {
    std::vector<fs::path> files;
    std::error_code none_there;
    for (const auto& entry : fs::directory_iterator(folder, none_there))
        if (is_journal(entry.path()))
            files.push_back(entry.path());
    std::ranges::sort(files);
    return files;
}

} // namespace

fs::path journal_file(const fs::path& folder, const std::string& block) {
    return folder / (block.empty() ? "journal.jsonl" : "journal." + block + ".jsonl");
}

JournalFacts read_journal(const fs::path& file) {
    JournalFacts facts;
    for_each_line(file, [&](const json& line, std::int64_t) { take_line(line, facts); });
    return facts;
}

std::optional<JournalEnd> read_journal_end(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary | std::ios::ate);
    if (!stream)
        return std::nullopt;
    stream.seekg(-std::min<std::streamoff>(journal_end_bytes, stream.tellg()), std::ios::end);
    std::string line;
    std::optional<JournalEnd> end;
    bool complete = false;
    while (std::getline(stream, line)) {
        // The first line is mostly cut off. Lines of frames begin anew what the sums had ended.
        if (line.starts_with("{\"frame\":")) {
            end.reset();
            continue;
        }
        const json text = parsed_or_discarded(line);
        if (!text.is_object())
            continue;
        try {
            const std::string kind = kind_of(text);
            if (kind == "sums") {
                complete = false;
                end = JournalEnd{sums_from(text["sums"]), text.at("host"), text.at("device"), {}};
            } else if (kind == "complete") {
                complete = true;
            } else if (kind == "again" || kind == "begun" || kind == "process") {
                end.reset();
            } else if (end) {
                take_stored(kind, text, end->stored);
            }
        } catch (const std::exception&) { // another version's line
            end.reset();
        }
    }
    return complete ? end : std::nullopt;
}

bool has_results(const fs::path& folder) {
    bool any = false;
    for (const fs::path& file : journals_in(folder))
        for_each_line(file, [&](const json& line, std::int64_t) {
            any = any || (kind_of(line) == "frame" && !line.at("frame").at("files").empty());
        });
    return any;
}

std::optional<std::string> other_capture_in(const fs::path& folder, const Capture& capture) {
    std::map<std::string, const CaptureEntry*> entries;
    for (const CaptureEntry& entry : capture.entries)
        entries.emplace(entry.name, &entry);
    std::string recorded;
    bool same = false;
    int compared = 0;
    constexpr int enough = 8; // hashes of whole files take time
    for_each_line(journal_file(folder, ""), [&](const json& line, std::int64_t) {
        const std::string kind = kind_of(line);
        if (kind == "process")
            recorded = line["process"].value("capture", "");
        if (kind != "frame" || same || compared == enough)
            return;
        const Record record = record_from(line);
        if (const auto entry = entries.find(record.row.name); entry != entries.end()) {
            ++compared;
            same = record.stamp == stamps_of(*entry->second) || record.input == hashes_of(*entry->second);
        }
    });
    if (same || recorded.empty() || recorded == path_of(capture))
        return std::nullopt;
    return recorded;
}

bool in_use(const fs::path& file) {
    const int handle = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
    if (handle < 0)
        return false;
    const bool held = ::flock(handle, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    ::close(handle);
    return held;
}

bool is_complete(const fs::path& file, std::string_view kind) {
    constexpr std::streamoff enough = 128;
    std::ifstream stream(file, std::ios::binary | std::ios::ate);
    if (!stream)
        return false;
    stream.seekg(-std::min<std::streamoff>(enough, stream.tellg()), std::ios::end);
    const std::string end{std::istreambuf_iterator<char>(stream), {}};
    const auto last = end.rfind('\n', end.size() < 2 ? 0 : end.size() - 2);
    return end.ends_with("}\n") &&
           end.substr(last == std::string::npos ? 0 : last + 1).starts_with(fmt::format("{{\"{}\":", kind));
}

std::string key_of(const std::vector<std::string>& parts) {
    std::string all = SCANSHADE_VERSION;
    for (const std::string& part : parts)
        all += fmt::format("\n{}:{}", part.size(), part);
    return hash_of(all);
}

Journal::Journal(fs::path folder, const std::string& block, fs::path results, const std::set<std::string>* siblings)
    : folder_(std::move(folder)), file_(journal_file(folder_, block)),
      results_(results.empty() ? folder_ : std::move(results)) {
    std::error_code trouble;
    fs::create_directories(folder_, trouble);
    constexpr int flags = O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC;
    handle_ = ::open(file_.c_str(), flags | O_EXCL, 0666);
    made_ = handle_ >= 0;
    if (handle_ < 0 && errno == EEXIST)
        handle_ = ::open(file_.c_str(), flags, 0666);
    if (handle_ < 0 && errno == ELOOP)
        throw Misuse(file_.string() + ": is a symbolic link, which is not followed: a file is expected");
    for (const int needs_another_folder : {EACCES, EPERM, EROFS, EISDIR})
        if (handle_ < 0 && errno == needs_another_folder)
            throw Misuse(fmt::format("{}: cannot be written: {}", file_.string(), std::strerror(errno)));
    if (handle_ < 0)
        fail(file_, "cannot be opened");
    if (::flock(handle_, LOCK_EX | LOCK_NB) != 0 && !no_locks_here(errno)) {
        const int error = errno;
        ::close(handle_);
        errno = error;
        if (error == EWOULDBLOCK)
            throw Busy(file_.string() + ": another run is at work here");
        fail(file_, "cannot be locked");
    }
    journals_ = journals_in(folder_);
    std::erase_if(journals_, [&](const fs::path& file) {
        return file == file_ || (siblings && siblings->contains(file.filename().string()));
    });
    journals_.push_back(file_); // last, since its lines override the others'
    for (std::size_t journal = 0; journal < journals_.size(); ++journal)
        read_positions(journal);
}

void Journal::read_positions(std::size_t journal) {
    facts_ = {};
    for_each_line(journals_[journal], [&](const json& line, std::int64_t at) {
        take_line(line, facts_);
        for (const auto& [name, record] : facts_.records)
            positions_.insert_or_assign(name, Position{journal, at});
        facts_.records.clear();
        if (kind_of(line) == "again")
            for (const json& name : line["again"])
                positions_.erase(name.get<std::string>());
    });
}

std::optional<Record> Journal::record_of(const std::string& frame) const {
    const auto place = positions_.find(frame);
    if (place == positions_.end())
        return std::nullopt;
    std::ifstream stream(journals_[place->second.journal], std::ios::binary);
    stream.seekg(place->second.at);
    std::string line;
    std::getline(stream, line);
    try {
        return record_from(parsed_json(line));
    } catch (const std::exception&) { // another block's journal, cleared meanwhile
        return std::nullopt;
    }
}

Journal::~Journal() { ::close(handle_); }

void Journal::clear() {
    for (const fs::path& other : journals_in(folder_))
        if (other != file_ && file_ == journal_file(folder_, ""))
            fs::remove(other);
    if (::ftruncate(handle_, 0) != 0)
        fail(file_, "cannot be cleared");
    facts_ = {};
    positions_.clear();
}

bool Journal::files_are_there(const Record& record) const {
    for (std::size_t i = 0; i < record.row.files.size(); ++i) {
        if (size_of_file(results_ / record.row.files[i]) != record.sizes.at(i))
            return false;
    }
    return true;
}

std::optional<FrameRow> Journal::done(const CaptureEntry& entry, const std::optional<std::string>& settings,
                                      bool retry) const {
    std::optional<Record> record = record_of(entry.name);
    if (!record)
        return std::nullopt;
    const bool again = record->row.fault == Fault::outage || (retry && record->row.status == FrameStatus::failed);
    const bool there = record->row.fault == Fault::crash || files_are_there(*record); // a crash leaves at most its row
    if (again || record->settings != settings.value_or(record->settings) || !there)
        return std::nullopt;
    if (record->stamp != stamps_of(entry) && record->input != hashes_of(entry))
        return std::nullopt;
    return std::move(record->row);
}

FrameRow Journal::whole(const FrameRow& row) const {
    std::optional<Record> record = record_of(row.name);
    if (!record)
        return row;
    record->row.index = row.index; // in this listing of the capture
    return std::move(record->row);
}

std::int64_t Journal::append(const std::string& line, Sync sync) {
    // Ends a torn line, as a full disk or a power cut leaves it.
    const off_t end = ::lseek(handle_, 0, SEEK_END);
    char last = '\n';
    if (end > 0 && ::pread(handle_, &last, 1, end - 1) != 1)
        fail(file_, "cannot be read");
    const std::string whole = (last == '\n' ? "" : "\n") + line + "\n";
    if (::write(handle_, whole.data(), whole.size()) != static_cast<ssize_t>(whole.size()))
        fail(file_, "cannot be written");
    const auto now = std::chrono::steady_clock::now();
    if (sync == Sync::now || now - synced_ >= std::chrono::seconds(1)) {
        if (::fdatasync(handle_) != 0)
            fail(file_, "cannot be written");
        synced_ = now;
    }
    return end + (last == '\n' ? 0 : 1);
}

void Journal::set_capture(const Capture& capture) { capture_ = path_of(capture); }

void Journal::add(const FrameRow& row, const CaptureEntry& entry, const std::string& settings,
                  const std::string& device, const std::vector<std::uintmax_t>* sizes) {
    if (row.status == FrameStatus::skipped)
        return;
    if (!std::exchange(introduced_, true)) {
        const auto now = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
        const json process{{"host", host_name()}, {"pid", ::getpid()}, {"device", device},
                           {"capture", capture_}, {"started", now},    {"version", SCANSHADE_VERSION}};
        append(json_line(json{{"process", process}}));
        facts_.host = host_name();
        facts_.device = device;
    }
    Record record{row, settings, stamps_of(entry), hashes_of(entry), {}};
    if (sizes)
        record.sizes = *sizes;
    else
        for (const fs::path& file : row.files)
            record.sizes.push_back(fs::file_size(results_ / file));
    const json line{{"frame", row_json(row)},
                    {"settings", record.settings},
                    {"stamp", record.stamp},
                    {"input", record.input},
                    {"sizes", record.sizes}};
    const std::int64_t at = append(json_line(line), Sync::soon);
    positions_.insert_or_assign(row.name, Position{journals_.size() - 1, at});
    facts_.complete.clear();
    facts_.stored.computed.clear();
    facts_.stored.ended.clear();
}

void Journal::forget(const Capture& capture, const std::vector<std::size_t>& frames) {
    std::vector<std::string> known;
    for (const std::size_t index : frames)
        if (positions_.erase(capture.entries[index].name) > 0)
            known.push_back(capture.entries[index].name);
    if (!known.empty())
        append(json_line(json{{"again", known}}));
}

void Journal::begin_alone(const std::string& frame) { append(json{{"begun", frame}}.dump()); }

void Journal::complete(const std::string& key, const TaskSums& sums) {
    if (facts_.complete == key)
        return;
    const std::string line = json_line(json{{"sums", to_json(sums)}, {"host", facts_.host}, {"device", facts_.device}});
    if (line.size() < journal_end_bytes / 2) // else they are counted anew each time
        append(line, Sync::soon);
    append(json{{"complete", key}}.dump());
    facts_.complete = key;
}

void Journal::fetched(const fs::path& in, std::size_t frames) {
    append(json_line(json{{"fetched", as_utf8(in.string())}, {"frames", frames}}), Sync::soon);
    facts_.stored.in = as_utf8(in.string());
    facts_.stored.frames = frames;
    facts_.stored.trouble.clear();
}

void Journal::hook_failed(const std::string& hook, int attempt, const std::string& reason, const std::string& said) {
    const auto now = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
    append(json_line(
        json{{"hook", hook}, {"try", attempt}, {"why", reason}, {"stderr", said}, {"host", host_name()}, {"at", now}}));
}

void Journal::computed(const std::string& key, int code) {
    append(json_line(json{{"computed", key}, {"code", code}}), Sync::soon);
    facts_.stored.computed = key;
    facts_.stored.code = code;
}

void Journal::ended(const std::string& key, const std::string& refused) {
    if (refused != facts_.stored.refused)
        append(json_line(json{{"refused", refused}}));
    append(json_line(json{{"ended", key}}));
    facts_.stored.ended = key;
    facts_.stored.refused = refused;
}

bool Journal::all_files_are_there() const {
    return std::ranges::all_of(positions_, [&](const auto& each) {
        const auto record = record_of(each.first);
        return record && (record->row.fault == Fault::crash || files_are_there(*record));
    });
}

} // namespace scanshade
