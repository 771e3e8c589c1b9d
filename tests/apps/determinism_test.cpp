// The same bytes whatever the number of cores and of frames at once, and whether a run was resumed; and the bytes of
// tests/golden/hashes.txt, so that no change of results goes unnoticed.
//
// The hashes are those of one driver on one width of vectors, since compilers round differently, and of one family of
// processors: families 25 and 26 of AMD and 6 of Intel agree, 23 of AMD differs. A line is DEVICE | METHOD | HASH. On a
// device without lines the comparison is skipped. UPDATE_GOLDEN=1 writes them anew: for a change that is meant, with
// its reason and its errors before and after in the commit's message.
#include "ao/base/method.h"
#include "ao/gpu/device.h"
#include "io/content_hash.h"
#include "tests/support/files.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <sstream>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

const fs::path golden_file = fs::path(SCANSHADE_SOURCE) / "tests/golden/hashes.txt";

/// The hash of a folder's maps, confidences and pictures, in the order of their names.
std::string hash_of_results(const fs::path& out) {
    std::map<std::string, std::string> files;
    for (const char* part : {"ao", "confidence", "shaded"})
        for (const auto& entry : fs::directory_iterator(out / part))
            files[part + entry.path().filename().string()] = file_bytes(entry.path());
    std::string all;
    for (const auto& [name, bytes] : files)
        all += fmt::format("{} {}\n", name, hash_of(bytes));
    EXPECT_EQ(files.size(), 9U);
    return hash_of(all);
}

/// "AuthenticAMD 25": the maker and the family.
std::string processor() {
    std::istringstream lines(file_bytes("/proc/cpuinfo"));
    std::string maker = "unknown", family;
    for (std::string line; std::getline(lines, line) && !line.empty();)
        if (const std::size_t colon = line.find(": "); colon != std::string::npos) {
            if (line.starts_with("vendor_id"))
                maker = line.substr(colon + 2);
            if (line.starts_with("cpu family"))
                family = line.substr(colon + 1);
        }
    return maker + family;
}

std::string device_name() {
    const gpu::Device device;
    return device.info().name + ", " + device.info().driver + " on " + processor();
}

std::map<std::string, std::string> golden() {
    std::map<std::string, std::string> hashes;
    std::istringstream lines(file_bytes(golden_file));
    for (std::string line; std::getline(lines, line);)
        if (const std::size_t bar = line.rfind(" | "); bar != std::string::npos)
            hashes[line.substr(0, bar)] = line.substr(bar + 3);
    return hashes;
}

struct Case {
    std::string method, flags;
    [[nodiscard]] std::string name() const { return flags.empty() ? method : method + " " + flags; }
};

class Determinism : public testing::TestWithParam<Case> {
  protected:
    TemporaryFolder folder;
    void SetUp() override { write_capture(folder / "capture", 3); }
    [[nodiscard]] std::string run(const std::string& out, const std::string& more) const {
        const Ran ran = run_program(fmt::format(
            "run '{}' -o '{}' --method {} {} --write ao,confidence,shaded --page no {}", (folder / "capture").string(),
            (folder / out).string(), GetParam().method, GetParam().flags, more));
        EXPECT_NE(ran.exit_code, 1) << ran.err;
        EXPECT_NE(ran.exit_code, 3) << ran.err;
        return hash_of_results(folder / out);
    }
};

TEST_P(Determinism, bytes_depend_neither_on_frames_at_once_nor_on_resuming) {
    const std::string once = run("once", "");
    EXPECT_EQ(run("several", "--in-flight 3"), once);
    fs::remove(folder / "once/ao/001.png");
    EXPECT_EQ(run("once", "--resume"), once);
}

TEST_P(Determinism, results_are_those_of_the_golden_hashes) {
    const std::string key = device_name() + " | " + GetParam().name(), hash = run("out", "");
    auto hashes = golden();
    if (std::getenv("UPDATE_GOLDEN")) {
        hashes[key] = hash;
        std::string text;
        for (const auto& [name, value] : hashes)
            text += fmt::format("{} | {}\n", name, value);
        write_file(golden_file, text);
        GTEST_SKIP() << "written: " << key;
    }
    if (!hashes.contains(key))
        GTEST_SKIP() << "no hash of " << key;
    EXPECT_EQ(hash, hashes.at(key)) << "results changed: see the head of this file";
}

/// Every method; two also with noise in steps of disparity, whose planes are fitted in windows of their own.
std::vector<Case> cases() {
    std::vector<Case> all;
    for (const MethodRow& method : methods())
        all.push_back({std::string(method.name), ""});
    for (const char* method : {"cacao", "surfel"})
        all.push_back({method, "--depth-noise kinect"});
    return all;
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, Determinism, testing::ValuesIn(cases()), [](const auto& each) {
    return each.param.method + (each.param.flags.empty() ? "" : "_noisy");
});

} // namespace
} // namespace scanshade
