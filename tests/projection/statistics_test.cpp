// Ranks of values, against the definition: sort and look.
#include "projection/base/statistics.h"

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <vector>

namespace scanshade {
namespace {

const std::vector<double> five = {3, -1, 4, 1, 5}; // -1 1 3 4 5

TEST(Statistics, the_median_is_the_middle_or_the_upper_of_two) {
    EXPECT_EQ(median(five), 3);
    EXPECT_EQ(median(std::vector{4, 1, 3, 2}), 3);
    EXPECT_EQ(median(std::array{7.0F}), 7);
}

TEST(Statistics, the_median_of_nothing_is_what_the_caller_says) {
    EXPECT_TRUE(std::isnan(median(std::vector<double>())));
    EXPECT_EQ(median(std::vector<float>(), 0), 0);
}

TEST(Statistics, ranks_count_from_the_smallest) {
    std::vector<double> values = five;
    const std::vector<double> sorted = {-1, 1, 3, 4, 5};
    for (std::size_t rank = 0; rank < sorted.size(); ++rank)
        EXPECT_EQ(ranked(values, rank), sorted[rank]);
}

TEST(Statistics, a_quantile_is_a_value_that_occurs) {
    std::vector<double> values = five, none;
    EXPECT_EQ(quantile(values, 0), -1);
    EXPECT_EQ(quantile(values, 0.5), 3);
    EXPECT_EQ(quantile(values, 0.9), 4); // 0.9 of 4 steps is 3.6: the lower rank
    EXPECT_EQ(quantile(values, 1), 5);
    EXPECT_TRUE(std::isnan(quantile(none, 0.5)));
}

} // namespace
} // namespace scanshade
