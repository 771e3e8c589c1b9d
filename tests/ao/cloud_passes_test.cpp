// Passes over all points of a cloud on all cores: they give what one thread gives.
#include "ao/cloud/repeatability.h"
#include "ao/cloud/surface/order_statistics.h"
#include "projection/base/indices_where.h"
#include "tests/support/points.h"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numeric>

namespace scanshade {
namespace {

using tests::Dice;

TEST(CloudPasses, indices_are_chosen_in_their_order) {
    for (const std::size_t count : {std::size_t(0), std::size_t(1), std::size_t(65536), std::size_t(300001)}) {
        const auto holds = [](std::size_t i) { return i * i % 7 == 2; };
        std::vector<std::uint32_t> all, expected;
        for (std::size_t i = 0; i < count; ++i)
            if (holds(i))
                expected.push_back(static_cast<std::uint32_t>(i));
        EXPECT_EQ(indices_where(count, holds), expected);
        std::vector<std::uint32_t> of_these, backwards(count);
        std::iota(backwards.rbegin(), backwards.rend(), 0U);
        for (const std::uint32_t i : backwards)
            if (holds(i))
                of_these.push_back(i);
        EXPECT_EQ(indices_where(backwards, holds), of_these);
    }
}

/// Above a quarter of a million values bits are counted; below that values are partly sorted.
TEST(CloudPasses, the_median_is_that_of_sorted_values) {
    Dice dice(5);
    for (const std::size_t count : {std::size_t(1), std::size_t(2), std::size_t(1000), std::size_t(1) << 18,
                                    (std::size_t(1) << 18) + 1, std::size_t(400000)})
        for (const double power : {0.0, 0.2, 1.0, 30.0}) { // all alike; dense at 1; even; over thirty decades
            std::vector<float> values(count);
            for (float& value : values)
                value = static_cast<float>(std::pow(dice.roll(), power));
            values[count / 3] = 0;
            std::vector<float> sorted = values;
            std::sort(sorted.begin(), sorted.end());
            EXPECT_EQ(median_of_lengths(values), sorted[count / 2]) << count << " " << power;
        }
    EXPECT_EQ(median_of_lengths({}), 0);
    const std::vector<float> far(300000, std::numeric_limits<float>::infinity());
    EXPECT_EQ(median_of_lengths(far), far[0]);
}

/// The error is that of the nearest point that was computed again, in whatever order points are looked at.
TEST(CloudPasses, the_order_of_points_does_not_change_their_error) {
    Dice dice(9);
    std::vector<Eigen::Vector3d> points(4000);
    std::vector<float> whole(points.size()), thinned;
    std::vector<std::uint32_t> kept, order(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double x = dice.roll();
        points[i] = {i % 100 == 0 ? 1000 * x : x, dice.roll(), 0}; // some far away
        whole[i] = i % 11 == 0 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(dice.roll());
        if (i % 5 == 0) {
            kept.push_back(static_cast<std::uint32_t>(i));
            thinned.push_back(whole[i] + static_cast<float>(0.3 * dice.roll()));
        }
    }
    std::iota(order.begin(), order.end(), 0U);
    const ThinnedCheck check{0.25};
    const Repeatability in_file = repeatability(points, whole, kept, thinned, check, order);
    std::sort(order.begin(), order.end(),
              [&](std::uint32_t a, std::uint32_t b) { return points[a].x() < points[b].x(); });
    const Repeatability in_space = repeatability(points, whole, kept, thinned, check, order);
    ASSERT_EQ(in_file.error.size(), points.size());
    EXPECT_EQ(in_file.error, in_space.error);
    std::size_t below = 0;
    for (const float error : in_file.error)
        below += error < 1;
    EXPECT_GT(below, points.size() / 2);
}

} // namespace
} // namespace scanshade
