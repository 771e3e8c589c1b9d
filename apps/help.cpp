#include "apps/help.h"

#include "apps/json.h"
#include "io/captures/formats.h"
#include "projection/base/error.h"
#include "projection/base/nearest_word.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>

namespace scanshade {
namespace {

constexpr std::array exit_codes = {
    std::pair(all_well, "all well"),
    std::pair(misuse, "misuse"),
    std::pair(some_failed,
              "some frames' input is bad, the others are done; with --strict also: some results are doubtful"),
    std::pair(nothing_done, "nothing could be done"),
    std::pair(unfinished, "interrupted, device lost, disk or memory full, share gone: `run --resume` goes on"),
    std::pair(internal_error, "internal error"),
};

constexpr const char* program_summary = "ambient occlusion for recorded depth images and point clouds";

/// "[default 0.5; m, 0 .. 100]"
std::string limits(const Parameter& row) {
    const std::string value = value_text(row), range = range_text(row);
    const std::string otherwise = value.empty() ? "" : "default " + value;
    const std::string allowed = is_switch(row) && value == "false" ? "" : range;
    if (otherwise.empty() && allowed.empty())
        return "";
    return fmt::format(" [{}{}{}]", otherwise, otherwise.empty() || allowed.empty() ? "" : "; ", allowed);
}

/// A name, followed by a text in lines of at most 110 columns.
void print_entry(const std::string& name, std::size_t name_width, const std::string& text) {
    const std::size_t width = 110 - name_width - 4;
    fmt::print("  {:<{}}  ", name, name_width);
    std::istringstream words(text);
    std::size_t used = 0;
    for (std::string word; words >> word; used += word.size()) {
        if (used > 0 && used + 1 + word.size() > width) {
            fmt::print("\n  {:<{}}  ", "", name_width);
            used = 0;
        }
        fmt::print("{}{}", used > 0 ? " " : "", word);
        used += used > 0 ? 1 : 0;
    }
    fmt::print("\n");
}

void print_stage(const Stage& stage) {
    if (stage.rows.empty())
        return;
    std::size_t longest = 0;
    for (const Parameter& row : stage.rows)
        longest = std::max(longest, flag_names(row).size());
    fmt::print("\n{}:\n", stage.title);
    for (const Parameter& row : stage.rows)
        print_entry(flag_names(row), longest, row.help + limits(row));
}

/// The flags that `help COMMAND` shows: the common ones, or if none is marked, all without a topic.
std::vector<Stage> first_page(std::vector<Stage> stages) {
    std::erase_if(stages, [](const Stage& stage) { return !stage.topic.empty(); });
    const bool marked =
        std::ranges::any_of(stages, [](const Stage& s) { return std::ranges::any_of(s.rows, &Parameter::common); });
    for (Stage& stage : stages)
        if (marked)
            std::erase_if(stage.rows, [](const Parameter& row) { return !row.common; });
    return stages;
}

/// Without Markdown's marks of code.
std::string plain(std::string text) {
    std::erase(text, '`');
    return text;
}

/// "recognised by ...; 16-bit PNG; camera: ...", of what there is.
std::string facts_of(const Format& format) {
    std::vector<std::string> facts{format.recognised};
    if (!format.extensions.empty())
        facts.push_back(fmt::format("{}", fmt::join(format.extensions, " ")));
    if (!format.content.empty())
        facts.push_back(format.content);
    if (!format.camera.empty())
        facts.push_back("camera: " + format.camera);
    facts.emplace_back(format.read && format.written ? "read and written" : format.read ? "read" : "written");
    return plain(fmt::format("{}", fmt::join(facts, " | ")));
}

/// What a value is, as in `help --json`.
const char* kind_of(const Parameter& row) {
    if (is_switch(row))
        return "switch";
    if (!choices_of(row).empty())
        return "choice";
    if (std::holds_alternative<int*>(row.value))
        return "integer";
    return std::holds_alternative<std::string*>(row.value) ? "text" : "number";
}

json flag_json(const Stage& stage, const Parameter& row) {
    json flag = parameter_json(row);
    flag["kind"] = kind_of(row);
    flag["stage"] = stage.title;
    if (!stage.topic.empty())
        flag["topic"] = stage.topic;
    if (const std::string names = flag_names(row); names.find(',') != std::string::npos)
        flag["short"] = names.substr(1, 1);
    flag["common"] = row.common;
    if (row.writes != Writes::nothing)
        flag["writes"] = row.writes == Writes::file ? "file" : "folder";
    return flag;
}

json format_json(const Format& format) {
    json about{{"kind", name_of(format.kind)},
               {"name", format.name},
               {"recognised", plain(format.recognised)},
               {"extensions", format.extensions},
               {"content", plain(format.content)},
               {"read", format.read},
               {"written", format.written}};
    if (!format.camera.empty())
        about["camera"] = plain(format.camera);
    return about;
}

json command_json(const CommandRow& row) {
    const std::unique_ptr<Command> command = row.make();
    json about{{"name", row.name}, {"summary", row.summary}};
    if (const Words words = command->words(); words.values)
        about["words"] = {
            {"name", words.name}, {"help", words.help}, {"at_least", words.at_least}, {"at_most", words.at_most}};
    about["flags"] = json::array();
    for (const Stage& stage : command->stages())
        for (const Parameter& flag : stage.rows)
            about["flags"].push_back(flag_json(stage, flag));
    return about;
}

} // namespace

std::string flag_of(const Parameter& row) { return "--" + row.name; }

/// The flag's name, with its short form if it has one.
std::string flag_names(const Parameter& row) {
    return row.name == "out" ? "-o,--out" : row.name == "quiet" ? "-q,--quiet" : flag_of(row);
}

bool is_switch(const Parameter& row) { return std::holds_alternative<bool*>(row.value); }

void print_overview(std::span<const CommandRow> commands) {
    fmt::print("scanshade {}: {}\n\n", SCANSHADE_VERSION, program_summary);
    for (const CommandRow& row : commands)
        fmt::print("  scanshade {:<14} {}\n", row.name, row.summary);
    fmt::print("  scanshade {:<14} {}\n  scanshade {:<14} {}\n", "help",
               "this, or the flags of one command: help COMMAND; help formats: what is read and written; help checks: "
               "what makes a result doubtful",
               "--version", "the version");
    fmt::print("\n");
    for (const auto& [code, meaning] : exit_codes)
        fmt::print("{} {} {}\n", code == all_well ? "Exit code:" : "          ", static_cast<int>(code), meaning);
}

void print_help(const CommandRow& row, const std::string& topic) {
    const std::unique_ptr<Command> command = row.make();
    const std::vector<Stage> all = command->stages();
    std::vector<std::string> topics;
    for (const Stage& stage : all)
        if (!stage.topic.empty())
            topics.push_back(stage.topic);
    std::vector<Stage> shown = topic == "all" ? all : first_page(all);
    if (!topic.empty() && topic != "all") {
        shown = all;
        std::erase_if(shown, [&](const Stage& stage) { return stage.topic != topic; });
        if (shown.empty())
            throw Misuse(fmt::format("help {}: no topic '{}'{}", row.name, topic, suggestion(topic, topics)));
    }
    const Words words = command->words();
    fmt::print("scanshade {}{}{} [flags]\n  {}\n", row.name, words.values ? " " + words.name : "",
               words.at_most > 1 ? "..." : "", row.summary);
    if (words.values && (topic.empty() || topic == "all")) {
        fmt::print("\n");
        print_entry(words.name, words.name.size(), words.help);
    }
    for (const Stage& stage : shown)
        print_stage(stage);
    if (topic.empty() && !topics.empty()) {
        fmt::print("\nmore:\n");
        print_entry("every flag", 10, fmt::format("scanshade help {} all", row.name));
        print_entry("one topic", 10, fmt::format("scanshade help {} TOPIC: {}", row.name, fmt::join(topics, ", ")));
    }
}

void print_formats(bool as_markdown) {
    if (as_markdown) {
        fmt::print("{}\n{}", formats_in_short(), formats_in_full());
        return;
    }
    const std::vector<Format> all = formats();
    std::size_t longest = 0;
    for (const Format& format : all)
        longest = std::max(longest, format.name.size());
    for (auto format = all.begin(); format != all.end(); ++format) {
        if (format == all.begin() || format->kind != std::prev(format)->kind)
            fmt::print("{}{}:\n", format == all.begin() ? "" : "\n", name_of(format->kind));
        print_entry(format->name, longest, facts_of(*format));
    }
}

void print_json(std::span<const CommandRow> commands) {
    json all{{"program", "scanshade"}, {"version", SCANSHADE_VERSION}, {"summary", program_summary}};
    all["commands"] = json::array();
    for (const CommandRow& row : commands)
        all["commands"].push_back(command_json(row));
    all["formats"] = json::array();
    for (const Format& format : formats())
        all["formats"].push_back(format_json(format));
    all["exit_codes"] = json::array();
    for (const auto& [code, meaning] : exit_codes)
        all["exit_codes"].push_back({{"code", static_cast<int>(code)}, {"meaning", meaning}});
    fmt::print("{}\n", all.dump(1));
}

} // namespace scanshade
