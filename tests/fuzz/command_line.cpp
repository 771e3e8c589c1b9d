// Fuzz target: the command line. A line for each word, the command first; behind "=====" a file that --settings may
// name. Nothing is run: words and flags become settings, and these must say again what was understood.
#include "apps/command_parser.h"
#include "apps/session/settings.h"
#include "tests/fuzz/fuzz.h"

#include <array>

namespace {

using namespace scanshade;
using namespace scanshade::fuzz;

/// The rows of `run`, whose settings are settled once all are known.
class Run final : public Command {
  public:
    Words words() override { return {"PATH", "", &settings_.paths, 0, 1000}; }
    std::vector<Stage> stages() override { return settings_.stages(); }
    void take_preset() override { settings_.take_preset(); }
    int run() override {
        settings_.resolve();
        (void)settings_.given_in_metres();
        must_hold(settings_.median_depth() > 0);
        return all_well;
    }

  private:
    RunSettings settings_;
};

std::unique_ptr<Command> settings_of_run() { return std::make_unique<Run>(); }

constexpr std::array makers = {inspect_command,  settings_of_run, plan_command,   status_command,  merge_command,
                               view_command,     refine_command,  relief_command, compare_command, bench_command,
                               generate_command, methods_command, devices_command};

/// Every value as text sets the same value: a manifest holds it so, and a run is made again from it.
void must_say_it_again(Command& command) {
    for (const Stage& stage : command.stages())
        for (const Parameter& row : stage.rows) {
            const std::string text = value_text(row);
            set(row, text);
            must_hold(value_text(row) == text);
        }
}

} // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const bool inside = (std::filesystem::create_directories(folder()), std::filesystem::current_path(folder()),
                                true); // where --settings finds its file
    (void)inside;
    if (size == 0)
        return 0;
    const auto parts = parts_of(text_of(data + 1, size - 1), 2);
    (void)as_file(parts[1], "settings.json");
    std::vector<std::string> words;
    for (std::string_view rest = parts[0]; !rest.empty();) {
        const auto end = rest.find('\n');
        words.emplace_back(rest.substr(0, end));
        rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    }
    for (const std::string& word : words)
        if (word.find('/') != std::string::npos || word.find('\0') != std::string::npos)
            return 0; // the kernel hands over no NUL; and no file of the machine shall be read
    const auto command = makers[data[0] % makers.size()]();
    if (!accepted([&] { parse(*command, words); }))
        return 0;
    must_say_it_again(*command);
    if (data[0] % makers.size() == 1)
        (void)accepted([&] { (void)command->run(); });
    return 0;
}
