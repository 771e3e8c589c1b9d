// Fuzz target: what runs keep for themselves and people edit: journals, plans, settings. The first byte chooses.
#include "apps/jobs/job.h"
#include "apps/settings_file.h"
#include "tests/fuzz/fuzz.h"

#include <optional>
#include <sstream>

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

/// Whatever a journal holds: a run finds by its places what `status` and `merge` read, and what it adds is read again.
void keep_a_journal(std::string_view bytes) {
    const auto file = as_file(bytes, "journal/journal.jsonl");
    (void)is_complete(file);
    (void)read_journal_end(file);
    Journal journal(file.parent_path(), "");
    CaptureEntry entry;
    FrameRow row;
    for (const auto& [name, record] : read_journal(file).records) {
        entry.name = row.name = name;
        (void)journal.done(entry, std::nullopt, true);
        const FrameRow whole = journal.whole(row);
        must_hold(whole.name == name && whole.why == record.row.why && whole.notes == record.row.notes &&
                  whole.warnings == record.row.warnings && whole.files == record.row.files);
    }
    entry.name = row.name = "added";
    row.status = FrameStatus::ok;
    row.notes = {"first", "second"};
    journal.add(row, entry, "settings", "device");
    must_hold(journal.done(entry, "settings", true).has_value() && journal.whole(row).notes == row.notes);
    must_hold(read_journal(file).records.at("added").row.notes == row.notes);
    TaskSums sums;
    sums.add(row, {});
    journal.complete("key", sums);
    const auto end = read_journal_end(file);
    must_hold(end && end->sums.ok == 1 && end->sums.rows() == 1);
    must_hold(is_complete(file) && read_journal(file).complete == "key");
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0)
        return 0;
    const std::string_view bytes = text_of(data + 1, size - 1);
    if (data[0] % 3 == 0) {
        keep_a_journal(bytes);
    } else if (data[0] % 3 == 1) {
        const auto parts = parts_of(bytes, 2);
        (void)as_file(parts[0], "job/plan.json");
        (void)as_file(parts[1], "job/tasks.jsonl");
        (void)accepted([&] {
            for (const Task& task : read_plan(folder() / "job").tasks) {
                const auto inside = results_of("job", task).lexically_normal().lexically_relative("job/results");
                must_hold(!inside.empty() && *inside.begin() != "..");
            }
        });
    } else {
        std::istringstream stream{std::string(bytes)};
        (void)accepted([&] { (void)SettingsFile().from_config(stream); });
    }
    return 0;
}
