// Clouds that we write, as Open3D's readers and CloudCompare see them: points, normals, colours and values, in their
// order. Each is skipped where the program is absent (Debian's python3-open3d, cloudcompare).
//
// Debian's CloudCompare reads neither LAS nor PCD, whose plugins it leaves out. From PLY it takes fields by itself
// whose names contain "scal"; for others its window has a list to choose from. The test chooses by renaming.
#include "io/clouds/cloud_file.h"
#include "projection/base/error.h"
#include "tests/support/files.h"

#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sstream>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::TemporaryFolder;
using tests::write_file;

using Numbers = std::vector<double>;

const std::vector<float> visibility{0.5F, 1, 0, 0.25F}, confidence{1, 0.75F, 0.125F, 0};
const Numbers xyz{1, 2, 3, 4.5, 5, 6, 0.25, 0, 1, -1, 0, 1}; ///< floats hold them exactly

template <class Values>
Numbers numbers(const Values& values) {
    return Numbers(values.begin(), values.end());
}

class ProgramsTest : public testing::Test {
  protected:
    /// A file of ours in each format, made from a cloud of someone else's; its name.
    [[nodiscard]] std::vector<std::string> clouds() const {
        const std::string header = "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
                                   "WIDTH 4\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA ascii\n";
        write_file(folder / "text.pcd", header + "1 2 3 9\n4.5 5 6 8\n0.25 0 1 7\n-1 0 1 6\n");
        write_file(folder / "text.ply",
                   "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
                   "property float intensity\nend_header\n1 2 3 9\n4.5 5 6 8\n0.25 0 1 7\n-1 0 1 6\n");
        std::vector<std::string> files;
        for (const char* name : {"text.pcd", "text.ply"}) {
            std::vector<std::string> warnings;
            files.push_back((folder / "ours" / name).string());
            fs::create_directories(folder / "ours");
            write_cloud(files.back(), read_cloud(folder / name, warnings),
                        {{"ambient_occlusion", visibility}, {"ao_confidence", confidence}});
        }
        files.push_back((folder / "new.ply").string());
        std::vector<Eigen::Vector3d> points;
        for (std::size_t i = 0; i + 2 < xyz.size(); i += 3)
            points.emplace_back(xyz[i], xyz[i + 1], xyz[i + 2]);
        write_new_ply(files.back(), points, {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {250, 251, 252}},
                      {{"ambient_occlusion", visibility}, {"ao_confidence", confidence}});
        return files;
    }

    /// Runs a command; what it printed.
    [[nodiscard]] std::string printed(const std::string& command) const {
        const fs::path out = folder / "printed", said = folder / "said";
        if (std::system(fmt::format("{} >'{}' 2>'{}'", command, out.string(), said.string()).c_str()) != 0)
            throw Error(command + ": " + file_bytes(said) + file_bytes(out));
        return file_bytes(out);
    }

    TemporaryFolder folder;
};

TEST_F(ProgramsTest, open3d_reads_points_colours_and_fields_in_their_order) {
    if (std::system("/usr/bin/python3 -c 'import open3d' >/dev/null 2>&1") != 0)
        GTEST_SKIP() << "Open3D is not there; Debian's python3-open3d has it";
    std::string command = fmt::format("/usr/bin/python3 '{}/tests/peers/read_by_open3d.py'", SCANSHADE_SOURCE);
    const auto files = clouds();
    for (const std::string& file : files)
        command += " '" + file + "'";
    const std::string text = printed(command);
    const auto found = nlohmann::json::parse(text.substr(text.find('{'))); // Open3D may print a line of its own first
    for (const std::string& file : files) {
        SCOPED_TRACE(file);
        const auto& fields = found.at(file);
        EXPECT_EQ(fields.at("positions").get<Numbers>(), xyz);
        EXPECT_EQ(fields.at("ambient_occlusion").get<Numbers>(), numbers(visibility));
        EXPECT_EQ(fields.at("ao_confidence").get<Numbers>(), numbers(confidence));
        if (file.ends_with("new.ply")) {
            EXPECT_EQ(fields.at("colors").get<Numbers>(), (Numbers{3, 2, 1, 6, 5, 4, 9, 8, 7, 252, 251, 250}));
        } else {
            EXPECT_EQ(fields.at("intensity").get<Numbers>(), (Numbers{9, 8, 7, 6}));
        }
    }
}

/// A table of numbers by the names in its first line, as CloudCompare's ASC files have it.
std::map<std::string, Numbers> columns_of(const std::string& table) {
    std::istringstream lines(table);
    std::string line, name;
    std::getline(lines, line);
    std::istringstream heads(line.substr(line.find_first_not_of('/')));
    std::vector<std::string> names;
    while (heads >> name)
        names.push_back(name);
    std::map<std::string, Numbers> columns;
    for (double value = 0; std::getline(lines, line);) {
        std::istringstream cells(line);
        for (const std::string& each : names)
            if (cells >> value)
                columns[each].push_back(value);
    }
    return columns;
}

TEST_F(ProgramsTest, cloudcompare_reads_points_colours_and_the_fields_that_are_chosen) {
    if (std::system("command -v CloudCompare >/dev/null 2>&1") != 0)
        GTEST_SKIP() << "CloudCompare is not there; Debian's cloudcompare has it";
    for (const std::string& file : clouds()) {
        if (!file.ends_with(".ply"))
            continue;
        SCOPED_TRACE(file);
        std::string bytes = file_bytes(file);
        for (const char* name : {"ambient_occlusion", "ao_confidence"}) {
            const std::string before = fmt::format("property float {}\n", name);
            ASSERT_NE(bytes.find(before), std::string::npos);
            bytes.replace(bytes.find(before), before.size(), fmt::format("property float scalar_{}\n", name));
        }
        write_file(folder / "chosen.ply", bytes);
        const std::string said = printed(fmt::format(
            "HOME='{0}' XDG_RUNTIME_DIR='{0}' QT_QPA_PLATFORM=offscreen timeout 60 CloudCompare -SILENT -AUTO_SAVE OFF "
            "-C_EXPORT_FMT ASC -PREC 9 -SEP SPACE -ADD_HEADER -NO_TIMESTAMP -O '{0}/chosen.ply' -SAVE_CLOUDS",
            folder.path().string()));
        ASSERT_TRUE(fs::exists(folder / "chosen.asc")) << said;
        auto columns = columns_of(file_bytes(folder / "chosen.asc"));
        for (std::size_t axis = 0; axis < 3; ++axis) {
            Numbers expected;
            for (std::size_t i = axis; i < xyz.size(); i += 3)
                expected.push_back(xyz[i]);
            EXPECT_EQ(columns[std::string(1, "XYZ"[axis])], expected);
        }
        EXPECT_EQ(columns["ambient_occlusion"], numbers(visibility));
        EXPECT_EQ(columns["ao_confidence"], numbers(confidence));
        if (file.ends_with("new.ply")) {
            EXPECT_EQ(columns["R"], (Numbers{3, 6, 9, 252}));
            EXPECT_EQ(columns["B"], (Numbers{1, 4, 7, 250}));
        } else {
            EXPECT_EQ(columns["intensity"], (Numbers{9, 8, 7, 6}));
        }
        fs::remove(folder / "chosen.asc");
    }
}

} // namespace
} // namespace scanshade
