// `inspect` says of clouds what one needs to know of them: density, unit, coordinate system, classes, returns.
#include "tests/support/files.h"
#include "tests/support/laz_file.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using nlohmann::json;
using tests::run_program, tests::says, tests::write_file;
namespace fs = std::filesystem;

constexpr int side = 100; ///< of a square of points, half a unit apart: four a square unit

/// LAS 1.4, point format 6. A quarter is ground, the others are high vegetation, every second point is a second return.
std::string las(const std::string& reference) {
    std::string records;
    for (int i = 0; i < side * side; ++i) {
        std::string record(30, '\0');
        tests::store(record.data(), 50 * (i % side));
        tests::store(record.data() + 4, 50 * (i / side));
        tests::store(record.data() + 8, static_cast<std::int32_t>(i % 7));
        record[14] = static_cast<char>(i % 2 + 1);
        record[16] = static_cast<char>(i % 4 == 0 ? 2 : 5);
        records += record;
    }
    std::string header = tests::las_header(6, 30, side * side, nullptr);
    for (int axis = 0; axis < 3; ++axis)
        tests::store(header.data() + 179 + 16 * axis, axis == 2 ? 0.06 : 49.5);
    if (!reference.empty()) {
        header += tests::vlr("LASF_Projection", 2112, reference);
        header[6] = 0x10; // the reference is text
        tests::store(header.data() + 96, static_cast<std::uint32_t>(header.size()));
        tests::store(header.data() + 100, 1U);
    }
    return header + records;
}

std::string lines_of(const char* head, const char* tail) {
    std::string text = head;
    for (int i = 0; i < side * side; ++i) {
        const int row = i / side;
        text += fmt::format("{} {} {}{}\n", 0.5 * (i % side), 0.5 * row, 0.01 * (i % 7), tail);
    }
    return text;
}

struct CloudFile {
    const char* name;
    std::string bytes;
    std::vector<const char*> says, says_not;
};
void PrintTo(const CloudFile& row, std::ostream* to) { *to << row.name; }
class InspectedClouds : public testing::TestWithParam<CloudFile> {};

TEST_P(InspectedClouds, are_told_as_clouds) {
    const tests::TemporaryFolder folder;
    const fs::path file = write_file(folder / GetParam().name, GetParam().bytes);
    const auto ran = run_program("inspect " + file.string());
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.out, "spacing        0.5 (median distance between neighbours)"));
    for (const char* part : GetParam().says)
        EXPECT_TRUE(says(ran.out, part));
    for (const char* part : GetParam().says_not)
        EXPECT_FALSE(says(ran.out, part));
    const json survey = json::parse(run_program("inspect --json " + file.string()).out)[0]["survey"];
    EXPECT_EQ(survey["points"], side * side);
    EXPECT_NEAR(survey["spacing"].get<double>(), 0.5, 2e-4) << "heights of 0.01 add 0.0001";
    EXPECT_NEAR(survey["max"][0].get<double>(), 49.5, 1e-6);
    if (const json& density = survey["points_per_square_unit"]; !density.is_null()) {
        EXPECT_NEAR(density.get<double>(), 4, 0.1);
    }
    if (const json& classes = survey["classes"]; !classes.empty()) {
        EXPECT_EQ(classes[0]["name"], "ground");
    }
}

INSTANTIATE_TEST_SUITE_P(
    Of, InspectedClouds,
    testing::Values(
        CloudFile{"text.las",
                  las(R"(PROJCS["NAD83 / Oregon",GEOGCS["NAD83",UNIT["degree",0.0174]],UNIT["foot",0.3048],)"
                      R"(AUTHORITY["EPSG","2992"]])"),
                  {"unit           foot (well-known text)", "points a square foot of ground",
                   "system         EPSG 2992, NAD83 / Oregon",
                   "classes        2 ground: 25.0 %, 5 high vegetation: 75.0 %", "returns        1: 50.0 %, 2: 50.0 %"},
                  {"warning"}},
        CloudFile{"no_reference.las",
                  las(""),
                  {"unit           an unknown unit (the file names none)", "points a square unit of ground"},
                  {"system", "warning"}},
        CloudFile{"damaged_reference.las",
                  las(R"(PROJCS["a",UNIT["foot",0.3048)"),
                  {"the coordinate system cannot be read", "points a square foot of ground"},
                  {"system         "}},
        CloudFile{"lines.xyz",
                  lines_of("", ""),
                  {"unit           metres (by convention)", "points a square metre of ground"},
                  {"classes", "returns", "system"}},
        CloudFile{"vertices.ply",
                  lines_of("ply\nformat ascii 1.0\nelement vertex 10000\nproperty float x\nproperty float y\nproperty "
                           "float z\nproperty uchar classification\nend_header\n",
                           " 2"),
                  {"unit           metres (by convention)", "classes        2 ground: 100.0 %"},
                  {"density", "returns", "system"}}),
    [](const auto& info) {
        const std::string name = info.param.name;
        return name.substr(0, name.find('.'));
    });

} // namespace
} // namespace scanshade
