// Output is atomic: a file is whole or not there, and leftovers of killed runs are removed.
#include "io/output_file.h"
#include "projection/base/error.h"
#include "tests/support/files.h"

#include <filesystem>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

TEST(atomic_output, a_failed_write_leaves_neither_target_nor_temporary) {
    const TemporaryFolder folder;
    const fs::path target = folder / "new/map.png";
    const std::string message = refusal([&] {
        write_atomically(target, [](const fs::path& temporary) {
            write_file(temporary, "half");
            throw Error("disk on fire");
        });
    });
    EXPECT_TRUE(says(message, target.string()));
    EXPECT_TRUE(says(message, "disk on fire"));
    EXPECT_TRUE(fs::is_empty(target.parent_path()));
}

TEST(atomic_output, an_existing_file_stays_whole_until_the_new_one_is) {
    const TemporaryFolder folder;
    const fs::path target = write_file(folder / "map.png", "old");
    write_atomically(target, [&](const fs::path& temporary) {
        EXPECT_EQ(temporary.parent_path(), target.parent_path());
        EXPECT_EQ(temporary.extension(), ".png");
        EXPECT_TRUE(temporary.filename().string().starts_with("."));
        write_file(temporary, "new");
        EXPECT_EQ(file_bytes(target), "old");
    });
    EXPECT_EQ(file_bytes(target), "new");
}

TEST(atomic_output, leftovers_of_ones_own_targets_are_removed_and_nothing_else) {
    const TemporaryFolder folder;
    write_file(folder / ".map.tmp-999999999-3.png", "half");
    write_file(folder / ".other.tmp-999999999-3.png", "another machine is writing this");
    write_file(folder / "map.tmp-999999999-3.png", "the user's");
    write_file(folder / ".map.tmp-x-3.png", "the user's");
    write_file(folder / ".hidden", "the user's");
    const auto ours = [](std::string_view stem) { return stem == "map"; };
    EXPECT_EQ(remove_leftovers(folder.path(), ours), 1);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()), 4);
    EXPECT_EQ(remove_leftovers(folder / "nowhere", ours), 0);
}

} // namespace
} // namespace scanshade
