#include "apps/library/settings.h"

#include "apps/settings_file.h"
#include "projection/base/error.h"
#include "projection/base/nearest_word.h"

#include <algorithm>
#include <fmt/format.h>
#include <fstream>
#include <nlohmann/json.hpp>

namespace scanshade::library {
namespace {

/// Budgets measure methods on a capture before its run, so that they belong to the program.
bool is_of_the_program(const Stage& stage, const Parameter& row) {
    return stage.title == "output" || row.name == "frames" || row.name == "max-error" || row.name == "max-ms";
}

/// Adds the stages' rows that are neither outputs nor budgets.
std::vector<Parameter> rows_of(const std::vector<Stage>& stages) {
    std::vector<Parameter> rows;
    for (const Stage& stage : stages)
        rows.insert(rows.end(), stage.rows.begin(), stage.rows.end());
    return rows;
}

/// The row of that name, or Misuse as the command line says it.
const Parameter& row_of(const std::string& name, const std::vector<Parameter>& rows, const std::vector<Stage>& all,
                        std::string_view owner) {
    if (const Parameter* row = row_named(rows, name))
        return *row;
    const std::vector<Parameter> of_program = rows_of(all);
    if (row_named(of_program, name))
        throw Misuse(fmt::format("--{}: is a setting of the program, not of {}", name, owner));
    std::vector<std::string> flags;
    for (const Parameter& row : rows)
        flags.push_back("--" + row.name);
    throw Misuse(fmt::format("--{}: no such flag{}", name, suggestion("--" + name, flags)));
}

Settings settings_in(const std::string& file) {
    std::ifstream stream(file);
    if (!stream)
        throw Misuse(fmt::format("settings: {} cannot be read", file));
    Settings found;
    for (const CLI::ConfigItem& item : SettingsFile().from_config(stream))
        found.emplace_back(item.name, item.inputs.front());
    return found;
}

json listed(std::string_view owner, const std::vector<Stage>& stages) {
    json list = json::array();
    for (const Stage& stage : stages)
        for (const Parameter& row : stage.rows) {
            json one{{"for", owner}, {"stage", stage.title}};
            one.update(parameter_json(row));
            list.push_back(std::move(one));
        }
    return list;
}

/// Points become no surface here: of "input", the band alone.
std::vector<Stage> relief_stages(relief::ReliefSettings& settings, bool of_file) {
    std::vector<Stage> stages = settings.stages();
    for (Stage& stage : stages)
        if (stage.title == "input")
            std::erase_if(stage.rows, [&](const Parameter& row) { return !of_file || row.name != "band"; });
    return stages;
}

} // namespace

std::vector<Stage> stages_for(Purpose purpose, RunSettings& settings) {
    std::vector<Stage> stages = settings.stages();
    std::erase_if(stages,
                  [&](const Stage& stage) { return (stage.title == "input") != (purpose == Purpose::capture); });
    for (Stage& stage : stages)
        std::erase_if(stage.rows, [&](const Parameter& row) { return is_of_the_program(stage, row); });
    std::erase_if(stages, [](const Stage& stage) { return stage.rows.empty(); });
    return stages;
}

void fill(RunSettings& settings, Purpose purpose, const Settings& given) {
    const std::vector<Parameter> rows = rows_of(stages_for(purpose, settings));
    const std::string_view owner = purpose == Purpose::session ? "a session" : "a capture";
    Settings all;
    for (const auto& [name, value] : given) {
        const Parameter& row = row_of(name, rows, settings.stages(), owner);
        if (name == preset_flag) {
            set(row, value);
            settings.take_preset();
        } else if (name == settings_flag) {
            set(row, value);
            const Settings in_file = settings_in(value);
            all.insert(all.begin(), in_file.begin(), in_file.end());
        } else {
            all.emplace_back(name, value);
        }
    }
    for (const auto& [name, value] : all)
        set(row_of(name, rows, settings.stages(), owner), value);
    settings.resolve();
}

void fill(RefineSettings& settings, const Settings& given) {
    const std::vector<Stage> stages = settings.stages();
    const std::vector<Parameter> rows = rows_of(stages);
    for (const auto& [name, value] : given)
        set(row_of(name, rows, stages, "refine"), value);
}

void fill(relief::ReliefSettings& settings, bool of_file, const Settings& given) {
    const std::vector<Parameter> rows = rows_of(relief_stages(settings, of_file));
    for (const auto& [name, value] : given)
        set(row_of(name, rows, settings.stages(), "relief"), value);
    settings.resolve();
}

json values_in_use(RunSettings& settings) {
    const std::vector<Stage> taken = stages_for(Purpose::session, settings);
    const std::vector<Parameter> rows = rows_of(taken);
    json values = json::object();
    for (const Stage& stage : settings.stages_in_use())
        for (const Parameter& row : stage.rows)
            if (row_named(rows, row.name))
                values[row.name] = value_json(row);
    return values;
}

json all_settings() {
    RunSettings settings;
    RefineSettings refine;
    json list = listed("session", stages_for(Purpose::session, settings));
    for (json& one : listed("capture", stages_for(Purpose::capture, settings)))
        list.push_back(std::move(one));
    for (json& one : listed("refine", refine.stages()))
        list.push_back(std::move(one));
    relief::ReliefSettings relief;
    for (json& one : listed("relief", relief_stages(relief, true)))
        list.push_back(std::move(one));
    return list;
}

} // namespace scanshade::library
