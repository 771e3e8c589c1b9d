// What a journal promises of the disk: every line at once for the kernel, a second later for the disk, and at once
// where the line says that a task is complete.
//
// This program's own fdatasync() stands before the C library's, counts the call and passes it on.
#include "apps/results/journal.h"
#include "tests/support/files.h"

#include <cerrno>
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace {

int syncs = 0, error_of_sync = 0;

} // namespace

extern "C" __attribute__((visibility("default"))) int fdatasync(int handle) {
    ++syncs;
    if (error_of_sync != 0) {
        errno = error_of_sync;
        return -1;
    }
    return static_cast<int>(::syscall(SYS_fdatasync, handle));
}

namespace scanshade {
namespace {

using namespace tests;

struct JournalTest : testing::Test {
    void SetUp() override { syncs = error_of_sync = 0; }
    void TearDown() override { error_of_sync = 0; }
    static CaptureEntry entry(const std::string& name) {
        CaptureEntry made;
        made.name = name;
        return made;
    }
    static FrameRow row(const std::string& name) {
        FrameRow made;
        made.name = name;
        made.status = FrameStatus::ok;
        return made;
    }
    [[nodiscard]] std::size_t lines() const {
        const std::string all = file_bytes(journal_file(folder.path(), ""));
        return static_cast<std::size_t>(std::count(all.begin(), all.end(), '\n'));
    }
    const TemporaryFolder folder;
};

TEST_F(JournalTest, frames_share_a_sync_and_the_last_line_has_its_own) {
    Journal journal(folder.path(), "");
    for (int i = 0; i < 20; ++i) {
        journal.add(row(std::to_string(i)), entry(std::to_string(i)), "settings", "device");
        EXPECT_EQ(lines(), static_cast<std::size_t>(i) + 2) << "the process' own line comes first; the kernel has all";
    }
    EXPECT_LT(syncs, 20) << "a sync takes milliseconds: no frame needs one of its own";
    const int before = syncs;
    journal.complete("key", {});
    EXPECT_EQ(syncs, before + 1) << "who reads that a task is complete must find its frames after a power cut, too";
    journal.complete("key", {});
    EXPECT_EQ(syncs, before + 1) << "it says so already";
}

TEST_F(JournalTest, a_line_that_does_not_reach_the_disk_is_an_outage) {
    Journal journal(folder.path(), "");
    error_of_sync = EIO;
    EXPECT_THROW(journal.complete("key", {}), Outage);
}

TEST_F(JournalTest, of_two_lines_on_a_frame_the_last_one_counts_and_forgotten_ones_do_not) {
    Capture capture;
    capture.entries = {entry("a"), entry("b")};
    {
        Journal journal(folder.path(), "");
        for (const char* why : {"first", "second"}) {
            FrameRow failed = row("a");
            failed.status = FrameStatus::failed;
            failed.fault = Fault::input;
            failed.why = why;
            journal.add(failed, capture.entries[0], "settings", "device");
        }
        journal.add(row("b"), capture.entries[1], "settings", "device");
        journal.forget(capture, {1});
    }
    Journal journal(folder.path(), "");
    const auto done = journal.done(capture.entries[0], "settings", false);
    ASSERT_TRUE(done);
    EXPECT_EQ(done->why, "second");
    EXPECT_FALSE(journal.done(capture.entries[1], "settings", false)) << "its files are about to change";
    EXPECT_FALSE(journal.done(capture.entries[0], "settings", true)) << "a failure is tried again when asked";
    EXPECT_FALSE(journal.done(capture.entries[0], "other", false));
}

} // namespace
} // namespace scanshade
