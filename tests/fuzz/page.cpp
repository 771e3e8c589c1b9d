// Fuzz target: what others name and write, as pages and tables hold it. The first byte chooses: a manifest -> the page
// of a run; names -> the page of a list; names -> frames.csv. Nothing of them may become markup or script.
#include "apps/json.h"
#include "apps/page/list_page.h"
#include "apps/page/run_page.h"
#include "apps/page/text.h"
#include "apps/results/report.h"
#include "io/text.h"
#include "tests/fuzz/fuzz.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

/// index.js is two calls with JSON in them, whatever the data say.
json rows_of(const std::string& script) {
    constexpr std::string_view head = "scanshade.set_head(", rows = ");\nscanshade.add_rows([\n", end = "\n]);\n";
    must_hold(script.find_first_of("<&") == std::string::npos);
    must_hold(script.find("\xE2\x80\xA8") == std::string::npos && script.find("\xE2\x80\xA9") == std::string::npos);
    must_hold(script.starts_with(head) && script.ends_with(end));
    const std::size_t between = script.find(rows);
    must_hold(between != std::string::npos);
    must_hold(parsed_json(script.substr(head.size(), between - head.size())).is_object());
    const std::size_t first = between + rows.size();
    return parsed_json("[" + script.substr(first, script.size() - end.size() - first) + "]");
}

/// All tags of the page but those of its title are the same for every title.
void must_be_the_template(const std::string& html, std::string_view title) {
    const std::string shown = page::escaped(title);
    must_hold(shown.find_first_of("<>\"'") == std::string::npos);
    must_hold(html.find("<title>" + shown) != std::string::npos);
    static const auto tags = std::ranges::count(html, '<');
    must_hold(std::ranges::count(html, '<') == tags);
}

void make_the_page_of_a_run(std::string_view bytes) {
    const auto parts = parts_of(bytes, 2);
    std::vector<std::filesystem::path> manifests;
    for (std::size_t i = 0; i < parts.size(); ++i)
        if (!parts[i].empty())
            manifests.push_back(as_file(parts[i], "run/manifest." + std::to_string(i) + ".json"));
    const auto folder_of_page = folder() / "run";
    if (!accepted([&] { page::write_from_manifests(folder_of_page, manifests); }))
        return;
    for (const json& row : rows_of(read_bytes(folder_of_page / "index.js")))
        must_hold(row.is_array() && row.size() >= 7 && row[1].is_string());
    const std::string html = read_bytes(folder_of_page / "index.html");
    static const auto tags = std::ranges::count(html, '<');
    must_hold(std::ranges::count(html, '<') == tags);
}

void make_the_page_of_a_list(std::string_view bytes) {
    const auto parts = parts_of(bytes, 6);
    const std::string name(parts[0]), title(parts[1]), note(parts[2]), reason(parts[3]), path(parts[4]);
    page::write_list(folder() / "list", {title,
                                         std::string(parts[5]),
                                         {note},
                                         {{"failed", 1, reason, name}},
                                         {{name, 1, 1, 0, 0, 0, 0.5, 0.5, 1, path}, {title, 2, 0, 0, 2, 0, 0, 0, 0}}});
    const json rows = rows_of(read_bytes(folder() / "list/index.js"));
    must_hold(rows.size() == 2 && rows[0][0] == parsed_json(json_line(json(name))));
    must_be_the_template(read_bytes(folder() / "list/index.html"), as_utf8(title));
}

/// RFC 4180's reading of one record, and the text of each field as apps/csv.h has it.
std::vector<std::string> fields_of(std::string_view record) {
    std::vector<std::string> fields(1);
    bool quoted = false;
    for (std::size_t i = 0; i < record.size(); ++i) {
        const char c = record[i];
        if (quoted && c == '"' && record.substr(i + 1).starts_with('"'))
            fields.back() += record[++i];
        else if (c == '"')
            quoted = !quoted;
        else if (c == ',' && !quoted)
            fields.emplace_back();
        else
            fields.back() += c;
    }
    must_hold(!quoted);
    for (std::string& field : fields)
        if (const std::size_t first = field.find_first_not_of('\''); first != std::string::npos && first > 0)
            if (std::string_view("=+-@\t\r\n").find(field[first]) != std::string_view::npos)
                field.erase(0, 1);
    return fields;
}

void make_a_table(std::string_view bytes) {
    const auto parts = parts_of(bytes, 4);
    FrameRow row;
    row.name = parts[0];
    row.status = FrameStatus::failed;
    row.why = parts[1];
    row.warnings = {std::string(parts[2]), std::string(parts[3])};
    const std::string file_line = csv_line(row), head = csv_head();
    const auto fields = fields_of(file_line.substr(0, file_line.find_last_not_of('\n') + 1));
    must_hold(fields.size() == fields_of(head).size());
    must_hold(std::ranges::count(fields, row.name) > 0 && std::ranges::count(fields, row.why) > 0);
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0)
        return 0;
    const std::string_view bytes = text_of(data + 1, size - 1);
    if (data[0] % 3 == 0)
        make_the_page_of_a_run(bytes);
    else if (data[0] % 3 == 1)
        make_the_page_of_a_list(bytes);
    else
        make_a_table(bytes);
    return 0;
}
