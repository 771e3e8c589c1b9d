// The page of several captures. list.js reads what is written here.
#include "apps/page/list_page.h"

#include "apps/page/shell.h"
#include "apps/page/text.h"
#include "io/output_file.h"
#include "io/text.h"

#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace scanshade::page {
namespace {

json known_or_null(double value) { return std::isfinite(value) ? json(std::round(value * 1e4) / 1e4) : json(); }

} // namespace

void write_list(const std::filesystem::path& folder, const ListPage& list) {
    std::size_t frames = 0, ok = 0, doubtful = 0, failed = 0, left = 0;
    std::string lines;
    for (const ListRow& row : list.rows) {
        frames += row.frames;
        ok += row.ok;
        doubtful += row.doubtful;
        failed += row.failed;
        left += row.left;
        const json line = {row.name,
                           row.frames,
                           row.ok,
                           row.doubtful,
                           row.failed,
                           row.left,
                           known_or_null(row.coverage),
                           known_or_null(row.visibility),
                           known_or_null(row.ms),
                           row.page,
                           row.picture};
        lines += (lines.empty() ? "" : ",\n") + for_script(json_line(line));
    }
    json facts = json::array();
    for (const auto& [name, value] :
         {std::pair("captures", list.rows.size()), std::pair("frames", frames), std::pair("ok", ok),
          std::pair("doubtful", doubtful), std::pair("failed", failed), std::pair("left", left)})
        facts.push_back({name, std::to_string(value)});
    json reasons = json::array();
    for (const ListReason& each : list.reasons)
        reasons.push_back({each.kind, each.frames, each.reason, each.first});
    const json head{
        {"kind", "list"}, {"version", SCANSHADE_VERSION}, {"title", list.title}, {"subtitle", list.subtitle},
        {"facts", facts}, {"notes", list.notes},          {"reasons", reasons}};
    write_atomically(folder / "index.js", "scanshade.set_head(" + for_script(json_line(head)) +
                                              ");\nscanshade.add_rows([\n" + lines + "\n]);\n");
    write_atomically(folder / "index.html", list_shell(as_utf8(list.title) + " - scanshade"));
}

} // namespace scanshade::page
