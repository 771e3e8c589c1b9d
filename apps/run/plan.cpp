// `scanshade plan`: finds the captures of a dataset, whatever their layouts, and cuts them into tasks.
#include "apps/command.h"
#include "apps/jobs/folder_probe.h"
#include "apps/jobs/job.h"
#include "apps/jobs/sources.h"
#include "apps/method_settings.h"
#include "apps/slice.h"
#include "io/captures/capture.h"
#include "io/captures/listing/layouts.h"
#include "io/files.h"
#include "io/images/format.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <optional>
#include <set>
#include <span>

namespace scanshade {
namespace {

namespace fs = std::filesystem;

// ---------------------------------------------------------------------------------------------------- finding captures

/// Why a folder is not searched though it holds images and clouds; empty: it may be a capture.
std::string result_in(const fs::path& folder) {
    if (is_job(folder))
        return "a planned job";
    const bool report = fs::exists(folder / "journal.jsonl") || fs::exists(folder / "frames.csv");
    return report ? "results of an earlier run" : "";
}

struct Found {
    fs::path path;
    std::string name; ///< its path in its dataset
    std::optional<Capture> capture;
    std::string refused;          ///< why it cannot be opened
    std::string passed_over = {}; ///< why it is neither opened nor searched
};

Found passed_over(const fs::path& path, const std::string& why) { return {path, "", std::nullopt, "", why}; }

/// Without links. Those of archives are not followed.
fs::path whole_path(const fs::path& path) {
    std::error_code not_on_disk;
    fs::path whole = fs::canonical(path, not_on_disk);
    return not_on_disk ? fs::absolute(path).lexically_normal() : whole;
}

struct Content {
    std::vector<fs::path> folders; ///< sorted, without hidden ones; archives and recordings, too
    std::vector<fs::path> hidden;  ///< folders whose names begin with '.'
    std::size_t files = 0;
    std::set<std::string> kinds; ///< extensions of the files, at most a few
    std::error_code unreadable;
};

bool begins_as_recording(const fs::path& file) {
    try {
        return is_recording_file(file);
    } catch (const Error&) { // nobody may read it
        return false;
    }
}

/// `recordings`: files that hold one count as folders.
Content content_of(const fs::path& folder, bool recordings = false) {
    Content content;
    constexpr std::size_t most_kinds = 5;
    for (const auto& [name, kind] : items_in(folder, content.unreadable)) {
        const fs::path path = folder / name;
        if (kind == FolderItem::Kind::folder || (lower_extension(path) == ".tar" && is_tar(path)) ||
            (recordings && name[0] != '.' && begins_as_recording(path))) {
            (name[0] == '.' ? content.hidden : content.folders).push_back(path);
            continue;
        }
        ++content.files;
        if (content.kinds.size() < most_kinds)
            content.kinds.insert(path.has_extension() ? lower_extension(path) : "no extension");
    }
    std::ranges::sort(content.folders, natural_less, [](const fs::path& path) { return path.filename().string(); });
    return content;
}

/// Folders in a capture's folder that hold none of its frames: they may be captures themselves.
void report_unused_folders(const Capture& capture, const std::function<void(Found)>& found) {
    const std::string whole = capture.path.string() + "/";
    std::set<std::string, std::less<>> used;
    for (const CaptureEntry& entry : capture.entries)
        for (const StoredPath* file : {&entry.colour, &entry.depth, &entry.cloud})
            if (const std::string path = file->string(); path.starts_with(whole))
                used.insert(path.substr(whole.size(), path.find('/', whole.size()) - whole.size()));
    for (const fs::path& folder : content_of(capture.path).folders)
        if (!used.contains(folder.filename().string()))
            found(passed_over(folder, "in the folder of a capture, which takes no frames from it"));
}

/// Opens the folder if its content is a capture, else searches its folders. Reports broken captures and what it passes
/// over. `walked` holds the parent folders seen so far, because links may lead back to them.
void find_in(const fs::path& folder, const std::string& name, const CaptureOptions& options, std::set<fs::path>& walked,
             const std::function<void(Found)>& found) {
    if (const std::string result = result_in(folder); !result.empty())
        return found(passed_over(folder, result));
    try {
        Capture capture = open_capture(folder, options);
        report_unused_folders(capture, found);
        found({folder, name, std::move(capture), ""});
        return;
    } catch (const Misuse&) {
        throw;
    } catch (const NoFrames& none) { // its folders and recordings may be captures
        if (!is_folder(folder))
            return found({folder, name, std::nullopt, none.what()});
    } catch (const Error& failure) {
        found({folder, name, std::nullopt, failure.what()});
        return;
    }
    if (!walked.insert(whole_path(folder)).second)
        return found(passed_over(folder, "a link to a folder that was searched already"));
    const Content content = content_of(folder, true);
    if (content.unreadable)
        found({folder, name, std::nullopt, folder.string() + ": cannot be listed: " + content.unreadable.message()});
    else if (content.files > 0)
        found(passed_over(folder, fmt::format("no frames among its {} ({})", counted(content.files, "file"),
                                              fmt::join(content.kinds, ", "))));
    else if (content.folders.empty())
        found(passed_over(folder, "empty"));
    for (const fs::path& each : content.hidden)
        found(passed_over(each, "hidden, as its name begins with '.'"));
    for (const fs::path& each : content.folders)
        find_in(each, (fs::path(name) / (is_folder(each) && !is_tar(each) ? each.filename() : each.stem())).string(),
                options, walked, found);
}

std::string own_name(const fs::path& path) {
    const fs::path whole = fs::weakly_canonical(path);
    const fs::path last = whole.has_filename() ? whole.filename() : whole.parent_path().filename();
    return (is_folder(path) && !is_tar(path) ? last : last.stem()).string();
}

void find_captures(const fs::path& dataset, const CaptureOptions& options, const std::function<void(Found)>& found) {
    std::error_code trouble;
    const bool there = is_there(dataset);
    if (!there && !fs::exists(dataset, trouble))
        fail_to_read(dataset, trouble ? trouble : std::make_error_code(std::errc::no_such_file_or_directory));
    const fs::path path = whole_path(dataset);
    if (is_folder(path)) {
        std::set<fs::path> walked;
        find_in(path, own_name(path), options, walked, found);
        return;
    }
    try {
        found({path, own_name(path), open_capture(path, options), ""});
    } catch (const Misuse&) {
        throw;
    } catch (const Error& failure) {
        found({path, own_name(path), std::nullopt, failure.what()});
    }
}

// ---------------------------------------------------------------------------------------------------- cost

/// A frame's fixed cost in megapixels: opening, syncing and renaming its files.
constexpr double fixed_cost = 0.05;

double megapixels(const Capture& capture) {
    if (capture.camera && !capture.camera->pinhole.size.empty())
        return capture.camera->pinhole.size.area() / 1e6;
    for (const CaptureEntry& entry : capture.entries)
        if (entry.problem.empty() && !entry.depth.empty()) {
            try {
                return depth_size_of(entry).area() / 1e6;
            } catch (const Error&) {
                return 0;
            }
        }
    return 0;
}

/// Costs of a capture's frames: equal for images, by bytes for clouds (about 32 per point).
std::vector<double> costs_of(const Capture& capture, const std::vector<std::size_t>& frames) {
    const double image = megapixels(capture);
    std::vector<double> costs;
    for (const std::size_t frame : frames) {
        const CaptureEntry& entry = capture.entries[frame];
        const auto bytes = entry.cloud.empty() ? 0 : size_of_file(entry.cloud).value_or(0);
        costs.push_back(fixed_cost + (entry.cloud.empty() ? image : static_cast<double>(bytes) / 32e6));
    }
    return costs;
}

// ---------------------------------------------------------------------------------------------------- the command

/// Settings of `run` that a plan leaves out: where and how it runs, and budgets, which depend on measured times.
constexpr std::array not_planned = {"out",     "overwrite",     "resume",   "retry", "shard",
                                    "scratch", "scratch-limit", "no-locks", "dump",  "device",
                                    "log",     "max-error",     "max-ms",   "quiet", "strict"};

class PlanCommand final : public Command {
  public:
    Words words() override {
        return {"DATASET",
                "folders searched for captures, or captures; with --fetch, sources as that command knows them",
                &datasets_, 0, 1 << 20};
    }

    std::vector<Stage> stages() override {
        std::vector<Stage> all = {{"job",
                                   {{.name = "out",
                                     .help = "folder of the job and of its results, on a disk that every machine sees",
                                     .value = &out_,
                                     .common = true,
                                     .writes = Writes::folder},
                                    {.name = "block",
                                     .help = "captures of more frames than this are cut into blocks of about this many",
                                     .value = &block_,
                                     .low = 1,
                                     .high = 1e9,
                                     .common = true},
                                    {.name = "overwrite",
                                     .help = "replaces an earlier plan; results that stay valid are kept",
                                     .value = &overwrite_,
                                     .common = true},
                                    {.name = "no-locks",
                                     .help = "takes a folder whose storage has no locks; run needs it, too",
                                     .value = &without_locks_}}},
                                  {"stores",
                                   {{.name = "fetch",
                                     .help = "a shell's command that fills the folder {dir} with {source}, for each "
                                             "task before it is computed; exit code 3: there is no such source",
                                     .value = &hooks_.fetch,
                                     .common = true},
                                    {.name = "deliver",
                                     .help = "a shell's command that copies the folder {out} to where the results of "
                                             "{task} belong; it may run twice",
                                     .value = &hooks_.deliver,
                                     .common = true},
                                    {.name = "sources",
                                     .help = "with --fetch: a file of sources, one a line, or - for standard input; a "
                                             "tab and the size in bytes may follow",
                                     .value = &sources_,
                                     .common = true},
                                    {.name = "scratch-limit",
                                     .help = "space on each machine for what is fetched and not yet delivered; 0 = "
                                             "half of what is free",
                                     .value = &hooks_.scratch_limit,
                                     .unit = "GB",
                                     .low = 0,
                                     .high = most_scratch_gb,
                                     .common = true},
                                    {.name = "hook-limit",
                                     .help = "a command that takes longer is ended and counts as failed",
                                     .value = &hooks_.limit_s,
                                     .unit = "s",
                                     .low = 1,
                                     .high = 1e6},
                                    {.name = "hook-tries",
                                     .help = "how often a command may fail before its task is left to the next run",
                                     .value = &hooks_.tries,
                                     .low = 1,
                                     .high = 100},
                                    {.name = "hook-wait",
                                     .help = "wait before the second try, doubled before each further one, at most "
                                             "60 s",
                                     .value = &hooks_.wait_s,
                                     .unit = "s",
                                     .low = 0,
                                     .high = most_wait_s}}}};
        for (Stage& stage : run_->stages()) {
            std::erase_if(stage.rows, [](const Parameter& row) { return std::ranges::count(not_planned, row.name); });
            all.push_back(std::move(stage));
        }
        return all;
    }

    void take_preset() override { run_->take_preset(); }

    int run() override {
        if (out_.empty())
            throw Misuse("plan needs -o FOLDER for the job");
        if (is_job(out_) && !overwrite_)
            throw Misuse(out_ + " is a job already: --overwrite plans it anew and keeps its results");
        check_hooks(hooks_);
        if (datasets_.empty() && sources_.empty())
            throw Misuse("plan needs a DATASET, or --sources with --fetch");
        if (!sources_.empty() && hooks_.fetch.empty())
            throw Misuse("--sources needs --fetch, a command that fetches them");
        require_job_folder(out_, !without_locks_);
        Plan plan;
        plan.settings = settings();
        plan.hooks = hooks_;
        if (!hooks_.fetch.empty())
            return plan_sources(std::move(plan));
        const CaptureOptions options{value("camera"), value("depth-scale"), number_of(row_of("association-limit"))};
        for (const std::string& dataset : datasets_)
            find_captures(dataset, options, [&](Found found) { add(std::move(found), plan); });
        for (const std::string& refused : plan.refused)
            fmt::print(stderr, "refused: {}\n", refused);
        tell_passed_over(plan);
        if (plan.tasks.empty())
            throw Error("no captures found");
        write_plan(out_, plan);
        tell(plan);
        return plan.refused.empty() ? all_well : some_failed;
    }

  private:
    /// Sources are not opened: that would fetch everything twice.
    int plan_sources(Plan plan) {
        SourceNames names;
        for (const auto& [source, bytes] : sources_from(datasets_, sources_)) {
            constexpr double bytes_per_cost = 1e6, unknown = 1; // a compressed megapixel takes about a megabyte
            Task task{.capture = source, .name = names.name_of(source)};
            task.listed_bytes = bytes;
            task.cost = bytes > 0 ? static_cast<double>(bytes) / bytes_per_cost : unknown;
            plan.tasks.push_back(std::move(task));
        }
        if (plan.tasks.empty())
            throw Error("no sources listed");
        write_plan(out_, plan);
        fmt::print("{:>8}  sources -> {}\n", plan.tasks.size(), out_);
        return all_well;
    }

    Parameter row_of(std::string_view name) {
        for (const Stage& stage : run_->stages())
            if (const Parameter* row = row_named(stage.rows, name))
                return *row;
        throw std::logic_error(fmt::format("run has no row {}", name));
    }
    std::string value(std::string_view name) { return value_text(row_of(name)); }

    /// Settings that differ from the defaults. A camera file gets its absolute path, since jobs run from any folder.
    std::vector<std::pair<std::string, std::string>> settings() {
        std::vector<std::pair<std::string, std::string>> given;
        for (const Stage& stage : run_->stages())
            for (const Parameter& row : stage.rows) {
                if (std::ranges::count(not_planned, row.name) || row.name == "settings")
                    continue;
                std::string text = value_text(row);
                if (text == defaults_[row.name])
                    continue;
                if (std::error_code ignored; row.name == "camera" && fs::exists(text, ignored))
                    text = fs::canonical(text).string();
                given.emplace_back(row.name, text);
            }
        return given;
    }

    static std::map<std::string, std::string> values_of(Command& command) {
        std::map<std::string, std::string> values;
        for (const Stage& stage : command.stages())
            for (const Parameter& row : stage.rows)
                values[row.name] = value_text(row);
        return values;
    }

    std::string unique(const std::string& name) {
        constexpr std::size_t longest = 240; // of the 255 bytes that file systems have
        const fs::path path = name;
        std::string free = name;
        for (int n = 2; !taken_.insert(free).second; ++n)
            free =
                (path.parent_path() / fmt::format("{}-{}", shortened(path.filename().string(), longest), n)).string();
        return free;
    }

    void add(Found found, Plan& plan) {
        if (!found.passed_over.empty()) {
            plan.passed_over.push_back(as_utf8(found.path.string()) + ": " + found.passed_over);
            return;
        }
        if (found.capture && as_utf8(found.path.string()) != found.path.string())
            found = {found.path, "", std::nullopt,
                     as_utf8(found.path.string()) + ": the name is not UTF-8, as a plan's must be"};
        if (!found.capture) {
            plan.refused.push_back(found.refused);
            return;
        }
        std::vector<std::size_t> frames;
        try {
            frames = slice(value("frames"), found.capture->entries.size());
        } catch (const Misuse& failure) {
            plan.refused.push_back(found.path.string() + ": " + failure.what());
            return;
        }
        ++captures_[found.capture->kind];
        frames_ += frames.size();
        const std::string name = unique(found.name);
        const std::vector<double> costs = costs_of(*found.capture, frames);
        const bool clouds = std::ranges::any_of(
            frames, [&](std::size_t frame) { return !found.capture->entries[frame].cloud.empty(); });
        const std::size_t blocks = (frames.size() + block_ - 1) / static_cast<std::size_t>(block_);
        for (std::size_t b = 0; b < blocks; ++b) { // blocks of one capture are equal up to a frame
            Task task{found.path, name, b * frames.size() / blocks, 0, frames.size(), 0};
            task.frames = (b + 1) * frames.size() / blocks - task.first;
            task.clouds = clouds;
            for (std::size_t i = 0; i < task.frames; ++i)
                task.cost += costs[task.first + i];
            plan.tasks.push_back(std::move(task));
        }
    }

    void tell_passed_over(const Plan& plan) const {
        constexpr std::size_t most = 20;
        for (const std::string& each : std::span(plan.passed_over).first(std::min(plan.passed_over.size(), most)))
            fmt::print(stderr, "passed over: {}\n", each);
        if (plan.passed_over.size() > most)
            fmt::print(stderr, "passed over: {} more, listed in {}\n", plan.passed_over.size() - most,
                       (fs::path(out_) / "plan.json").string());
    }

    void tell(const Plan& plan) const {
        for (const auto& [kind, count] : captures_)
            fmt::print("{:>8}  {}\n", count, kind);
        double cost = 0;
        for (const Task& task : plan.tasks)
            cost += task.cost;
        fmt::print("{:>8}  frames in {} tasks, {:.0f} megapixels or million points -> {}\n", frames_, plan.tasks.size(),
                   cost, out_);
    }

    std::vector<std::string> datasets_;
    std::string out_, sources_;
    Hooks hooks_;
    int block_ = 500;
    bool overwrite_ = false, without_locks_ = false;
    std::unique_ptr<Command> run_ = run_command();
    std::map<std::string, std::string> defaults_ = values_of(*run_);
    std::set<std::string> taken_;
    std::map<std::string, std::size_t> captures_;
    std::size_t frames_ = 0;
};

} // namespace

std::unique_ptr<Command> plan_command() { return std::make_unique<PlanCommand>(); }

} // namespace scanshade
