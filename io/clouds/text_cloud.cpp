// Clouds as lines of numbers (.xyz, .pts, .ptx) and as bare floats (KITTI). These files say little, so little is
// assumed.
#include "io/clouds/cloud_records.h"

#include "io/clouds/text_names.h"
#include "io/text.h"
#include "io/utf16.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <optional>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

/// What three columns beside each other hold.
enum class Triple { colours, normals, other };

/// Told by their values in the first lines: normals are as long as 1, colours are bytes or fractions of 1.
Triple triple_in(const std::vector<std::vector<double>>& lines, std::size_t first) {
    constexpr double written_with_two_digits = 0.02;
    bool normals = !lines.empty(), colours = !lines.empty(), fractions = !lines.empty();
    for (const auto& line : lines) {
        const Eigen::Vector3d value(line[first], line[first + 1], line[first + 2]);
        normals = normals && std::abs(value.norm() - 1) <= written_with_two_digits;
        colours = colours && (value.array() >= 0).all() && (value.array() <= 255).all() &&
                  (value.array() == value.array().floor()).all();
        fractions = fractions && (value.array() >= 0).all() && (value.array() <= 1).all();
    }
    return normals ? Triple::normals : colours || fractions ? Triple::colours : Triple::other;
}

/// Whether two whole numbers that go on step by step stand before the coordinates, as rows and columns of a scan do in
/// FARO's text. Maps of whole metres have a height behind them, and no three numbers that are not whole.
bool is_grid_first(const std::vector<std::vector<double>>& lines) {
    constexpr std::size_t fewest = 16, columns = 5;
    if (lines.size() < fewest || lines.front().size() < columns ||
        (lines.front().size() > columns && triple_in(lines, 3) != Triple::other))
        return false;
    const auto whole = [](double value) { return value == std::floor(value); };
    std::array<std::size_t, columns> fractions{};
    std::size_t steps = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
        for (std::size_t k = 0; k < columns; ++k)
            fractions[k] += !whole(lines[i][k]);
        if (lines[i][0] < 0 || lines[i][1] < 0)
            return false;
        const double rows = i == 0 ? 0 : lines[i][0] - lines[i - 1][0],
                     along = i == 0 ? 1 : lines[i][1] - lines[i - 1][1];
        steps += (rows == 0 && along == 1) || (along == 0 && rows == 1) || rows == 1 || along == 1;
    }
    const auto most = [&](std::size_t count) { return 10 * count > 9 * lines.size(); };
    return fractions[0] + fractions[1] == 0 && most(fractions[2]) && most(fractions[3]) && most(fractions[4]) &&
           most(steps);
}

/// The columns of lines without names: x y z, then colours and normals as their values tell, and an intensity before or
/// one more value behind them. `lines` are the first ones, equally long. `colours_first`: of seven columns, the fourth
/// to the sixth are colours.
std::vector<std::string> usual_names(const std::vector<std::vector<double>>& lines, bool colours_first) {
    const std::size_t columns = lines.empty() ? 3 : lines.front().size();
    if (is_grid_first(lines)) {
        std::vector<std::vector<double>> rest;
        for (const auto& line : lines)
            rest.emplace_back(line.begin() + 2, line.end());
        std::vector<std::string> names = usual_names(rest, colours_first);
        names.insert(names.begin(), {"row", "column"});
        return names;
    }
    std::vector<std::string> names{"x", "y", "z"};
    const auto take_triples = [&](std::size_t end) { // false where one of them is neither
        while (names.size() + 3 <= end) {
            const Triple triple = triple_in(lines, names.size());
            if (triple == Triple::other ||
                std::ranges::find(names, triple == Triple::colours ? "red" : "nx") != names.end())
                return false;
            if (triple == Triple::colours)
                names.insert(names.end(), {"red", "green", "blue"});
            else
                names.insert(names.end(), {"nx", "ny", "nz"});
        }
        return true;
    };
    constexpr std::size_t most_usual = 10;
    if (columns == 7 && colours_first) {
        names.insert(names.end(), {"red", "green", "blue"});
    } else if (columns > 3 && columns <= most_usual && columns % 3 == 1) {
        names.emplace_back("intensity");
        if (!take_triples(columns)) {
            names.resize(3);
            if (!take_triples(columns - 1))
                names = {"x", "y", "z", "intensity"};
        }
    } else if (columns <= most_usual && columns % 3 == 0 && !take_triples(columns)) {
        names.resize(3);
    }
    while (names.size() < columns)
        names.push_back(fmt::format("column_{}", names.size() + 1));
    return names;
}

constexpr std::size_t enough_lines = 100;

/// Up to `enough_lines` lines of equally many numbers that the text begins with; without one that may be cut off.
std::vector<std::vector<double>> first_numbers(std::string_view text, bool may_be_cut) {
    std::vector<std::vector<double>> lines;
    if (may_be_cut)
        text = text.substr(0, text.rfind('\n') + 1);
    TextRecords records(text, 1);
    while (lines.size() < enough_lines && records.next()) {
        std::vector<double> line;
        for (const auto word : records.words())
            if (const auto value = number(word); value && std::isfinite(*value))
                line.push_back(*value);
        if (line.size() != records.words().size() || (!lines.empty() && line.size() != lines.front().size()))
            break;
        lines.push_back(std::move(line));
    }
    return lines;
}

/// PTX has an intensity and may have colours; what comes behind them is not PTX's own (our AO, for one).
std::vector<std::string> ptx_names(std::size_t columns) {
    std::vector<std::string> names{"x", "y", "z", "intensity"};
    if (columns >= 7)
        names.insert(names.end(), {"red", "green", "blue"});
    while (names.size() < columns)
        names.push_back(fmt::format("column_{}", names.size() + 1));
    return names;
}

std::vector<CloudField> fields_named(const std::vector<std::string>& names) {
    std::vector<CloudField> fields;
    for (const std::string& name : names)
        fields.push_back({name, Scalar::float64, 1, std::nullopt, 0});
    return fields;
}

/// A name of CSV as one word: without quotes, its blanks joined. ParaView and VeloView number coordinates: "Points:0",
/// "Points_m_XYZ:0".
std::string name_in_cell(std::string_view cell) {
    std::string name(cell);
    std::erase(name, '"');
    std::ranges::replace_if(
        name, [](unsigned char c) { return std::isspace(c) != 0; }, '_');
    constexpr std::array<std::string_view, 3> axes{"x", "y", "z"};
    for (std::size_t axis = 0; axis < axes.size(); ++axis)
        if ((name.starts_with("Points:") || name.starts_with("Points_m_XYZ:")) &&
            name.ends_with(fmt::format(":{}", axis)))
            return std::string(axes[axis]);
    return name.empty() ? "unnamed" : name; // pandas writes the number of each line in a column without a name
}

/// Whether the line's words are numbers, three or more with a comma for their points: "2,39 0,5 1,0 255".
bool has_decimal_commas(std::string_view line) {
    const auto all = words(line);
    const auto commas = [](std::string_view word) { return std::ranges::count(word, ','); };
    return std::ranges::count(all, 1, commas) >= 3 && std::ranges::all_of(all, [&](std::string_view word) {
               return commas(word) <= 1 && word.front() != ',' && word.back() != ',' &&
                      word.find_first_not_of("+-0123456789,eE") == std::string_view::npos;
           });
}

/// Where the first line begins that is no comment, behind a byte order mark and Excel's "sep=;".
std::size_t first_line_of_cells(std::string_view bytes) {
    std::size_t begin = bytes.starts_with(byte_order_mark) ? byte_order_mark.size() : 0;
    const auto skips = [&] {
        return bytes[begin] == '#' || bytes[begin] == '\n' || bytes[begin] == '\r' ||
               bytes.substr(begin).starts_with("sep=");
    };
    while (begin < bytes.size() && skips())
        begin = std::min(bytes.find('\n', begin), bytes.size() - 1) + 1;
    return begin;
}

/// A text of cells between commas or semicolons, as words between blanks; nothing for other texts. With semicolons or
/// blanks between cells, a comma is a decimal point.
std::optional<std::string> words_for_cells(std::string_view bytes) {
    const std::size_t begin = first_line_of_cells(bytes);
    const std::string_view before =
        bytes.substr(0, begin).find("sep=") == std::string_view::npos ? bytes.substr(0, begin) : std::string_view();
    bytes.remove_prefix(begin);
    const std::string_view first = bytes.substr(0, bytes.find('\n'));
    const std::string_view rest = bytes.substr(first.size());
    const std::string_view second = rest.substr(0, rest.find('\n', 1));
    const bool names = has_decimal_commas(second) && first.find_first_of(";,") == std::string_view::npos;
    if (names || has_decimal_commas(first)) {
        std::string text(bytes);
        std::ranges::replace(text, ',', '.');
        return std::string(before) + text;
    }
    const char between = first.find(';') != std::string_view::npos ? ';' : ',';
    if (first.find(between) == std::string_view::npos)
        return std::nullopt;
    std::string text;
    for (std::size_t at = 0; at <= first.size();) { // numbers or names
        const std::size_t end = std::min(first.find(between, at), first.size());
        const std::string_view cell = trimmed(first.substr(at, end - at));
        if (!cell.empty() || end < first.size()) // else a comma at the line's end
            text += (text.empty() ? "" : " ") + name_in_cell(cell);
        at = end + 1;
    }
    text += rest;
    std::ranges::replace(text, between, ' ');
    if (between == ';')
        std::ranges::replace(text, ',', '.');
    if (second.find('"') != std::string_view::npos) // numbers, too, in quotes
        std::erase(text, '"');
    return std::string(before) + text;
}

/// What has line ends of old Macintoshes, or two bytes a character, as texts usually are; nothing for other texts.
std::optional<std::string> usual_text(std::string_view bytes) {
    if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff"))
        return plain_text(std::string(bytes));
    if (bytes.find('\n') != std::string_view::npos || bytes.find('\r') == std::string_view::npos)
        return std::nullopt;
    std::string text(bytes);
    std::ranges::replace(text, '\r', '\n');
    return text;
}

bool all_numbers(const std::vector<std::string_view>& words) {
    return std::all_of(words.begin(), words.end(), [](std::string_view word) { return number(word).has_value(); });
}

/// Throws Error unless the line has a number for each field.
void check_numbers(const TextRecords& lines, const std::vector<CloudField>& fields, const fs::path& file) {
    if (lines.words().size() != fields.size())
        throw Error(fmt::format("{}: {}, expected {} as in the first", at_line(file, lines.line()),
                                counted(lines.words().size(), "value"), fields.size()));
    for (std::size_t i = 0; i < fields.size(); ++i)
        if (!number(lines.words()[i]))
            throw Error(fmt::format("{}: {} in column {} ({}) is not a number", at_line(file, lines.line()),
                                    in_quotes(lines.words()[i]), i + 1, fields[i].name));
}

/// Of x y z and four columns more: whether all points say that colours come before a scalar (CloudCompare's order), not
/// behind an intensity. Where both would do, the intensity comes first, with a warning.
bool colours_come_first(std::string_view body, const fs::path& file, std::vector<std::string>& warnings) {
    std::array<bool, 7> bytes{}, varies{};
    std::array<double, 7> first{};
    bytes.fill(true);
    TextRecords lines(body, 1);
    for (bool begun = false; lines.next(); begun = true) {
        if (lines.words().size() != bytes.size())
            continue; // refused elsewhere
        for (std::size_t i = 3; i < bytes.size(); ++i) {
            const double value = number(lines.words()[i]).value_or(-1);
            bytes[i] = bytes[i] && value >= 0 && value <= 255 && value == std::floor(value);
            varies[i] = varies[i] || (begun && value != first[i]);
            if (!begun)
                first[i] = value;
        }
    }
    if (!bytes[4] || !bytes[5])
        return false;
    const bool before = bytes[3], behind = bytes[6];
    if (before != behind || !before)
        return before;
    if (varies[3] != varies[6]) // a scalar that is the same everywhere is no colour
        return varies[3];
    if (varies[3] && lower_extension(file) != ".pts") // whose intensity is the fourth
        warnings.push_back(file.string() +
                           ": seven columns without names: taken as x y z intensity red green blue. A line of "
                           "names, such as //X Y Z R G B Scalar, tells another order.");
    return false;
}

/// Whether `rest`, from a line on that begins with `word`, is a few lines without numbers: "# end of file".
bool is_end(std::string_view word, std::string_view rest) {
    constexpr std::size_t longest = 1000;
    if (std::string_view("+-.0123456789").find(word[0]) != std::string_view::npos || number(word) ||
        rest.size() > longest)
        return false;
    TextRecords lines(rest, 1);
    while (lines.next())
        if (number(lines.words()[0]))
            return false;
    return true;
}

/// The lines of `body` as records of equally many words. A number alone begins the next scan of a .pts.
void read_lines(CloudRecords& records, std::string_view body, int first_line, const fs::path& file,
                std::vector<std::string>& warnings) {
    TextRecords lines(body, first_line);
    const auto names_of_first = [&](std::size_t columns) {
        auto first = first_numbers(body, false);
        if (first.empty()) // refused below
            first.emplace_back(columns);
        return usual_names(first, columns == 7 && colours_come_first(body, file, warnings));
    };
    std::size_t behind = 0; // the last word that was kept
    for (bool block = false; lines.next();) {
        const std::vector<std::string_view>& line = lines.words();
        if (records.fields.size() > 1 && line.size() == 1 && whole_number(line[0])) {
            block = true;
            continue;
        }
        if (records.fields.empty()) {
            records.fields = fields_named(names_of_first(line.size()));
            if (records.fields[0].name == "row")
                warnings.push_back(file.string() +
                                   ": the first two columns count rows and columns of a scan: x y z are "
                                   "taken behind them.");
        }
        if (is_end(lines.words()[0], body.substr(behind)))
            break;
        check_numbers(lines, records.fields, file);
        if (std::exchange(block, false)) { // the count between blocks is no part of the records
            const auto start = static_cast<std::size_t>(line.front().data() - body.data());
            records.inserted.emplace(records.ends.size(), body.substr(behind, start - behind));
            behind = start;
        }
        records.points += body.substr(behind, lines.end() - behind);
        behind = lines.end();
        records.ends.push_back(records.points.size());
    }
    records.point_count = records.ends.size();
    check_point_count(records.point_count, file);
    records.after = body.substr(behind);
    records.grid = {static_cast<int>(records.point_count), 1};
}

/// Cuts the first `count` lines off: they are the header.
std::vector<std::vector<std::string_view>> header_lines(std::string_view bytes, std::size_t count, std::size_t& length,
                                                        const fs::path& file, int first_line = 1) {
    std::vector<std::vector<std::string_view>> lines;
    length = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (length >= bytes.size())
            throw Error(fmt::format("{}: ends at line {}, expected a header of {} lines", file.string(),
                                    first_line - 1 + static_cast<int>(i), count));
        const std::size_t end = std::min(bytes.find('\n', length), bytes.size());
        lines.push_back(words(bytes.substr(length, end - length)));
        length = std::min(end + 1, bytes.size());
    }
    return lines;
}

std::vector<double> numbers_of(const std::vector<std::string_view>& words, std::size_t expected, int line,
                               const fs::path& file) {
    std::vector<double> values;
    for (const auto word : words)
        if (const auto value = number(word); value && std::isfinite(*value))
            values.push_back(*value);
    if (values.size() != expected || words.size() != expected)
        throw Error(fmt::format("{}: expected {}", at_line(file, line), counted(expected, "finite number")));
    return values;
}

} // namespace

namespace {

/// Before each scan of a PTX file: columns, rows, the scanner's position and three axes, a 4x4 for row vectors.
struct PtxHeader {
    static constexpr std::size_t lines = 10;
    std::uint64_t columns = 0, rows = 0;
    Eigen::Matrix4d world_from_scan;
    std::size_t length = 0; ///< in bytes

    [[nodiscard]] std::uint64_t points() const { return columns * rows; }
};

/// The header that `bytes` begin with, in line `first_line` of the file.
PtxHeader ptx_header(std::string_view bytes, int first_line, const fs::path& file) {
    PtxHeader header;
    const auto lines = header_lines(bytes, PtxHeader::lines, header.length, file, first_line);
    for (std::size_t i = 0; i < 2; ++i) {
        const auto size = lines[i].size() == 1 ? whole_number(lines[i][0]) : std::nullopt;
        if (!size || *size > 1U << 20)
            throw Error(fmt::format("{}: expected the number of {}", at_line(file, first_line + static_cast<int>(i)),
                                    i == 0 ? "columns" : "rows"));
        (i == 0 ? header.columns : header.rows) = *size;
    }
    for (std::size_t i = 2; i < 6; ++i)
        (void)numbers_of(lines[i], 3, first_line + static_cast<int>(i), file);
    for (int i = 0; i < 4; ++i) {
        const auto row = numbers_of(lines[static_cast<std::size_t>(i) + 6], 4, first_line + 6 + i, file);
        for (int j = 0; j < 4; ++j)
            header.world_from_scan(j, i) = row[static_cast<std::size_t>(j)];
    }
    return header;
}

/// "0 0 0" means that nothing was seen.
Eigen::Vector3d ptx_point(std::string_view record, const Eigen::Matrix4d& world_from_scan) {
    const auto at = words(record);
    const Eigen::Vector3d point(*number(at[0]), *number(at[1]), *number(at[2]));
    if (point.isZero())
        return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    return (world_from_scan * point.homogeneous()).head<3>();
}

} // namespace

/// Leica's PTX: one scan after the other, each with its header and its grid, column by column. Points keep their order.
CloudRecords read_ptx(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    CloudRecords records;
    records.encoding = CloudRecords::Encoding::ascii;
    PtxHeader header = ptx_header(bytes, 1, file);
    records.header = bytes.substr(0, header.length);
    records.points.reserve(bytes.size() - header.length);
    std::size_t scans = 0, at = header.length, behind = header.length; // `behind` the last word that was read
    int line = 1 + static_cast<int>(PtxHeader::lines);
    for (cv::Size grid;; ++scans) {
        records.stations.push_back({records.point_count, header.world_from_scan.topRightCorner<3, 1>()});
        const std::string scan = scans == 0 ? "" : fmt::format("scan {}: ", scans + 1);
        TextRecords lines(bytes.substr(at), line);
        const std::uint64_t expected = header.points(), before = records.point_count;
        if (expected == 0)
            warnings.push_back(fmt::format("{}: {}no points: {} columns of {} rows.", file.string(), scan,
                                           header.columns, header.rows));
        check_point_count(before + expected, file);
        std::uint64_t found = 0;
        for (; found < expected && lines.next(); ++found) {
            const std::size_t columns = lines.words().size();
            if (records.fields.empty() && columns < 4)
                throw Error(fmt::format("{}: {} a point, expected x y z intensity [red green blue]",
                                        at_line(file, lines.line()), counted(columns, "value")));
            if (records.fields.empty())
                records.fields = fields_named(ptx_names(columns));
            check_numbers(lines, records.fields, file);
            const std::size_t end = at + lines.end();
            if (found == 0 && scans > 0) { // the header between scans is no part of the records
                const auto start = static_cast<std::size_t>(lines.words().front().data() - bytes.data());
                records.inserted.emplace(before, bytes.substr(behind, start - behind));
                behind = start;
            }
            records.points += bytes.substr(behind, end - behind);
            records.ends.push_back(records.points.size());
            records.placed.push_back(ptx_point(bytes.substr(behind, end - behind), header.world_from_scan));
            behind = end;
        }
        records.point_count += found;
        if (found != expected)
            throw Error(fmt::format("{}: {}{} columns of {} rows are {} points, the file holds {}", file.string(), scan,
                                    header.columns, header.rows, expected, found));
        grid = {static_cast<int>(header.rows), static_cast<int>(header.columns)};
        const std::string_view rest = trimmed(bytes.substr(behind)); // without what words() takes for blanks
        if (rest.empty()) {
            records.grid = scans == 0 ? grid : cv::Size(static_cast<int>(records.point_count), 1);
            break;
        }
        at = bytes.rfind('\n', static_cast<std::size_t>(rest.data() - bytes.data())) + 1;
        line = lines.line() + static_cast<int>(std::count(bytes.begin() + static_cast<std::ptrdiff_t>(behind),
                                                          bytes.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
        header = ptx_header(bytes.substr(at), line, file);
        at += header.length;
        line += static_cast<int>(PtxHeader::lines);
    }
    records.after = bytes.substr(behind);
    if (scans == 0) {
        records.viewpoint = Eigen::Isometry3d(Eigen::Translation3d(records.stations[0].position));
        records.stations.clear();
    } else {
        warnings.push_back(fmt::format("{}: {} scans are read as one cloud.", file.string(), scans + 1));
    }
    return records;
}

namespace {

/// What comes before the points: comments, names of columns, the number of points; each may be left out.
struct TextHeader {
    std::size_t length = 0;
    int lines = 0;
    std::vector<std::string> names;
    std::size_t names_end = 0; ///< behind the last word of the line of names
    double metres = 1;         ///< a unit of the coordinates
    std::optional<std::uint64_t> said;
    std::string odd; ///< a line that is neither names with x y z nor numbers
};

TextHeader text_header(std::string_view bytes) {
    TextHeader header;
    constexpr int most_lines = 1000;
    std::size_t at = header.length = bytes.starts_with(byte_order_mark) ? byte_order_mark.size() : 0;
    bool in_comment = false; // the names
    while (at < bytes.size() && header.lines < most_lines) {
        const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
        const std::string_view text = trimmed(bytes.substr(at, end - at));
        const auto line = words(text);
        const bool comment = text.starts_with('#') || text.starts_with("//");
        if (!line.empty() && !comment && all_numbers(line)) {
            if (line.size() > 1 || header.said || !whole_number(line[0])) {
                if (in_comment && header.names.size() != line.size()) { // a sentence, such as "x y z in metres"
                    header.names.clear();
                    header.metres = 1;
                }
                break;
            }
            header.said = whole_number(line[0]);
        } else if (const ColumnNames names = column_names(line); names_axes(names.ours)) {
            header.names = names.ours;
            header.names_end = static_cast<std::size_t>(text.data() + text.size() - bytes.data());
            in_comment = comment;
            header.metres = names.metres;
        } else if (!line.empty() && !header.names.empty() && is_line_of_units(line)) {
            header.metres = metres_in(line[0]);
        } else if (!line.empty() && !comment) {
            if (header.names.empty()) // else a point, whose words are refused one by one
                header.odd = text;
            break;
        }
        at = std::min(end + 1, bytes.size());
        ++header.lines;
        header.length = at;
    }
    return header;
}

} // namespace

bool is_text_cloud(std::string_view start) {
    constexpr std::size_t enough = 4096, not_a_matrix = 8;
    const bool cut = start.size() >= enough;
    start = start.substr(0, enough);
    const std::optional<std::string> usual = usual_text(start);
    start = usual ? *usual : start;
    const std::optional<std::string> of_cells = words_for_cells(start);
    start = of_cells ? *of_cells : start;
    const TextHeader header = text_header(start);
    const auto lines = first_numbers(start.substr(header.length), cut);
    if (!header.names.empty()) { // words in other columns are refused by their line
        const std::string_view first = start.substr(header.length, start.find('\n', header.length) - header.length);
        constexpr std::array of_poses{"qw",     "q_w",           "qx",   "q_x", "rot_w",
                                      "quat_w", "orientation_w", "roll", "yaw", "heading"};
        return std::ranges::none_of(of_poses,
                                    [&](const char* name) { return std::ranges::count(header.names, name) > 0; }) &&
               words(first).size() == header.names.size() && (lines.size() >= not_a_matrix || lines.empty());
    }
    if (!header.odd.empty() || lines.size() < not_a_matrix)
        return false;
    const std::size_t columns = lines.front().size();
    const auto colours_from = [&](std::size_t first_column) {
        return triple_in(lines, first_column) == Triple::colours;
    };
    // Times and positions have four columns, too, but times rise; and so have poses, with rows of 0 0 0 1.
    const auto of_intensity = [&] {
        return lines.size() >= std::min(enough_lines, start.size() / 64) &&
               !std::ranges::is_sorted(lines, {}, [](const auto& line) { return line[0]; }) &&
               std::ranges::all_of(lines, [](const auto& line) { return line[3] >= 0; }) &&
               std::ranges::count(lines, std::vector<double>{0, 0, 0, 1}) == 0;
    };
    return columns == 3 || (columns == 4 && of_intensity()) ||
           (columns == 6 && (colours_from(3) || triple_in(lines, 3) == Triple::normals)) ||
           (columns == 7 && (colours_from(4) || colours_from(3))) ||
           (columns == 9 && colours_from(3) && triple_in(lines, 6) == Triple::normals);
}

CloudRecords read_xyz(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    const std::optional<std::string> usual = usual_text(bytes);
    bytes = usual ? *usual : bytes;
    if (bytes.empty())
        throw Error(file.string() + ": a byte order mark and no text, expected a cloud");
    const std::optional<std::string> of_cells = words_for_cells(bytes);
    bytes = of_cells ? *of_cells : bytes;
    const TextHeader header = text_header(bytes);
    if (!header.odd.empty())
        throw Error(fmt::format("{}: {}, expected numbers, or names of columns with x, y and z among them",
                                at_line(file, header.lines + 1), in_quotes(header.odd)));
    CloudRecords records;
    records.encoding = CloudRecords::Encoding::ascii;
    records.fields = fields_named(header.names);
    records.scale.fill(header.metres);
    records.header = bytes.substr(0, header.length);
    read_lines(records, bytes.substr(header.length), header.lines + 1, file, warnings);
    if (records.fields.size() < 3 && records.point_count > 0)
        throw Error(fmt::format("{}: {} a line, expected x y z at least", file.string(),
                                counted(records.fields.size(), "value")));
    if (records.fields.empty())
        records.fields = fields_named({"x", "y", "z"});
    if (header.said && *header.said != records.point_count && records.inserted.empty())
        warnings.push_back(fmt::format("{}: says {} points, holds {}; all are read.", file.string(), *header.said,
                                       records.point_count));
    if (!records.inserted.empty())
        warnings.push_back(
            fmt::format("{}: {} scans are read as one cloud.", file.string(), records.inserted.size() + 1));
    return records;
}

std::string text_bytes(const CloudRecords& records, std::string points, const std::vector<FieldAddition>& additions) {
    std::string header = records.header;
    const TextHeader read = text_header(header);
    std::string added;
    for (const FieldAddition& addition : additions)
        added += " " + addition.name;
    if (!read.names.empty())
        header.insert(read.names_end, added);
    return between(header, std::move(points), records.after);
}

} // namespace scanshade
