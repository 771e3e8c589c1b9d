// The table of formats: complete, each row once, and printed in the READMEs as it is.
#include "io/captures/formats.h"
#include "io/captures/recording_formats.h"
#include "tests/support/files.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <gtest/gtest.h>
#include <set>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::write_file;

TEST(Formats, every_row_says_what_a_person_needs) {
    std::set<std::pair<FormatKind, std::string>> names;
    for (const Format& format : formats()) {
        SCOPED_TRACE(format.name);
        EXPECT_TRUE(names.emplace(format.kind, format.name).second) << "stands twice";
        EXPECT_FALSE(format.recognised.empty());
        EXPECT_TRUE(format.read || format.written);
        EXPECT_EQ(format.content.empty(), format.kind == FormatKind::colour_image);
        const bool recording = format.kind == FormatKind::recording_folder || format.kind == FormatKind::recording_file;
        EXPECT_EQ(!format.camera.empty(), recording);
        for (const std::string& extension : format.extensions)
            EXPECT_TRUE(extension.starts_with('.')) << extension;
    }
}

TEST(Formats, a_recording_is_told_by_its_folder_or_its_first_bytes) {
    for (const RecordingFormat& row : recording_formats()) {
        SCOPED_TRACE(row.name);
        EXPECT_EQ(row.begins != nullptr, static_cast<bool>(row.file));
        const bool of_another_reader = !row.folder && !row.file;
        EXPECT_EQ(of_another_reader,
                  std::set<std::string>({"RealSense recording", "Record3D", "tar"}).contains(row.name));
    }
}

/// Replaced by `printed` where UPDATE_README is set.
void expect_printed(const fs::path& readme, const std::string& printed) {
    const std::string begin = "<!-- formats -->\n", end = "<!-- end of formats -->\n";
    std::string text = file_bytes(readme);
    const std::size_t from = text.find(begin) + begin.size(), to = text.find(end);
    ASSERT_LT(to, text.size()) << readme;
    if (std::getenv("UPDATE_README"))
        write_file(readme, text.replace(from, to - from, printed));
    else
        EXPECT_EQ(text.substr(from, to - from), printed)
            << readme << " is not what `scanshade help formats --markdown` prints: UPDATE_README=1 puts it there";
}

TEST(Formats, readmes_have_the_tables_that_are_printed) {
    expect_printed(fs::path(SCANSHADE_SOURCE) / "README.md", formats_in_short());
    expect_printed(fs::path(SCANSHADE_SOURCE) / "io/README.md", formats_in_full());
}

} // namespace
} // namespace scanshade
