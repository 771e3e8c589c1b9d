// Whole files or none, also after a power cut: what is renamed has been synced, and then the folder is.
//
// This program's own fsync() and rename() stand before the C library's, note the call and pass it on.
#include "io/output_file.h"
#include "projection/base/error.h"
#include "tests/support/files.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <string>
#include <sys/syscall.h>
#include <system_error>
#include <unistd.h>
#include <vector>

namespace {

std::vector<std::string>& calls() {
    static std::vector<std::string> all;
    return all;
}
int error_of_fsync = 0; // what fsync() fails with; 0 = it does not

} // namespace

extern "C" __attribute__((visibility("default"))) int fsync(int handle) {
    std::array<char, 4096> name{};
    const auto length = ::readlink(("/proc/self/fd/" + std::to_string(handle)).c_str(), name.data(), name.size());
    calls().push_back("fsync " + std::string(name.data(), length > 0 ? static_cast<std::size_t>(length) : 0));
    if (error_of_fsync != 0) {
        errno = error_of_fsync;
        return -1;
    }
    return static_cast<int>(::syscall(SYS_fsync, handle));
}

extern "C" __attribute__((visibility("default"))) int rename(const char* from, const char* to) noexcept {
    calls().push_back("rename " + std::string(from));
    return static_cast<int>(::syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0U));
}

namespace scanshade {
namespace {

using namespace tests;
namespace fs = std::filesystem;

struct OutputFile : testing::Test {
    void SetUp() override { calls().clear(); }
    void TearDown() override { error_of_fsync = 0; }
    const TemporaryFolder folder;
};

TEST_F(OutputFile, is_synced_before_it_is_renamed_and_its_folder_after) {
    // A file system may put the new name on disk before the bytes: after a power cut the name would stand for an empty
    // file. And a rename is on disk only when its folder is.
    fs::path temporary;
    write_atomically(folder / "map.png", [&](const fs::path& file) {
        temporary = file;
        write_file(file, "bytes");
    });
    EXPECT_EQ(calls(), (std::vector<std::string>{"fsync " + temporary.string(), "rename " + temporary.string(),
                                                 "fsync " + folder.path().string()}));
    calls().clear();
    write_atomically(folder / "text.json", "{}");
    ASSERT_EQ(calls().size(), 3U);
    EXPECT_TRUE(calls()[0].starts_with("fsync " + (folder / ".text.tmp-").string())) << calls()[0];
}

TEST_F(OutputFile, that_cannot_be_synced_keeps_what_was_there) {
    write_file(folder / "map.png", "old");
    error_of_fsync = EIO;
    EXPECT_TRUE(says(refusal([&] { write_atomically(folder / "map.png", "new"); }), "cannot be synced"));
    error_of_fsync = 0;
    EXPECT_EQ(file_bytes(folder / "map.png"), "old");
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 1);
}

TEST_F(OutputFile, needs_no_fsync_where_the_file_system_has_none) {
    error_of_fsync = EINVAL;
    write_atomically(folder / "map.png", "new");
    EXPECT_EQ(file_bytes(folder / "map.png"), "new");
}

TEST_F(OutputFile, that_would_go_to_a_full_disk_is_no_fault_of_the_frame) {
    EXPECT_THROW(
        write_atomically(folder / "map.png",
                         [](const fs::path&) { throw std::system_error(ENOSPC, std::generic_category(), "full"); }),
        Outage);
}

} // namespace
} // namespace scanshade
