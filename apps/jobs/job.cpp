// A job's files, and the division of its tasks into shards.
#include "apps/jobs/job.h"

#include "apps/json.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <queue>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

json task_json(const Task& task) {
    json text{{"capture", task.capture.string()},
              {"name", task.name},
              {"first", task.first},
              {"frames", task.frames},
              {"of", task.of},
              {"cost", task.cost}};
    if (task.listed_bytes > 0)
        text["bytes"] = task.listed_bytes;
    if (task.clouds)
        text["clouds"] = true;
    return text;
}

json hooks_json(const Hooks& hooks) {
    return {{"fetch", hooks.fetch}, {"deliver", hooks.deliver}, {"limit_s", hooks.limit_s},
            {"tries", hooks.tries}, {"wait_s", hooks.wait_s},   {"scratch_limit_gb", hooks.scratch_limit}};
}

Hooks hooks_from(const json& text) {
    Hooks hooks{.fetch = text.at("fetch"),
                .deliver = text.at("deliver"),
                .limit_s = text.at("limit_s"),
                .tries = text.at("tries"),
                .wait_s = text.at("wait_s"),
                .scratch_limit = text.at("scratch_limit_gb")};
    if (hooks.limit_s < 1 || hooks.tries < 1 || !(hooks.wait_s >= 0 && hooks.wait_s <= most_wait_s) ||
        !(hooks.scratch_limit >= 0 && hooks.scratch_limit <= most_scratch_gb))
        throw Error("hooks: a limit is out of range");
    check_hooks(hooks);
    return hooks;
}

/// A name that stays inside results/, whatever a plan edited by hand says.
std::string checked_name(const std::string& name) {
    const fs::path path = fs::path(name).lexically_normal();
    if (name.empty() || name.find('\0') != std::string::npos || path.is_absolute() || *path.begin() == "..")
        throw Error("'" + name + "' is no name inside the job's folder");
    return name;
}

Task task_from(const json& text, bool fetched) {
    Task task{text.at("capture").get<std::string>(),
              checked_name(text.at("name")),
              count_at(text, "first"),
              count_at(text, "frames"),
              count_at(text, "of"),
              text.at("cost").get<double>()};
    if (text.contains("bytes"))
        task.listed_bytes = count_at(text, "bytes");
    task.clouds = text.value("clouds", false);
    if (fetched && task.frames == 0 && task.first == 0 && task.of == 0)
        return task;
    if (task.frames == 0 || task.first > task.of || task.frames > task.of - task.first)
        throw Error(fmt::format("frames {} + {} of {} cannot be", task.first, task.frames, task.of));
    return task;
}

constexpr std::uint64_t most_shards = 1'000'000'000;

int variable(const char* name, int otherwise) {
    const char* text = std::getenv(name);
    if (!text)
        return otherwise;
    const auto value = whole_number(text);
    if (!value || *value > most_shards)
        throw Misuse(fmt::format("{}: '{}' given, expected a whole number", name, text));
    return static_cast<int>(*value);
}

Shard checked(Shard shard, const std::string& origin) {
    if (shard.of < 1 || shard.index < 1 || shard.index > shard.of)
        throw Misuse(fmt::format("{}: shard {} of {} cannot be", origin, shard.index, shard.of));
    return shard;
}

} // namespace

std::string Task::block() const { return frames == of ? "" : fmt::format("{}-{}", first, first + frames); }

bool is_job(const fs::path& folder) {
    std::error_code ignored;
    return fs::is_regular_file(folder / "plan.json", ignored) && fs::is_regular_file(folder / "tasks.jsonl", ignored);
}

void write_plan(const fs::path& job, const Plan& plan) {
    write_atomically(job / "tasks.jsonl", [&](const fs::path& file) {
        std::ofstream stream(file, std::ios::binary);
        stream.exceptions(std::ios::failbit | std::ios::badbit);
        for (const Task& task : plan.tasks)
            stream << json_line(task_json(task)) << '\n';
        stream.flush();
    });
    json settings = json::object();
    for (const auto& [name, value] : plan.settings)
        settings[name] = value;
    const double cost = std::accumulate(plan.tasks.begin(), plan.tasks.end(), 0.0,
                                        [](double sum, const Task& task) { return sum + task.cost; });
    json head{{"program", "scanshade"},
              {"version", SCANSHADE_VERSION},
              {"settings", settings},
              {"tasks", plan.tasks.size()},
              {"cost", cost},
              {"refused", plan.refused},
              {"passed_over", plan.passed_over}};
    if (plan.hooks.any())
        head["hooks"] = hooks_json(plan.hooks);
    write_atomically(job / "plan.json", text_of(head) + "\n");
}

Plan read_plan(const fs::path& job) {
    Plan plan;
    reading_json((job / "plan.json").string(), [&] {
        const json head = parsed_json(read_at_most(1 << 28, job / "plan.json", "a plan"));
        for (const auto& [name, value] : head.at("settings").items())
            plan.settings.emplace_back(name, value.get<std::string>());
        plan.refused = head.at("refused").get<std::vector<std::string>>();
        if (head.contains("hooks"))
            plan.hooks = hooks_from(head["hooks"]);
    });
    std::ifstream stream(job / "tasks.jsonl");
    int number = 0;
    for (std::string line; std::getline(stream, line);)
        reading_json(at_line(job / "tasks.jsonl", ++number),
                     [&] { plan.tasks.push_back(task_from(parsed_json(line), !plan.hooks.fetch.empty())); });
    return plan;
}

fs::path results_of(const fs::path& job, const Task& task) { return job / "results" / task.name; }

Shard shard_from(const std::string& text) {
    if (!text.empty()) {
        const std::size_t slash = std::min(text.find('/'), text.size());
        const auto index = whole_number(std::string_view(text).substr(0, slash)),
                   of = whole_number(std::string_view(text).substr(std::min(slash + 1, text.size())));
        if (!index || !of || *index > most_shards || *of > most_shards)
            throw Misuse("shard: '" + text + "' given, expected INDEX/COUNT from 1/COUNT to COUNT/COUNT");
        return checked({static_cast<int>(*index), static_cast<int>(*of)}, "--shard");
    }
    if (std::getenv("SLURM_ARRAY_TASK_ID")) {
        const int first = variable("SLURM_ARRAY_TASK_MIN", 0), step = std::max(1, variable("SLURM_ARRAY_TASK_STEP", 1));
        return checked({(variable("SLURM_ARRAY_TASK_ID", 0) - first) / step + 1, variable("SLURM_ARRAY_TASK_COUNT", 1)},
                       "SLURM_ARRAY_TASK_ID");
    }
    if (std::getenv("JOB_COMPLETION_INDEX") && std::getenv("JOB_COMPLETIONS"))
        return checked({variable("JOB_COMPLETION_INDEX", 0) + 1, variable("JOB_COMPLETIONS", 1)},
                       "JOB_COMPLETION_INDEX");
    return {};
}

std::vector<std::vector<std::size_t>> cut(const std::vector<Task>& tasks, int shards) {
    std::vector<std::size_t> order(tasks.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return tasks[a].cost > tasks[b].cost; });
    using Load = std::pair<double, std::size_t>;
    std::priority_queue<Load, std::vector<Load>, std::greater<>> least;
    std::vector<std::vector<std::size_t>> parts(static_cast<std::size_t>(shards));
    for (std::size_t shard = 0; shard < parts.size(); ++shard)
        least.emplace(0.0, shard);
    for (const std::size_t task : order) {
        const auto [load, shard] = least.top();
        least.pop();
        parts[shard].push_back(task);
        least.emplace(load + tasks[task].cost, shard);
    }
    return parts;
}

} // namespace scanshade
