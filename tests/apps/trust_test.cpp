// What others may plant in a folder of results, and what a run leaves to others: links, permissions, commands to
// repeat.
#include "apps/csv.h"
#include "io/output_file.h"
#include "tests/support/files.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <regex>
#include <sys/stat.h>
#include <unistd.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

/// A capture of one frame, and a file outside of what a run may write.
class TrustTest : public testing::Test {
  protected:
    TemporaryFolder folder;
    fs::path outside = write_file(folder / "outside/file.txt", "mine");

    void SetUp() override { write_capture(folder / "capture", 1); }
    [[nodiscard]] Ran run(const std::string& more = {}) const {
        return run_program(fmt::format("run '{}' -o '{}' --write ao {}", (folder / "capture").string(),
                                       (folder / "out").string(), more));
    }
};

TEST_F(TrustTest, a_link_under_a_temporary_name_is_not_followed) {
    // The names are those of the process and a count, which others can guess.
    const fs::path target = folder / "out/map.txt";
    fs::create_directories(folder / "out");
    for (int i = 0; i < 50; ++i)
        fs::create_symlink(outside, folder / fmt::format("out/.map.tmp-{}-{}.txt", ::getpid(), i));
    write_atomically(target, "theirs");
    EXPECT_EQ(file_bytes(outside), "mine");
    EXPECT_EQ(file_bytes(target), "theirs");
}

TEST_F(TrustTest, a_link_in_a_results_place_is_replaced_and_not_followed) {
    for (const char* name : {"frames.csv", "manifest.json", "index.js", "ao/000.png"}) {
        fs::create_directories((folder / "out" / name).parent_path());
        fs::create_symlink(outside, folder / "out" / name);
    }
    EXPECT_EQ(run("--overwrite").exit_code, 0);
    EXPECT_EQ(file_bytes(outside), "mine");
    EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(folder / "out/manifest.json")));
    EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(folder / "out/frames.csv")));
}

TEST_F(TrustTest, a_journal_is_not_kept_behind_a_link) {
    ASSERT_EQ(run().exit_code, 0);
    fs::path journal;
    for (const auto& entry : fs::directory_iterator(folder / "out"))
        if (entry.path().extension() == ".jsonl")
            journal = entry.path();
    ASSERT_FALSE(journal.empty());
    fs::remove(journal);
    fs::create_symlink(outside, journal);
    const Ran again = run("--overwrite");
    EXPECT_EQ(again.exit_code, 1) << again.err;
    EXPECT_TRUE(says(again.err, "symbolic link")) << again.err;
    EXPECT_EQ(file_bytes(outside), "mine");
}

TEST_F(TrustTest, results_are_not_written_through_a_linked_folder) {
    fs::create_directories(folder / "out");
    fs::create_directory_symlink(folder / "outside", folder / "out/ao");
    const Ran ran = run("--overwrite");
    EXPECT_EQ(ran.exit_code, 1) << ran.err;
    EXPECT_TRUE(says(ran.err, "out/ao: is a symbolic link")) << ran.err;
    EXPECT_EQ(std::distance(fs::directory_iterator(folder / "outside"), {}), 1);
}

TEST_F(TrustTest, what_the_umask_keeps_from_others_stays_from_others) {
    const mode_t before = ::umask(077);
    const Ran ran = run();
    ::umask(before);
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    for (const auto& entry : fs::recursive_directory_iterator(folder / "out"))
        EXPECT_EQ(entry.status().permissions() & (fs::perms::group_all | fs::perms::others_all), fs::perms::none)
            << entry.path();
}

/// A table's records as RFC 4180 reads them.
std::vector<std::vector<std::string>> records_of(const std::string& csv) {
    std::vector<std::vector<std::string>> records;
    bool quoted = false, begins = true;
    for (std::size_t i = 0; i < csv.size(); ++i) {
        if (begins)
            records.push_back({""});
        begins = false;
        std::string& field = records.back().back();
        if (quoted && csv[i] == '"' && i + 1 < csv.size() && csv[i + 1] == '"')
            field += csv[++i];
        else if (csv[i] == '"')
            quoted = !quoted;
        else if (csv[i] == ',' && !quoted)
            records.back().emplace_back();
        else if (csv[i] == '\n' && !quoted)
            begins = true;
        else
            field += csv[i];
    }
    return records;
}

const std::regex formula("[=+\\-@\t\r\n]"), kept_formula("'+[=+\\-@\t\r\n]");

TEST(CsvTest, no_text_begins_a_formula_and_every_text_comes_back) {
    for (const std::string text : {"", "a", "=1+1", "+1", "-0001", "@sum", "\t=1", "\r=1", "\n=1", "'", "'tis", "'=1",
                                   "''-2", "a=1", "=HYPERLINK(\"http://x\",\"y\")", "a,\"b\"\nc", "1.5", "frame -1"}) {
        const std::string line = "x," + csv_field(text) + ",y\n";
        const auto records = records_of(line);
        ASSERT_EQ(records.size(), 1U) << line;
        ASSERT_EQ(records[0].size(), 3U) << line;
        const std::string& cell = records[0][1];
        EXPECT_FALSE(std::regex_search(cell, formula, std::regex_constants::match_continuous)) << cell;
        const bool kept = std::regex_search(cell, kept_formula, std::regex_constants::match_continuous);
        EXPECT_EQ(kept ? cell.substr(1) : cell, text);
    }
}

TEST_F(TrustTest, a_frame_named_like_a_formula_is_text_in_every_table) {
    const std::string name = "=cmd|' C'!A0";
    for (const char* part : {"color", "depth"}) {
        const fs::path there = folder / "capture" / part / "000.png";
        if (fs::exists(there))
            fs::rename(there, there.parent_path() / (name + ".png"));
    }
    ASSERT_EQ(run().exit_code, 0);
    const auto frames = records_of(file_bytes(folder / "out/frames.csv"));
    ASSERT_EQ(frames.size(), 2U);
    EXPECT_EQ(frames[1][1], "'" + name);
    EXPECT_TRUE(fs::exists(folder / "out/ao" / (name + ".png"))) << "files keep the name";
    const Ran compared = run_program(
        fmt::format("compare '{0}' '{0}' -o '{1}'", (folder / "out/ao").string(), (folder / "same").string()));
    ASSERT_EQ(compared.exit_code, 0) << compared.err;
    const auto images = records_of(file_bytes(folder / "same/compare.csv"));
    ASSERT_EQ(images.size(), 2U);
    EXPECT_EQ(images[1][0], "'" + name);
}

TEST_F(TrustTest, the_command_in_a_manifest_repeats_the_run_and_runs_nothing_else) {
    const fs::path out = folder / "a'b $(touch hit); `touch hit` \"c\" \n d";
    std::string quoted;
    for (const char c : out.string())
        quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    ASSERT_EQ(run_program(fmt::format("run '{}' -o '{}' --write ao", (folder / "capture").string(), quoted)).exit_code,
              0);
    const auto manifest = nlohmann::json::parse(file_bytes(out / "manifest.json"));
    ASSERT_TRUE(manifest.contains("command_line"));
    const std::string command = manifest.at("command_line");
    const fs::path script =
        write_file(folder / "script", fmt::format("cd '{}'\n{} --overwrite\n", folder.path().string(), command));
    EXPECT_EQ(std::system(fmt::format("sh '{}' >/dev/null 2>&1", script.string()).c_str()), 0) << command;
    EXPECT_FALSE(fs::exists(folder / "hit"));
}

} // namespace
} // namespace scanshade
