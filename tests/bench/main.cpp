// The developers' measurements: `developers_bench PART [FLAG...]` prints the tables that READMEs quote.
#include "apps/command_parser.h"
#include "apps/help.h"
#include "projection/base/error.h"
#include "tests/bench/part.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>

namespace scanshade::bench {
namespace {

const std::array parts = {
    CommandRow{"bounce", "--write indirect against one bounce of rays on generated scenes", bounce_part},
    CommandRow{"cacao", "device milliseconds of CACAO's qualities and passes, and of a plain gather", cacao_part},
    CommandRow{"cacao-maps", "whether two devices make the same maps of CACAO", cacao_maps_part},
    CommandRow{"calibrate", "fits a method's free settings to truth, and judges them on other captures",
               calibrate_part},
    CommandRow{"cloud-errors", "errors of clouds' points, expected and found; fits ao/cloud/expected_errors.txt",
               cloud_errors_part},
    CommandRow{"clouds", "errors, seconds and memory of scenes' points against rays on the scene", clouds_part},
    CommandRow{"expected-errors", "errors of pixels, expected and found; fits ao/expected_errors.txt",
               expected_errors_part},
    CommandRow{"flatness", "how open planes of real captures read where nothing stands on them", flatness_part},
    CommandRow{"hard-cases", "methods on holes, noise, steps, odd sizes and units; exit 2 where a gate is missed",
               hard_cases_part},
    CommandRow{"normals", "degrees between normals and truth for each sensor; exit 2 where an aim is missed",
               normals_part},
    CommandRow{"relief-errors", "errors of sky view of generated terrain, expected and found", relief_errors_part},
    CommandRow{"sides", "what tells the scanned sides of clouds from the others; one JSON line each", sides_part},
};

void print_flags(const CommandRow& part) {
    const auto command = part.make();
    const Words words = command->words();
    fmt::print("developers_bench {}{} [flags]\n  {}\n\n", part.name, words.values ? " " + words.name + "..." : "",
               part.summary);
    for (const Stage& stage : command->stages())
        for (const Parameter& row : stage.rows)
            fmt::print("  {}: {} [{}]\n", flag_names(row), row.help, value_text(row));
}

int execute(const std::vector<std::string>& arguments) {
    const auto asks_for_help = [](const std::string& word) { return word == "--help" || word == "-h"; };
    if (arguments.empty() || asks_for_help(arguments[0])) {
        for (const CommandRow& part : parts)
            fmt::print("  developers_bench {:<16} {}\n", part.name, part.summary);
        return arguments.empty() ? misuse : all_well;
    }
    const auto part = std::ranges::find(parts, arguments[0], &CommandRow::name);
    if (part == parts.end())
        throw Misuse(arguments[0] + ": no such part");
    const std::vector<std::string> rest(arguments.begin() + 1, arguments.end());
    if (std::ranges::any_of(rest, asks_for_help)) {
        print_flags(*part);
        return all_well;
    }
    const auto command = part->make();
    parse(*command, rest);
    return command->run();
}

} // namespace
} // namespace scanshade::bench

int main(int count, char** words) {
    using namespace scanshade;
    try {
        return bench::execute({words + std::min(count, 1), words + count});
    } catch (const Misuse& failure) {
        fmt::print(stderr, "developers_bench: {}\n", failure.what());
        return misuse;
    } catch (const std::exception& failure) {
        fmt::print(stderr, "developers_bench: {}\n", failure.what());
        return nothing_done;
    }
}
