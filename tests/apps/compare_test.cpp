// Differences of two maps, against values worked out by hand; and difference pictures.
#include "ao/compare.h"
#include "apps/picture.h"
#include "tests/support/says.h"

#include <cmath>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

const float hole = std::numeric_limits<float>::quiet_NaN();

/// A map with every value in it: slanted in x, wavy in y.
cv::Mat1f wavy(cv::Size size) {
    cv::Mat1f map(size);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            map(y, x) = 0.5F + 0.4F * std::sin(0.3F * static_cast<float>(y)) * static_cast<float>(x) /
                                   static_cast<float>(size.width);
    return map;
}

cv::Mat1f with_curve(const cv::Mat1f& map, const ToneCurve& curve) {
    cv::Mat1f shown(map.size());
    std::transform(map.begin(), map.end(), shown.begin(), [&](float v) { return static_cast<float>(curve(v)); });
    return shown;
}

TEST(CompareTest, numbers_are_those_worked_out_by_hand) {
    // differences over the five common pixels: 0.1 -0.2 0.3 0 0.4
    const cv::Mat1f a = (cv::Mat1f(2, 4) << 0.5, 0.2, 0.8, hole, 0.4, 1.0, 0.9, hole);
    const cv::Mat1f b = (cv::Mat1f(2, 4) << 0.4, 0.4, 0.5, 0.7, 0.4, 0.6, hole, hole);
    const Difference d = compare(a, b);
    EXPECT_EQ(d.pixels, 5u);
    EXPECT_EQ(d.only_a, 1u);
    EXPECT_EQ(d.only_b, 1u);
    EXPECT_NEAR(d.mae, 1.0 / 5, 1e-6);
    EXPECT_NEAR(d.rms, std::sqrt((0.01 + 0.04 + 0.09 + 0.16) / 5), 1e-6);
    EXPECT_NEAR(d.bias, 0.6 / 5, 1e-6);
    EXPECT_NEAR(d.percentile_95, 0.4, 1e-6); // nearest rank: the fifth of five
    EXPECT_NEAR(d.worst, 0.4, 1e-6);
    // deviations of a about 0.58: -.08 -.38 .22 -.18 .42; of b about 0.46: -.06 -.06 .04 -.06 .14
    EXPECT_NEAR(d.correlation, 0.106 / std::sqrt(0.408 * 0.032), 1e-5);
    EXPECT_TRUE(std::isnan(d.ssim)) << "no window of 11x11 fits into 2x4 pixels";
}

TEST(CompareTest, the_95th_percentile_leaves_the_worst_twentieth_out) {
    cv::Mat1f a(10, 10, 0.5F), b = a.clone();
    for (int i = 0; i < 5; ++i)
        b(0, i) = 1.0F; // 5 of 100
    EXPECT_EQ(compare(a, b).percentile_95, 0);
    b(0, 5) = 0.75F;
    EXPECT_NEAR(compare(a, b).percentile_95, 0.25, 1e-6);
}

TEST(CompareTest, equal_maps_do_not_differ) {
    cv::Mat1f map = wavy({40, 30});
    map(12, 9) = hole;
    const Difference d = compare(map, map.clone());
    EXPECT_EQ(d.pixels, 40u * 30 - 1);
    EXPECT_EQ(d.only_a + d.only_b, 0u);
    EXPECT_EQ(d.rms, 0);
    EXPECT_EQ(d.worst, 0);
    EXPECT_NEAR(d.ssim, 1, 1e-12);
    EXPECT_NEAR(d.correlation, 1, 1e-12);
    EXPECT_LT(d.calibrated_rms, 0.002); // a bin's width, spread evenly, is 1/256/sqrt(12)
}

TEST(CompareTest, maps_without_a_common_pixel_have_no_numbers) {
    const cv::Mat1f a = (cv::Mat1f(1, 2) << 0.5, hole), b = (cv::Mat1f(1, 2) << hole, 0.5);
    const Difference d = compare(a, b);
    EXPECT_EQ(d.pixels, 0u);
    EXPECT_EQ(d.only_a, 1u);
    EXPECT_EQ(d.only_b, 1u);
    for (const double figure : {d.mae, d.rms, d.bias, d.worst, d.ssim, d.correlation, d.calibrated_rms})
        EXPECT_TRUE(std::isnan(figure));
}

TEST(CompareTest, maps_of_two_sizes_are_refused) {
    EXPECT_TRUE(tests::says(tests::refusal([] { (void)compare(cv::Mat1f(2, 3, 0.F), cv::Mat1f(3, 2, 0.F)); }),
                            "found 3x2 and 2x3"));
}

// ---------------------------------------------------------------------------------------------------- SSIM

TEST(SimilarityTest, of_two_constants_is_its_luminance_term) {
    // without variance the second factor is 1: (2 m n + C1) / (m^2 + n^2 + C1), C1 = 1e-4
    const cv::Mat1f a(20, 20, 0.4F), b(20, 20, 0.8F);
    EXPECT_NEAR(structural_similarity(a, b), (2 * 0.4 * 0.8 + 1e-4) / (0.16 + 0.64 + 1e-4), 1e-6);
}

TEST(SimilarityTest, counts_no_window_that_holds_a_hole) {
    cv::Mat1f a = wavy({40, 40}), b = a.clone();
    b(20, 20) = hole;
    EXPECT_NEAR(structural_similarity(a, b), 1, 1e-12) << "the hole itself is no difference";
    b(20, 21) = 1 - b(20, 21); // seen only by windows that hold the hole, but for one column of them
    const double beside = structural_similarity(a, b);
    EXPECT_LT(beside, 1);
    b.setTo(hole, cv::Mat1b::ones(40, 40));
    EXPECT_TRUE(std::isnan(structural_similarity(a, b)));
}

TEST(SimilarityTest, falls_with_what_is_lost) {
    const cv::Mat1f a = wavy({60, 60});
    cv::Mat1f little, much;
    cv::GaussianBlur(a, little, {}, 2);
    cv::GaussianBlur(a, much, {}, 8);
    EXPECT_GT(structural_similarity(a, little), structural_similarity(a, much) + 0.01);
}

// ---------------------------------------------------------------------------------------------------- tone curves

TEST(ToneCurveTest, the_best_one_is_found_again) {
    const cv::Mat1f ours = wavy({64, 64});
    for (const ToneCurve& curve :
         {ToneCurve{0.24, 3.9}, ToneCurve{0.6, 1}, ToneCurve{1, 0.5}, ToneCurve{1.4, 1.2}, ToneCurve{0.9, 3}}) {
        const Difference d = compare(ours, with_curve(ours, curve));
        EXPECT_LT(d.calibrated_rms, 0.004) << curve.strength << ", " << curve.power;
        EXPECT_GT(d.rms, 0.05);
    }
}

TEST(ToneCurveTest, never_makes_it_worse) {
    const cv::Mat1f ours = wavy({64, 64});
    cv::Mat1f opposite;
    cv::subtract(1, ours, opposite);
    const Difference d = compare(ours, opposite);
    EXPECT_LE(d.calibrated_rms, d.rms);
}

TEST(ToneCurveTest, of_many_images_is_one) {
    const cv::Mat1f bright = cv::Mat1f(8, 8, 0.9F), dark = cv::Mat1f(8, 8, 0.3F);
    const ToneCurve curve{0.5, 1.5};
    PairSums pairs = pair_sums(bright, with_curve(bright, curve));
    pairs.add(pair_sums(dark, with_curve(dark, curve)));
    EXPECT_EQ(pairs.count(), 128u);
    EXPECT_NEAR(pairs.rms(curve), 0, 1e-6);
    EXPECT_LT(pairs.rms(pairs.best_curve()), 1e-4);
}

TEST(TotalTest, is_the_root_mean_square_over_images_however_many_pixels_each_has) {
    const cv::Mat1f zero(4, 4, 0.F), tenth(4, 4, 0.1F), small(1, 1, 0.F), three_tenths(1, 1, 0.3F), none(1, 1, hole);
    const std::vector<Difference> images{compare(tenth, zero), compare(three_tenths, small), compare(none, small)};
    PairSums pairs = pair_sums(tenth, zero);
    pairs.add(pair_sums(three_tenths, small));
    const Difference all = total(images, pairs);
    EXPECT_NEAR(all.rms, std::sqrt((0.01 + 0.09) / 2), 1e-6);
    EXPECT_NEAR(all.bias, 0.2, 1e-6);
    EXPECT_NEAR(all.worst, 0.3, 1e-6);
    EXPECT_EQ(all.pixels, 17u);
    EXPECT_EQ(all.only_b, 1u);
    EXPECT_LT(all.calibrated_rms, 0.01) << "strength 5 makes both of them nearly 0";
}

// ---------------------------------------------------------------------------------------------------- pictures

cv::Vec3f lab_of(const cv::Vec3b& bgr) {
    cv::Mat3f pixel(1, 1, cv::Vec3f(bgr) / 255), lab;
    cv::cvtColor(pixel, lab, cv::COLOR_BGR2Lab);
    return lab(0, 0);
}

TEST(DifferencePictureTest, equal_steps_look_equally_far_apart) {
    cv::Mat1f ramp(1, 21);
    for (int i = 0; i < ramp.cols; ++i)
        ramp(0, i) = static_cast<float>(i - 10) / 10;
    const cv::Mat3b picture = difference_picture(ramp, 1);
    const double step = cv::norm(lab_of(picture(0, 10)) - lab_of(picture(0, 0))) / 10;
    EXPECT_GT(step, 6) << "ten steps from white to the end that can be told apart";
    for (int i = 1; i < ramp.cols; ++i) // 8-bit colours: half a step of each channel is up to 1 in CIELAB
        EXPECT_NEAR(cv::norm(lab_of(picture(0, i)) - lab_of(picture(0, i - 1))), step, 1.3) << i;
    EXPECT_GT(picture(0, 0)[0], picture(0, 0)[2] + 100) << "too dark is blue";
    EXPECT_GT(picture(0, 20)[2], picture(0, 20)[0] + 100) << "too bright is red";
}

TEST(DifferencePictureTest, beyond_the_scale_is_its_end_and_a_hole_is_neither) {
    const cv::Mat1f values = (cv::Mat1f(1, 4) << -0.2, -7, hole, 0);
    const cv::Mat3b picture = difference_picture(values, 0.2);
    EXPECT_EQ(picture(0, 0), picture(0, 1));
    EXPECT_EQ(picture(0, 3), difference_picture(cv::Mat1f(1, 1, 0.F), 9)(0, 0));
    for (const int other : {0, 1, 3})
        EXPECT_NE(picture(0, 2), picture(0, other));
}

} // namespace
} // namespace scanshade
