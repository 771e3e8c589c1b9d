// Confidence: what the camera saw of the ball around a point, and nothing else, decides it.
#include "projection/confidence.h"

#include "tests/support/scenes.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;

constexpr double radius_m = 0.2;

cv::Mat1f open_where_known(const DepthImage& depth) {
    cv::Mat1f visibility(depth.z_m.size(), 1.0F);
    visibility.setTo(std::numeric_limits<float>::quiet_NaN(), depth.z_m == 0);
    return visibility;
}

cv::Mat1f confidence(const DepthImage& depth, const DepthNoise& noise = {}) {
    return confidence_of(depth, open_where_known(depth), radius_m, noise);
}

DepthImage wall(double z_m) { return tilted_plane(test_camera({320, 240}), 0, z_m); }

TEST(Confidence, IsWholeWhereAllIsSeenHalfAtTheBorderAndAQuarterInACorner) {
    const cv::Mat1f c = confidence(wall(1));
    EXPECT_EQ(c(120, 160), 1);
    EXPECT_NEAR(c(120, 0), 0.5, 0.13);
    EXPECT_NEAR(c(0, 0), 0.25, 0.13);
}

TEST(Confidence, FallsWithTheShareOfHolesAndIsNoneInThem) {
    const DepthImage holed = with_holes(wall(1), 0.5);
    const cv::Mat1f c = confidence(holed);
    const cv::Rect middle(100, 80, 120, 80);
    const double share = cv::countNonZero(holed.z_m > 0) / static_cast<double>(holed.z_m.total());
    EXPECT_NEAR(cv::mean(c(middle), holed.z_m(middle) > 0)[0], share, 0.03);
    for (int y = 0; y < c.rows; ++y)
        for (int x = 0; x < c.cols; ++x)
            ASSERT_EQ(std::isnan(c(y, x)), holed.z_m(y, x) == 0);
}

TEST(Confidence, IsHalfBesideWhatHidesHalfOfTheBall) {
    DepthImage step = wall(2);
    step.z_m.colRange(0, 160) = 1.0F; // nearer by five radii: nobody knows what is behind
    const cv::Mat1f c = confidence(step);
    EXPECT_NEAR(c(120, 161), 0.5, 0.13);
    EXPECT_EQ(c(120, 158), 1) << "what lies far behind cannot hide anything of the near side's ball";
    step.z_m.colRange(0, 160) = 1.9F; // within the ball: seen
    EXPECT_EQ(confidence(step)(120, 161), 1);
}

TEST(Confidence, TakesTheBallForAsWideAndHighAsItsPixelsMakeIt) {
    // Pixels twice as high as wide: a ball of 0.2 m before a wall at 1 m is 80 pixels to either side and 40 up and
    // down. Of the 16 places the outermost are at 0.98 of the radius.
    const DepthImage wide{{400, 200, 160, 120, {320, 240}}, cv::Mat1f(240, 320, 1.0F), {}};
    const cv::Mat1f c = confidence(wide);
    EXPECT_EQ(c(120, 80), 1);
    EXPECT_LT(c(120, 60), 1);
    EXPECT_EQ(c(40, 160), 1);
    EXPECT_LT(c(20, 160), 1);
}

TEST(Confidence, EndsWhereTheRadiusIsAPixelOrLostInNoise) {
    const DepthImage near = wall(1);
    const double f = std::sqrt(near.camera.fx * near.camera.fy);
    EXPECT_EQ(confidence(wall(1.001 * radius_m * f))(120, 160), 0);
    EXPECT_NEAR(confidence(wall(radius_m * f / 2))(120, 160), 0.5, 1e-3);
    EXPECT_EQ(confidence(wall(radius_m * f / 3.1))(120, 160), 1);
    EXPECT_NEAR(confidence(near, {radius_m / 6, 0})(120, 160), 0.5, 1e-6);
    EXPECT_EQ(confidence(near, {radius_m, 0})(120, 160), 0);
}

} // namespace
} // namespace scanshade
