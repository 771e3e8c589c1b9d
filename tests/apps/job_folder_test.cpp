// What a job's folder must be able to do, and how little of it is read: locks and renames that work, sums in place of
// rows, one listing for all blocks of a capture.
#include "apps/command.h"
#include "apps/jobs/folder_probe.h"
#include "apps/json.h"
#include "apps/results/journal.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <cerrno>
#include <cstdio>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/file.h>

namespace scanshade {
namespace {

using tests::Ran;
using tests::read_bytes;
using tests::refusal;
using tests::run_program;
using tests::says;
using tests::TemporaryFolder;
using tests::write_file;
namespace fs = std::filesystem;

// ---------------------------------------------------------------------------------------------------- the probe

TEST(FolderProbeTest, a_local_disk_locks_and_renames_and_keeps_no_file_of_the_probe) {
    const TemporaryFolder folder;
    EXPECT_EQ(locks_fail_in(folder.path()), "");
    EXPECT_EQ(renames_fail_in(folder.path()), "");
    EXPECT_NO_THROW(require_job_folder(folder / "made", true));
    EXPECT_TRUE(fs::is_empty(folder / "made"));
}

TEST(FolderProbeTest, locks_that_are_not_there_or_lie_are_recognised) {
    const TemporaryFolder folder;
    const auto found = [&](const std::function<int(int, int)>& flock) {
        return locks_fail_in(folder.path(), {.flock = flock});
    };
    EXPECT_TRUE(says(found([](int, int) { return errno = ENOSYS, -1; }), "cannot be locked: Function not implemented"));
    EXPECT_TRUE(says(found([](int, int) { return errno = ENOLCK, -1; }), "cannot be locked: No locks available"));
    EXPECT_TRUE(says(found([](int, int) { return 0; }), "two processes lock the same file at once"));
    EXPECT_TRUE(
        says(found([](int handle, int operation) { return operation == LOCK_UN ? 0 : ::flock(handle, operation); }),
             "a lock that was given back stays"));
    const pid_t here = getpid();
    EXPECT_TRUE(says(found([here](int handle, int operation) {
                         return getpid() == here ? ::flock(handle, operation) : (errno = EIO, -1);
                     }),
                     "a lock of another process cannot be seen"));
    EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(FolderProbeTest, renames_that_fail_or_copy_are_recognised) {
    const TemporaryFolder folder;
    const auto found = [&](const std::function<int(const char*, const char*)>& rename) {
        return renames_fail_in(folder.path(), {.rename = rename});
    };
    EXPECT_TRUE(
        says(found([](const char*, const char*) { return errno = EPERM, -1; }), "cannot be renamed onto another"));
    EXPECT_TRUE(says(found([](const char*, const char*) { return 0; }), "does not replace it"));
    EXPECT_TRUE(says(found([](const char* from, const char* to) {
                         fs::copy_file(from, to, fs::copy_options::overwrite_existing);
                         return 0;
                     }),
                     "does not replace it"));
    EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(FolderProbeTest, mounts_whose_locks_are_local_are_known_by_their_options) {
    const std::string mounts = "22 1 8:1 / / rw,relatime - ext4 /dev/sda1 rw\n"
                               "30 22 0:40 / /net/my\\040data rw - nfs4 host:/data rw,vers=4.2,local_lock=none\n"
                               "31 22 0:41 / /net/old rw - nfs host:/old rw,vers=3,local_lock=all\n"
                               "32 22 0:42 / /lustre rw - lustre host:/l rw,localflock\n"
                               "33 31 0:43 / /net/old/inner rw - nfs host:/x rw,local_lock=none\n";
    EXPECT_EQ(local_locks_option("/home/job", mounts), "");
    EXPECT_EQ(local_locks_option("/net/my data/job", mounts), "");
    EXPECT_EQ(local_locks_option("/net/old/job", mounts), "local_lock=all");
    EXPECT_EQ(local_locks_option("/net/older", mounts), "");
    EXPECT_EQ(local_locks_option("/lustre", mounts), "localflock");
    EXPECT_EQ(local_locks_option("/net/old/inner/job", mounts), "");
    EXPECT_EQ(local_locks_option("/x", "garbage\n\n1 2 3\n"), "");
}

// ---------------------------------------------------------------------------------------------------- sums

class SumsTest : public testing::Test {
  protected:
    [[nodiscard]] fs::path file() const { return journal_file(folder.path(), ""); }
    /// A journal of frames, the second of which failed.
    void keep(int frames) const {
        Journal journal(folder.path(), "");
        TaskSums sums;
        for (int i = 0; i < frames; ++i) {
            FrameRow row;
            CaptureEntry entry;
            entry.name = row.name = fmt::format("{:03}", i);
            row.status = i == 1 ? FrameStatus::failed : FrameStatus::ok;
            row.fault = i == 1 ? Fault::input : Fault::none;
            row.why = i == 1 ? "/data/c/depth/001.png: 60 bytes are too few" : "";
            row.ms.compute = 2;
            journal.add(row, entry, "settings", "device");
            sums.add(row, {"/data/c"});
        }
        journal.complete("key", sums);
    }
    TemporaryFolder folder;
};

TEST_F(SumsTest, a_complete_journal_ends_with_its_sums) {
    keep(5);
    const auto end = read_journal_end(file());
    ASSERT_TRUE(end);
    EXPECT_EQ(end->sums.ok, 4u);
    EXPECT_EQ(end->sums.failed, 1u);
    EXPECT_EQ(end->sums.ms.compute, 10);
    EXPECT_EQ(end->device, "device");
    ASSERT_EQ(end->sums.reasons.size(), 1u);
    EXPECT_EQ(end->sums.reasons.begin()->first, "input: depth/FRAME.png: # bytes are too few");
    EXPECT_EQ(end->sums.reasons.begin()->second.example, "001");
}

TEST_F(SumsTest, sums_do_not_count_where_something_followed_or_is_missing) {
    EXPECT_FALSE(read_journal_end(folder / "none"));
    keep(5);
    const std::string all = read_bytes(file());
    for (const char* more : {R"({"again":["001"]})", R"({"begun":"001"})", R"({"process":{}})", R"({"frame":{}})"})
        EXPECT_FALSE(read_journal_end(write_file(folder / "more", all + more + "\n"))) << more;
    const auto complete = all.rfind("{\"complete\"");
    EXPECT_FALSE(read_journal_end(write_file(folder / "cut", all.substr(0, complete))));
    EXPECT_FALSE(read_journal_end(write_file(folder / "torn", all.substr(0, complete + 5))));
    const std::string older = all.substr(0, all.rfind("{\"sums\"")) + all.substr(complete);
    EXPECT_FALSE(read_journal_end(write_file(folder / "older", older))) << "an earlier version wrote no sums";
    std::string wrong = all;
    wrong.replace(wrong.rfind("\"ok\":4"), 6, "\"ok\":[]");
    EXPECT_FALSE(read_journal_end(write_file(folder / "wrong", wrong)));
}

TEST_F(SumsTest, status_tells_the_same_with_sums_and_without) {
    tests::write_capture(folder / "data/capture", 7);
    fs::resize_file(folder / "data/capture/depth/003.png", 60);
    const std::string job = (folder / "job").string();
    ASSERT_EQ(run_program(fmt::format("plan {} -o {} --block 3 --write ao", (folder / "data").string(), job)).exit_code,
              0);
    EXPECT_EQ(run_program("run " + job).exit_code, some_failed);
    const Ran with = run_program("status " + job), as_json = run_program("status --json " + job);
    EXPECT_TRUE(says(with.out, "frames  6 ok, 0 doubtful, 1 failed, 0 left, of 7"));
    for (const auto& entry : fs::directory_iterator(folder / "job/results/data/capture"))
        if (entry.path().extension() == ".jsonl") {
            const std::string all = read_bytes(entry.path());
            const auto sums = all.rfind("{\"sums\""), next = all.find('\n', sums) + 1;
            ASSERT_NE(sums, std::string::npos);
            write_file(entry.path(), all.substr(0, sums) + all.substr(next));
        }
    const Ran without = run_program("status " + job);
    EXPECT_EQ(with.out, without.out);
    EXPECT_EQ(with.exit_code, without.exit_code);
    EXPECT_EQ(as_json.out, run_program("status --json " + job).out);
}

// ---------------------------------------------------------------------------------------------------- blocks

TEST_F(SumsTest, frames_of_another_plans_blocks_are_not_done_again) {
    tests::write_capture(folder / "data/capture", 8);
    const std::string job = (folder / "job").string(), data = (folder / "data").string();
    const auto lines = [&] {
        std::size_t found = 0;
        for (const auto& entry : fs::directory_iterator(folder / "job/results/data/capture"))
            if (entry.path().extension() == ".jsonl") {
                const std::string all = read_bytes(entry.path());
                for (auto at = all.find("{\"frame\":"); at != std::string::npos; at = all.find("{\"frame\":", at + 1))
                    ++found;
            }
        return found;
    };
    for (const int block :
         {4, 3, 100}) { // four blocks in all, whose journals hold frames of each other, and one of all
        ASSERT_EQ(
            run_program(fmt::format("plan {} -o {} --overwrite --block {} --write ao --page no", data, job, block))
                .exit_code,
            0);
        ASSERT_EQ(run_program("run " + job).exit_code, all_well);
        EXPECT_EQ(lines(), 8u) << "with blocks of " << block;
    }
}

TEST_F(SumsTest, half_files_of_a_killed_block_are_removed) {
    tests::write_capture(folder / "data/capture", 4);
    const std::string job = (folder / "job").string(), data = (folder / "data").string();
    ASSERT_EQ(run_program(fmt::format("plan {} -o {} --block 2 --write ao", data, job)).exit_code, 0);
    const fs::path results = folder / "job/results/data/capture";
    write_file(results / "journal.0-2.jsonl", ""); // killed before its first frame was whole
    write_file(results / "ao/.000.tmp-1-1.png", "half");
    ASSERT_EQ(run_program("run " + job).exit_code, all_well);
    EXPECT_FALSE(fs::exists(results / "ao/.000.tmp-1-1.png"));
}

} // namespace
} // namespace scanshade
