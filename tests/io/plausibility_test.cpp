// What a depth image alone tells of a wrong unit, or of rows that were copied.
#include "io/captures/listing/layouts.h"
#include "io/captures/plausibility.h"
#include "tests/support/files.h"

#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

using tests::warned;

/// A slanted, waved floor 2 m away in millimetres, in which no two lines are alike.
cv::Mat1w waves(cv::Size size = {160, 120}) {
    cv::Mat1w stored(size);
    for (int v = 0; v < size.height; ++v)
        for (int u = 0; u < size.width; ++u)
            stored(v, u) = static_cast<std::uint16_t>(std::lround(2000 + 5 * v + 2 * u + 30 * std::sin(0.3 * u * v)));
    return stored;
}

cv::Mat1w times(cv::Mat1w stored, int factor) {
    stored *= factor;
    return stored;
}

std::vector<std::string> doubts(const cv::Mat1w& stored, const DepthEncoding& encoding = depth_encoding("mm", "test")) {
    return doubts_about(depth_in_metres(stored, encoding), stored, encoding);
}

TEST(plausibility, a_layouts_usual_unit_is_doubted_beyond_an_indoor_sensors_range) {
    const cv::Mat1w far = times(waves(), 8);
    EXPECT_TRUE(warned(doubts(far, usual_encoding("mm", "7-Scenes layout")), "implausible"));
    EXPECT_TRUE(doubts(far).empty()) << "who names the unit may measure outdoors";
    EXPECT_TRUE(doubts(waves(), usual_encoding("mm", "7-Scenes layout")).empty());
}

TEST(plausibility, multiples_show_another_unit) {
    const DepthEncoding usual = usual_encoding("mm", "assumed");
    EXPECT_TRUE(warned(doubts(times(waves(), 3), usual), "multiples of 3 mm"));
    cv::Mat1w rotated = waves();
    for (std::uint16_t& value : rotated) { // at a third of the distance, else the range would tell already
        const int bits = value / 3;
        value = static_cast<std::uint16_t>(bits << 3 | bits >> 13);
    }
    EXPECT_TRUE(warned(doubts(rotated, usual), "multiples of 8 mm"));
    EXPECT_TRUE(doubts(times(waves(), 5), usual_encoding("tum", "TUM layout")).empty()) << "a millimetre";
    EXPECT_TRUE(doubts(times(waves(), 5)).empty()) << "a named unit may be coarse";
}

/// Every row whose remainder is `copied` becomes a copy of the row above.
cv::Mat1w with_copies(cv::Mat1w stored, int every, int copied) {
    for (int v = 1; v < stored.rows; ++v)
        if (v % every == copied)
            stored.row(v - 1).copyTo(stored.row(v));
    return stored;
}

TEST(plausibility, copied_rows_or_columns_are_doubted) {
    EXPECT_TRUE(doubts(waves()).empty());
    EXPECT_TRUE(warned(doubts(with_copies(waves(), 2, 1)), "every second row repeats"));
    EXPECT_TRUE(warned(doubts(with_copies(waves(), 3, 2)), "every third row repeats"));
    cv::Mat1w columns;
    cv::transpose(with_copies(waves(), 2, 0), columns);
    EXPECT_TRUE(warned(doubts(columns), "every second column repeats"));
}

TEST(plausibility, an_image_enlarged_by_copies_is_doubted) {
    for (const double by : {2.0, 2.5, 4.0, 5.625}) { // 256x192 to 640x480, or to a phone's 1440x1080
        cv::Mat1w enlarged;
        cv::resize(waves(), enlarged, {}, by, by, cv::INTER_NEAREST);
        EXPECT_TRUE(warned(doubts(enlarged), fmt::format("enlarged {:.2g} times", by))) << by;
        EXPECT_TRUE(warned(doubts(enlarged), "to about 160x120")) << by;
    }
    cv::Mat1w interpolated;
    cv::resize(waves(), interpolated, {}, 2, 2, cv::INTER_LINEAR);
    EXPECT_TRUE(doubts(interpolated).empty());
}

TEST(plausibility, lines_that_are_all_alike_were_not_copied) {
    cv::Mat1w wall(120, 160); // an upright wall beside the camera, without noise
    for (int u = 0; u < 160; ++u)
        wall.col(u).setTo(1000 + 10 * u);
    EXPECT_TRUE(doubts(wall).empty());
    wall.rowRange(0, 40) = cv::Scalar(0);
    EXPECT_TRUE(doubts(wall).empty()) << "nor were holes";
}

} // namespace
} // namespace scanshade
