// Expected errors of sky view on generated terrain that they were not fitted to.
#include "tests/bench/relief_errors.h"

#include <algorithm>
#include <gtest/gtest.h>

namespace scanshade::bench {
namespace {

/// By bins of what is expected: rasters and clouds of kinds and seeds of terrain that no factor has seen.
TEST(ReliefErrors, expected_errors_are_those_found_on_other_terrain) {
    constexpr int cells = 96;
    std::vector<ErrorPair> all;
    for (const char* name : {"dunes", "gullies", "mounds"}) {
        const Terrain terrain = terrain_named(name, 23);
        const cv::Mat1f truth = true_view(terrain, cells, 0.5, 5);
        for (const HeightSource& source :
             {HeightSource{.name = "raster"}, HeightSource{.name = "noise", .sigma_m = 0.05},
              HeightSource{.name = "missing", .missing = 6},
              HeightSource{.name = "cloud", .sigma_m = 0.03, .density = 4, .gaps = 6}}) {
            const std::vector<ErrorPair> pairs = errors_of(source, terrain, 23, truth);
            EXPECT_NEAR(ratio_of(pairs), 1, 0.4) << name << ", " << source.name;
            all.insert(all.end(), pairs.begin(), pairs.end());
        }
    }
    std::ranges::sort(all, {}, &ErrorPair::expected);
    constexpr std::size_t bins = 8;
    for (std::size_t bin = 0; bin < bins; ++bin) {
        const auto at = [&](std::size_t i) { return all.begin() + static_cast<std::ptrdiff_t>(all.size() * i / bins); };
        EXPECT_NEAR(ratio_of({at(bin), at(bin + 1)}), 1, 0.25) << "bin " << bin;
    }
    EXPECT_GT(all.back().expected, 10 * all.front().expected); // places differ
}

} // namespace
} // namespace scanshade::bench
