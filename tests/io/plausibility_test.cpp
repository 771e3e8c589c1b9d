// What a depth image alone tells of a wrong unit, or of rows that were copied.
#include "io/captures/listing/layouts.h"
#include "io/captures/plausibility.h"
#include "tests/support/files.h"

#include <cmath>
#include <fmt/format.h>
#include <limits>
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
    return doubts_in(findings_about(depth_in_metres(stored, encoding), stored, encoding));
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

/// What is said of waves of so many times 2 m, stored in a unit that a person gave.
struct GivenUnit {
    const char* name;
    const char* unit;
    int factor;
    const char* doubt; ///< a part of it; empty = none
};
void PrintTo(const GivenUnit& row, std::ostream* to) { *to << row.name; }
class UnitsGivenByHand : public testing::TestWithParam<GivenUnit> {};

TEST_P(UnitsGivenByHand, are_doubted_where_sensors_have_other_ranges_or_steps) {
    const auto& [name, unit, factor, doubt] = GetParam();
    DepthEncoding given = depth_encoding(unit, "--depth-scale");
    given.by_hand = true;
    const auto found = doubts(times(waves(), factor), given);
    if (*doubt == 0)
        EXPECT_TRUE(found.empty()) << tests::joined(found);
    else
        EXPECT_TRUE(warned(found, doubt)) << tests::joined(found);
}

INSTANTIATE_TEST_SUITE_P(
    Of, UnitsGivenByHand,
    testing::Values(GivenUnit{"right_mm", "mm", 1, ""}, GivenUnit{"right_tum", "tum", 5, ""},
                    GivenUnit{"right_number", "1000", 1, ""}, GivenUnit{"coarse_in_mm", "mm", 4, "multiples of 4 mm"},
                    GivenUnit{"coarse_in_1000", "1000", 4, "multiples of 4 mm"},
                    GivenUnit{"tum_as_mm", "mm", 5, "implausible with encoding mm (--depth-scale)"},
                    GivenUnit{"far_in_a_number_of_its_own", "100", 1, ""}, GivenUnit{"near", "tum", 1, ""}),
    [](const auto& info) { return info.param.name; });

TEST(plausibility, floats_in_millimetres_are_told_with_the_scale_that_suits_them) {
    cv::Mat1f millimetres;
    waves().convertTo(millimetres, CV_32F);
    const DepthEncoding metres = usual_encoding("m", "assumed: floats are metres");
    const auto told = doubts_in(findings_about(depth_in_metres(millimetres, metres), millimetres, metres));
    EXPECT_TRUE(warned(told, "With --depth-scale 1000 the median is 2.")) << tests::joined(told);
}

struct Signed {
    const char* name;
    std::vector<float> values; ///< four pixels
    std::vector<float> taken;
};
void PrintTo(const Signed& row, std::ostream* to) { *to << row.name; }
class SignsOfDepth : public testing::TestWithParam<Signed> {};

TEST_P(SignsOfDepth, are_turned_where_all_are_negative_and_differ) {
    constexpr float infinite = std::numeric_limits<float>::infinity();
    std::vector<std::string> warnings;
    const cv::Mat1f taken = looking_along_z(cv::Mat1f(2, 2, const_cast<float*>(GetParam().values.data())), warnings);
    const bool turned = GetParam().taken != GetParam().values;
    EXPECT_EQ(warnings.size(), turned ? 1U : 0U);
    EXPECT_EQ(std::vector<float>(taken.begin(), taken.end()), GetParam().taken);
    EXPECT_EQ(depth_in_metres(cv::Mat1f(1, 1, -infinite), depth_encoding("m", ""))(0), 0);
}

INSTANTIATE_TEST_SUITE_P(Of, SignsOfDepth,
                         testing::Values(Signed{"opengl", {-1, -2, -3, -1.5F}, {1, 2, 3, 1.5F}},
                                         Signed{"with_holes",
                                                {0, -2, -std::numeric_limits<float>::infinity(), -1.5F},
                                                {0, 2, std::numeric_limits<float>::infinity(), 1.5F}},
                                         Signed{"with_a_background", {-1e10F, -2, -1, -1}, {1e10F, 2, 1, 1}},
                                         Signed{"a_mark_of_holes", {-1, -1, -1, -1}, {-1, -1, -1, -1}},
                                         Signed{"a_mark_beside_depth", {-1, 2, 3, -1}, {-1, 2, 3, -1}},
                                         Signed{"noise_below_zero", {-0.01F, -0.02F, 3, 2}, {-0.01F, -0.02F, 3, 2}},
                                         Signed{"holes", {0, 0, 0, 0}, {0, 0, 0, 0}}),
                         [](const auto& info) { return std::string(info.param.name); });

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

TEST(plausibility, boxes_seen_straight_were_not_enlarged) {
    cv::Mat1w room(240, 320); // the end of a corridor: each row of floor differs, those of the wall are alike
    for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u) {
            const double x = std::abs(u - 159.5) / 260, y = std::abs(v - 119.5) / 260;
            room(v, u) = static_cast<std::uint16_t>(std::lround(1000 * std::min({4.0, 1.5 / x, 1.2 / y})));
        }
    EXPECT_TRUE(doubts(room).empty()) << tests::joined(doubts(room));
}

TEST(plausibility, numbers_for_looking_at_are_no_lengths) {
    const DepthEncoding usual = usual_encoding("mm", "assumed");
    cv::Mat1w eight; // bits
    waves().convertTo(eight, CV_16U, 1 / 12.0);
    EXPECT_FALSE(doubts(times(eight, 257), usual).empty()) << "widened to 16 bits";
    cv::Mat stretched;
    cv::normalize(waves(), stretched, 0, 65535, cv::NORM_MINMAX);
    EXPECT_FALSE(doubts(stretched, usual).empty());
    cv::Mat1f shares;
    cv::normalize(waves(), shares, 0, 1, cv::NORM_MINMAX, CV_32F);
    const DepthEncoding metres = usual_encoding("m", "assumed: floats are metres");
    EXPECT_TRUE(
        warned(doubts_in(findings_about(depth_in_metres(shares, metres), shares, metres)), "fill the whole range"));
    cv::Mat1f divided; // by its largest value
    cv::normalize(waves(), divided, 1, 0, cv::NORM_INF, CV_32F);
    EXPECT_TRUE(
        warned(doubts_in(findings_about(depth_in_metres(divided, metres), divided, metres)), "fill the whole range"));
    divided.colRange(0, 20) = 1; // a wall at one metre
    EXPECT_TRUE(doubts_in(findings_about(depth_in_metres(divided, metres), divided, metres)).empty());
    cv::Mat1f near; // to 1.5 m
    shares.convertTo(near, CV_32F, 1, 0.5);
    EXPECT_TRUE(doubts_in(findings_about(depth_in_metres(near, metres), near, metres)).empty());
}

TEST(plausibility, halls_and_streets_in_floats_are_not_doubted) {
    const DepthEncoding metres = usual_encoding("m", "assumed: floats are metres");
    cv::Mat1f hall;
    waves().convertTo(hall, CV_32F, 0.01); // 25 m
    EXPECT_TRUE(doubts_in(findings_about(depth_in_metres(hall, metres), hall, metres)).empty());
}

} // namespace
} // namespace scanshade
