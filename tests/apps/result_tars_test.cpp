// Results as tars: what single files hold, in the form of WebDataset, and the same bytes after any interruption.
#include "io/files.h"
#include "io/text.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <chrono>
#include <csignal>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <thread>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::Ran;
using tests::run_program;
using tests::write_file;

class ResultTarsTest : public testing::Test {
  protected:
    void record(int frames) { tests::write_capture(folder / "capture", frames); }
    [[nodiscard]] fs::path out() const { return folder / "out"; }
    [[nodiscard]] Ran run(const std::string& flags, const std::string& to = "out") const {
        return run_program(
            fmt::format("run {} -o {} {}", (folder / "capture").string(), (folder / to).string(), flags));
    }
    /// Names and bytes of everything in the folder of tars.
    [[nodiscard]] std::map<std::string, std::string> tars() const {
        std::map<std::string, std::string> all;
        for (const auto& entry : fs::recursive_directory_iterator(out() / "tars"))
            all[entry.path().lexically_relative(out() / "tars").string()] =
                entry.is_regular_file() ? file_bytes(entry.path()) : "";
        return all;
    }
    const tests::TemporaryFolder folder;
};

TEST_F(ResultTarsTest, hold_the_bytes_of_single_files_and_a_row_for_each_frame) {
    record(5);
    ASSERT_EQ(run("--tar 2").exit_code, 0);
    ASSERT_EQ(run("", "single").exit_code, 0);
    const auto all = tars();
    ASSERT_EQ(all.size(), 3u);
    for (int i = 0; i < 5; ++i) {
        const fs::path tar = out() / fmt::format("tars/{:06}.tar", i / 2);
        const std::string name = fmt::format("{:03}", i);
        for (const char* kind : {"ao", "confidence", "shaded"})
            EXPECT_EQ(read_bytes(tar / (name + "." + kind + ".png")),
                      file_bytes(folder / "single" / kind / (name + ".png")));
        const auto row = nlohmann::json::parse(read_bytes(tar / (name + ".json")));
        EXPECT_EQ(row["status"], "ok");
        EXPECT_EQ(row["index"], i);
        EXPECT_TRUE(row["camera"].contains("fx"));
        EXPECT_FALSE(row.contains("ms")); // would differ from run to run
    }
    EXPECT_FALSE(fs::exists(out() / "ao"));
    EXPECT_TRUE(fs::exists(out() / "index.html"));
    const auto manifest = nlohmann::json::parse(file_bytes(out() / "manifest.json"));
    EXPECT_EQ(manifest["frames"][4]["files"][0], "tars/000002.tar/004.ao.png");
    EXPECT_TRUE(manifest["not_of_this_run"].empty());
}

TEST_F(ResultTarsTest, failed_frames_leave_their_row_alone) {
    record(3);
    write_file(folder / "capture/depth/001.png", "damaged");
    EXPECT_EQ(run("--tar 10").exit_code, 2);
    const fs::path tar = out() / "tars/000000.tar";
    const auto row = nlohmann::json::parse(read_bytes(tar / "001.json"));
    EXPECT_EQ(row["status"], "failed");
    EXPECT_NE(row["why"], "");
    EXPECT_FALSE(is_there(tar / "001.ao.png"));
    EXPECT_TRUE(is_there(tar / "002.ao.png"));
}

TEST_F(ResultTarsTest, killed_and_resumed_they_have_the_bytes_of_an_uninterrupted_run) {
    record(60);
    ASSERT_EQ(run("--tar 7").exit_code, 0);
    const auto expected = tars();
    ASSERT_EQ(expected.size(), 9u);
    for (const int tars_before_kill : {0, 1, 4}) {
        fs::remove_all(out());
        const pid_t child = tests::start_program(
            {"run", (folder / "capture").string(), "-o", out().string(), "--tar", "7", "--resume"});
        const fs::path last = out() / fmt::format("tars/{:06}.tar", std::max(0, tars_before_kill - 1));
        const auto reached = [&] { return tars_before_kill == 0 ? fs::exists(out() / "tars") : fs::exists(last); };
        for (int tries = 0; tries < 60000 && !reached(); ++tries)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
        kill(child, SIGKILL);
        waitpid(child, nullptr, 0);
        const Ran again = run("--tar 7 --resume");
        EXPECT_EQ(again.exit_code, 0) << again.err;
        EXPECT_TRUE(tars() == expected) << tars_before_kill;
    }
    EXPECT_NE(run("--tar 7 --resume").err.find("done already"), std::string::npos);
}

TEST_F(ResultTarsTest, a_changed_frame_renews_its_tar_and_no_other) {
    record(6);
    ASSERT_EQ(run("--tar 2 --depth-noise none").exit_code, 0);
    const auto before = fs::last_write_time(out() / "tars/000000.tar");
    fs::copy_file(folder / "capture/depth/000.png", folder / "capture/depth/003.png",
                  fs::copy_options::overwrite_existing);
    EXPECT_EQ(run("--tar 2 --depth-noise none --resume").exit_code, 0);
    EXPECT_EQ(fs::last_write_time(out() / "tars/000000.tar"), before);
    EXPECT_EQ(read_bytes(out() / "tars/000000.tar/000.ao.png"), read_bytes(out() / "tars/000001.tar/003.ao.png"));
    fs::remove(out() / "tars/000002.tar");
    EXPECT_EQ(run("--tar 2 --depth-noise none --resume").exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "tars/000002.tar"));
}

/// What WebDataset does: members in order, grouped by the name up to its first dot.
constexpr const char* read_as_webdataset = R"(
import sys, tarfile, json
seen = []
for path in sys.argv[1:]:
    for member in tarfile.open(path):
        assert (member.mtime, member.uid, member.gid, member.mode) == (0, 0, 0, 0o644), member
        key, part = member.name.split('.', 1)
        if not seen or seen[-1][0] != key:
            assert key not in [k for k, _ in seen], 'members of a key lie apart'
            seen.append((key, {}))
        seen[-1][1][part] = tarfile.open(path).extractfile(member.name).read()
for i, (key, sample) in enumerate(seen):
    row = json.loads(sample['json'])
    assert row['index'] == i and set(sample) == {'ao.png', 'confidence.png', 'shaded.png', 'json'}, (row, list(sample))
    assert sample['ao.png'].startswith(b'\x89PNG')
print(len(seen))
)";

TEST_F(ResultTarsTest, pythons_tarfile_groups_them_into_samples) {
    if (std::system("python3 -c '' 2>/dev/null") != 0)
        GTEST_SKIP() << "python3 is not there; tests/run installs it";
    record(5);
    fs::rename(folder / "capture/depth/004.png", folder / "capture/depth/004.5.png"); // a dot in a name
    fs::rename(folder / "capture/color/004.png", folder / "capture/color/004.5.png");
    fs::rename(folder / "capture/depth/003.png", folder / ("capture/depth/003" + std::string(120, 'n') + ".png"));
    fs::rename(folder / "capture/color/003.png", folder / ("capture/color/003" + std::string(120, 'n') + ".png"));
    ASSERT_EQ(run("--tar 2").exit_code, 0);
    write_file(folder / "read.py", read_as_webdataset);
    EXPECT_EQ(std::system(
                  fmt::format("test \"$(python3 {} {}/tars/*.tar)\" = 5", (folder / "read.py").string(), out().string())
                      .c_str()),
              0);
    EXPECT_TRUE(is_there(out() / "tars/000002.tar/004_5.ao.png"));
}

TEST_F(ResultTarsTest, blocks_of_a_job_have_tars_of_their_own) {
    record(8);
    ASSERT_EQ(run_program(fmt::format("plan {} -o {} --block 4 --tar 3", (folder / "capture").string(),
                                      (folder / "job").string()))
                  .exit_code,
              0);
    ASSERT_EQ(run_program(fmt::format("run {}", (folder / "job").string())).exit_code, 0);
    std::vector<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder / "job/results"))
        if (entry.path().extension() == ".tar")
            names.push_back(entry.path().filename().string());
    std::ranges::sort(names);
    EXPECT_EQ(names,
              (std::vector<std::string>{"0-4-000000.tar", "0-4-000001.tar", "4-8-000000.tar", "4-8-000001.tar"}));
}

TEST_F(ResultTarsTest, a_capture_in_a_tar_gives_the_bytes_of_its_folder) {
    record(4);
    ASSERT_EQ(run("--tar 2").exit_code, 0);
    const auto expected = tars();
    ASSERT_EQ(std::system(fmt::format("tar -C {0} -cf {0}/capture.tar capture", folder.path().string()).c_str()), 0);
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --tar 2 --overwrite", (folder / "capture.tar/capture").string(),
                                      out().string()))
                  .exit_code,
              0);
    for (const int i : {0, 3}) {
        const std::string name = fmt::format("tars/{:06}.tar", i / 2), part = fmt::format("{:03}.ao.png", i);
        EXPECT_NE(expected.at(name.substr(5)).find(read_bytes(out() / name / part)), std::string::npos);
    }
}

} // namespace
} // namespace scanshade
