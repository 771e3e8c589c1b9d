// The program cacao_reference itself: what it makes of cases that cannot run.
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using tests::says;

struct Checked {
    int exit_code;
    std::string out;
};

Checked checked(const json& manifest) {
    const tests::TemporaryFolder folder;
    std::ofstream(folder / "manifest.json") << manifest;
    const std::string command =
        fmt::format("'{}' '{}' >'{}' 2>&1", CACAO_REFERENCE, folder.path().string(), (folder / "out").string());
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, tests::read_bytes(folder / "out")};
}

TEST(CacaoReference, EveryCaseThatCannotRunIsCountedAsFailed) {
    const json manifest = {{"inputs", json::object()},
                           {"cases",
                            {{{"id", "no_such_input"}, {"input", "nothing"}, {"output", "none.png"}},
                             {{"id", 7}},
                             json::object(),
                             {{"id", "last"}, {"input", "nothing"}}}}};
    const Checked result = checked(manifest);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_TRUE(says(result.out, "no_such_input"));
    EXPECT_TRUE(says(result.out, "last"));
    EXPECT_TRUE(says(result.out, "0 cases that ran"));
    EXPECT_TRUE(says(result.out, "4 failed"));
}

TEST(CacaoReference, ASoundCaseRunsAfterABrokenOne) {
    const char* set = std::getenv("SCANSHADE_FIXTURES");
    const fs::path fixtures = set ? set : "SCANSHADE_FIXTURES is not set";
    if (!fs::exists(fixtures / "manifest.json"))
        GTEST_SKIP() << "no recorded outputs; SCANSHADE_FIXTURES names their folder";
    json manifest = json::parse(std::ifstream(fixtures / "manifest.json"));
    json sound = manifest["cases"].front();
    sound["output"] = fs::absolute(fixtures / sound["output"].get<std::string>()).string();
    json& input = manifest["inputs"][sound["input"].get<std::string>()]["file"];
    input = fs::absolute(fixtures / input.get<std::string>()).string();
    json refused = sound;
    refused["id"] = "refused";
    refused["settings"]["sharpness"] = -3;
    manifest["cases"] = {refused, sound};
    const Checked result = checked(manifest);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_TRUE(says(result.out, "sharpness: '-3' given"));
    EXPECT_TRUE(says(result.out, "worst of the 1 cases that ran: 100.000 %"));
    EXPECT_TRUE(says(result.out, "0 missed, 1 failed"));
}

} // namespace
} // namespace scanshade
