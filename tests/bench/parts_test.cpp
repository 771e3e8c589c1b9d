// The developers' program: its parts print what they measure, and refuse what they cannot measure.
#include "tests/support/measured.h"
#include "tests/support/says.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

Ran measured(const std::string& words) { return run_program_at(DEVELOPERS_BENCH, words); }

TEST_F(MeasureTest, parts_print_what_they_measure) {
    const auto printed = [&](const std::string& words) {
        const Ran ran = measured(words);
        EXPECT_EQ(ran.exit_code, 0) << words << "\n" << ran.err;
        return ran.out;
    };
    EXPECT_TRUE(says(printed("hard-cases --only units --methods gtao"), "every gate kept"));
    EXPECT_TRUE(says(printed("cacao --sizes 64x48,48x64 --repeat 1 --passes"), "48x64"));
    EXPECT_TRUE(says(printed("clouds --points 3000 --rays 2,4"), "4 rays a point"));
    EXPECT_TRUE(says(printed("bounce --scenes office --sensors ideal --methods ssdo --frames 1 --size 64x48 --rays 8"),
                     "| office | ideal | sun 1.5 | "));
    EXPECT_TRUE(
        says(printed(fmt::format("flatness {} --methods luna --radii 0.5", capture())), "| capture | luna | 0.5 | "));
    EXPECT_TRUE(says(printed("cloud-errors office --points 1000 --stations 0 --radii 1 --noises 0 --judged 100"),
                     "| office | "));
    const fs::path tables = folder / "errors.txt";
    EXPECT_TRUE(says(printed(fmt::format("expected-errors {} --together --methods surfel --frames 1 --fit {}",
                                         capture(), tables.string())),
                     "| surfel | "));
    const std::string fitted = read_bytes(tables);
    EXPECT_TRUE(says(fitted, "\ntogether surfel ")) << fitted;
    EXPECT_TRUE(says(fitted, "\nspread gtao ")) << "the others' lines stay";
    const fs::path maps = folder / "maps";
    (void)printed(fmt::format("cacao-maps --write {}", maps.string()));
    EXPECT_TRUE(says(printed(fmt::format("cacao-maps --compare {}", maps.string())), "highest_downsampled"));
}

TEST_F(MeasureTest, maps_of_two_devices_that_differ_too_much_give_exit_code_2) {
    const fs::path maps = folder / "maps";
    ASSERT_EQ(measured(fmt::format("cacao-maps --write {}", maps.string())).exit_code, 0);
    fs::copy_file(maps / "lowest_native.f32", maps / "high_downsampled.f32", fs::copy_options::overwrite_existing);
    const Ran ran = measured(fmt::format("cacao-maps --compare {}", maps.string()));
    EXPECT_EQ(ran.exit_code, 2);
    EXPECT_TRUE(says(ran.out, "MISSED"));
}

TEST(DevelopersBench, refuses_unknown_parts_and_settings) {
    for (const char* words :
         {"", "beauty", "clouds --rays 8,some", "cacao --sizes 640", "normals --size 3", "flatness"})
        EXPECT_EQ(measured(words).exit_code, 1) << words;
    EXPECT_TRUE(says(measured("--help").out, "developers_bench flatness"));
    EXPECT_TRUE(says(measured("clouds --help").out, "--points"));
}

} // namespace
} // namespace scanshade
