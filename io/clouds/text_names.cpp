#include "io/clouds/text_names.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fmt/format.h>
#include <optional>

namespace scanshade {

namespace {

struct Unit {
    std::string_view name;
    double metres;
};
constexpr std::array units{Unit{"mm", 0.001}, Unit{"cm", 0.01}, Unit{"dm", 0.1},
                           Unit{"m", 1},      Unit{"km", 1000}, Unit{"ft", 0.3048}};

const Unit* unit_named(std::string_view name) {
    const auto* const found = std::ranges::find(units, name, &Unit::name);
    return found == units.end() ? nullptr : found;
}

/// A column's name in lower case, without marks of comments and without its unit.
struct Column {
    std::string name;
    double metres = 1;
};

Column column_in(std::string_view word) {
    while (word.starts_with('/') || word.starts_with('#'))
        word.remove_prefix(1);
    Column column{std::string(word), 1};
    std::string& name = column.name;
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (const std::size_t open = name.find_first_of("[("); open != std::string::npos) {
        column.metres = metres_in(std::string_view(name).substr(open));
        name.erase(name.find_last_not_of('_', std::max<std::size_t>(open, 1) - 1) + 1);
    } else if (const std::size_t mark = name.find_last_of("_/"); mark != std::string::npos && mark > 0) {
        if (const Unit* const unit = unit_named(std::string_view(name).substr(mark + 1))) {
            column.metres = unit->metres;
            name.erase(mark);
        }
    }
    return column;
}

/// "pos_x", "Points.X", "X1": which of x, y, z, and the letters that stand around it; nothing for other names.
struct Axis {
    std::size_t which;
    std::string around;
};
std::optional<Axis> axis_in(std::string_view name) {
    std::string plain;
    std::ranges::copy_if(name, std::back_inserter(plain), [](unsigned char c) { return std::isalnum(c) != 0; });
    constexpr std::array before{"pos",   "position",   "p",     "point",      "points", "pt",
                                "coord", "coordinate", "field", "pointsmxyz", "loc",    "location"};
    constexpr std::array behind{"1", "coord", "coordinate", "pos", "position"};
    for (const std::size_t which : {0U, 1U, 2U}) {
        const char letter = "xyz"[which];
        const auto is = [&](std::string_view rest, bool first) {
            return plain == (first ? letter + std::string(rest) : std::string(rest) + letter);
        };
        for (const char* word : before)
            if (is(word, false))
                return Axis{which, word};
        for (const char* word : behind)
            if (is(word, true))
                return Axis{which, word};
    }
    return std::nullopt;
}

/// Three names of axes that stand alike become x, y and z.
void name_axes(std::vector<Column>& columns) {
    std::array<Column*, 3> found{};
    std::string around;
    for (Column& column : columns)
        if (const auto axis = axis_in(column.name)) {
            if (found[axis->which] || (!around.empty() && around != axis->around))
                return;
            found[axis->which] = &column;
            around = axis->around;
        }
    for (std::size_t i = 0; i < found.size() && found[0] && found[1] && found[2]; ++i)
        found[i]->name = "xyz"[i];
}

struct Names {
    std::array<std::string_view, 3> theirs, ours;
};
constexpr std::array<std::string_view, 3> axis_names{"x", "y", "z"}, rgb_names{"red", "green", "blue"};
constexpr std::array triples{Names{{"rf", "gf", "bf"}, rgb_names},
                             Names{{"r", "g", "b"}, rgb_names},
                             Names{{"easting", "northing", "elevation"}, axis_names},
                             Names{{"easting", "northing", "height"}, axis_names},
                             Names{{"easting", "northing", "altitude"}, axis_names},
                             Names{{"easting", "northing", "z"}, axis_names},
                             Names{{"east", "north", "elevation"}, axis_names},
                             Names{{"east", "north", "height"}, axis_names},
                             Names{{"east", "north", "up"}, axis_names},
                             Names{{"e", "n", "h"}, axis_names},
                             Names{{"e", "n", "z"}, axis_names},
                             Names{{"e", "n", "u"}, axis_names},
                             Names{{"rechtswert", "hochwert", "hoehe"}, axis_names},
                             Names{{"rechtswert", "hochwert", "z"}, axis_names},
                             Names{{"x", "y", "height"}, axis_names},
                             Names{{"x", "y", "elevation"}, axis_names}};

} // namespace

double metres_in(std::string_view word) {
    if (word.size() < 3 || (word[0] != '[' && word[0] != '('))
        return 1;
    const Unit* const unit = unit_named(word.substr(1, word.find_first_of(")]") - 1));
    return unit ? unit->metres : 1;
}

bool is_line_of_units(const std::vector<std::string_view>& words) {
    return !words.empty() && std::ranges::all_of(words, [](std::string_view word) {
        return (word.starts_with('[') && word.ends_with(']')) || (word.starts_with('(') && word.ends_with(')'));
    });
}

bool names_axes(const std::vector<std::string>& names) {
    return std::ranges::all_of(axis_names, [&](std::string_view axis) { return std::ranges::count(names, axis) == 1; });
}

ColumnNames column_names(const std::vector<std::string_view>& words) {
    std::vector<Column> columns;
    for (const std::string_view word : words) {
        Column column = column_in(word);
        if (!column.name.empty())
            columns.push_back(std::move(column));
        else if (!columns.empty()) // "X [m]" between blanks
            columns.back().metres = column.metres;
    }
    const auto named = [&](std::string_view name) { return std::ranges::find(columns, name, &Column::name); };
    const auto has = [&](std::string_view name) { return named(name) != columns.end(); };
    if (!std::ranges::all_of(axis_names, has))
        name_axes(columns);
    for (const auto& [theirs, ours] : triples)
        if (std::ranges::all_of(theirs, has) && !std::ranges::all_of(ours, has))
            for (std::size_t i = 0; i < ours.size(); ++i)
                named(theirs[i])->name = ours[i];
    ColumnNames names;
    for (const Column& column : columns)
        names.ours.push_back(column.name);
    if (has("x"))
        names.metres = named("x")->metres;
    return names;
}

} // namespace scanshade
