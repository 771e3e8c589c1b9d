// Fuzz target: what runs keep for themselves and people edit: journals, plans, settings. The first byte chooses.
#include "apps/job.h"
#include "apps/settings_file.h"
#include "tests/fuzz/fuzz.h"

#include <sstream>

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade;
    using namespace scanshade::fuzz;
    if (size == 0)
        return 0;
    const std::string_view bytes = text_of(data + 1, size - 1);
    if (data[0] % 3 == 0) {
        const auto file = as_file(bytes, "journal.jsonl");
        (void)read_journal(file); // passes over what makes no sense
        (void)is_complete(file);
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
