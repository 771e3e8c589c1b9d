// Expected errors: which signs a pixel shows, and what follows from them.
#include "projection/sensor/expected_error.h"

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

/// One value a pixel.
template <class Value>
cv::Mat1f signs(const DepthImage& depth, Value ErrorSigns::*sign, const DepthNoise& noise = {}) {
    cv::Mat1f values(depth.z_m.size(), std::numeric_limits<float>::quiet_NaN());
    for_each_sign(depth, open_where_known(depth), radius_m, noise,
                  [&](int v, int u, const ErrorSigns& found) { values(v, u) = static_cast<float>(found.*sign); });
    return values;
}
cv::Mat1f seen(const DepthImage& depth) { return signs(depth, &ErrorSigns::seen); }

DepthImage wall(double z_m) { return tilted_plane(test_camera({320, 240}), 0, z_m); }

/// With each factor the same in all tables.
shared::ErrorTable table(float of_all) {
    shared::ErrorTable made{};
    for (int i = 0; i < shared::error_edges_at; ++i)
        made.factors[i] = of_all;
    return made;
}

TEST(ExpectedError, the_ball_is_whole_where_all_is_seen_half_at_the_border_and_a_quarter_in_a_corner) {
    const cv::Mat1f c = seen(wall(1));
    EXPECT_EQ(c(120, 160), 1);
    EXPECT_NEAR(c(120, 0), 0.5, 0.13);
    EXPECT_NEAR(c(0, 0), 0.25, 0.13);
}

TEST(ExpectedError, less_is_seen_with_more_holes_and_holes_have_no_signs) {
    const DepthImage holed = with_holes(wall(1), 0.5);
    const cv::Mat1f c = seen(holed);
    const cv::Rect middle(100, 80, 120, 80);
    const double share = cv::countNonZero(holed.z_m > 0) / static_cast<double>(holed.z_m.total());
    EXPECT_NEAR(cv::mean(c(middle), holed.z_m(middle) > 0)[0], share, 0.03);
    for (int y = 0; y < c.rows; ++y)
        for (int x = 0; x < c.cols; ++x)
            ASSERT_EQ(std::isnan(c(y, x)), holed.z_m(y, x) == 0);
}

TEST(ExpectedError, half_is_seen_beside_what_hides_half_of_the_ball) {
    DepthImage step = wall(2);
    step.z_m.colRange(0, 160) = 1.0F; // nearer by five radii: nobody knows what is behind
    const cv::Mat1f c = seen(step);
    EXPECT_NEAR(c(120, 161), 0.5, 0.13);
    EXPECT_EQ(c(120, 158), 1) << "what lies far behind cannot hide anything of the near side's ball";
    step.z_m.colRange(0, 160) = 1.9F; // within the ball: seen
    EXPECT_EQ(seen(step)(120, 161), 1);
}

TEST(ExpectedError, the_ball_is_as_wide_and_high_as_its_pixels_make_it) {
    // Pixels twice as high as wide: a ball of 0.2 m before a wall at 1 m is 80 pixels to either side and 40 up and
    // down. Of the 16 places the outermost are at 0.98 of the radius.
    const DepthImage wide{{400, 200, 160, 120, {320, 240}}, cv::Mat1f(240, 320, 1.0F), {}};
    const cv::Mat1f c = seen(wide);
    EXPECT_EQ(c(120, 80), 1);
    EXPECT_LT(c(120, 60), 1);
    EXPECT_EQ(c(40, 160), 1);
    EXPECT_LT(c(20, 160), 1);
}

/// Rings at 1, 2 (diagonally), 6 and 8 (diagonally) pixels; beyond them nothing is near.
TEST(ExpectedError, jumps_and_holes_are_found_by_their_distance_on_both_sides) {
    DepthImage step = wall(2);
    step.z_m.colRange(0, 160) = 1.5F;
    step.z_m.rowRange(200, 240) = 0;
    const cv::Mat1f edge = signs(step, &ErrorSigns::edge), hole = signs(step, &ErrorSigns::hole);
    for (const auto& [away, ring] : {std::pair(0, 0), {1, 1}, {4, 2}, {7, 3}, {20, 4}}) {
        EXPECT_EQ(edge(100, 160 + away), ring) << away;
        EXPECT_EQ(edge(100, 159 - away), ring) << away;
        EXPECT_EQ(hole(199 - away, 60), ring) << away;
        EXPECT_EQ(hole(100, 60), shared::error_rings);
    }
    EXPECT_EQ(hole(0, 60), shared::error_rings) << "the border of the image is no hole";
}

TEST(ExpectedError, slopes_are_no_jumps_and_noise_is_none) {
    const cv::Mat1f edge = signs(tilted_plane(test_camera({320, 240}), 75, 2), &ErrorSigns::edge);
    cv::Mat inside;
    cv::compare(edge, shared::error_rings, inside, cv::CMP_LT); // NaN where the plane is not in view
    EXPECT_EQ(cv::countNonZero(inside), 0);

    cv::RNG random(3);
    DepthImage noisy = wall(2);
    cv::Mat1f off(noisy.z_m.size());
    random.fill(off, cv::RNG::NORMAL, 0, 0.02);
    noisy.z_m += off;
    cv::compare(signs(noisy, &ErrorSigns::edge, {.floor_m = 0.02}), shared::error_rings, inside, cv::CMP_LT);
    EXPECT_LT(cv::countNonZero(inside) / static_cast<double>(inside.total()), 0.03) << "8 sigmas are 3.3 of a second "
                                                                                       "difference, eight times tried";
}

/// Doubling the scene and the radius together changes nothing that matters.
TEST(ExpectedError, signs_do_not_depend_on_the_unit) {
    const DepthImage holed = with_holes(tilted_plane(test_camera({160, 120}), 50, 2), 0.02);
    const cv::Mat1f visible = open_where_known(holed);
    DepthImage large = holed;
    large.z_m *= 4;
    const cv::Mat1f once = expected_error_of(holed, visible, radius_m, {.floor_m = 0.01}, table(-4)),
                    again = expected_error_of(large, visible, 4 * radius_m, {.floor_m = 0.04}, table(-4));
    cv::Mat apart;
    cv::compare(once, again, apart, cv::CMP_NE);
    EXPECT_EQ(cv::countNonZero(apart & (visible == visible)), 0); // NOLINT(misc-redundant-expression): false for NaN
}

TEST(ExpectedError, factors_multiply_and_are_interpolated_between_knots) {
    shared::ErrorTable made = table(-6);
    const ErrorSigns plain{1, shared::error_rings, shared::error_rings, 64, 0};
    EXPECT_FLOAT_EQ(expected_error(weights_of(plain, 1), made), 0.125F);
    made.factors[shared::error_edges_at + 2] = 2; // twice the error
    ErrorSigns beside = plain;
    beside.edge = 2;
    EXPECT_FLOAT_EQ(expected_error(weights_of(beside, 1), made), 0.25F);
    made.factors[shared::error_noises_at + 1] = 1; // at a sigma of 1/64 of the radius
    beside.noise = 1 / 64.0F;
    EXPECT_FLOAT_EQ(expected_error(weights_of(beside, 1), made), 0.25F * std::sqrt(2.0F));
    beside.noise = 0.41421356F / 64; // halfway, as log2(1 + 64 x) has it
    EXPECT_NEAR(expected_error(weights_of(beside, 1), made), 0.25F * std::exp2(0.25F), 1e-5);
    const int open = (shared::error_shares - 1) * shared::error_values + shared::error_values - 1;
    made = table(-6);
    made.factors[open] = -4;
    EXPECT_FLOAT_EQ(expected_error(weights_of(plain, 1), made), 0.25F);
    EXPECT_NEAR(expected_error(weights_of(plain, 1 - 1 / 144.0F), made), std::exp2(-2.5F), 1e-4) << "halfway";
    EXPECT_NEAR(expected_error(weights_of(plain, 1 - 1 / 36.0F), made), 0.125F, 1e-5);
    EXPECT_FLOAT_EQ(expected_error(weights_of(plain, 1.2F), made), 0.25F) << "beyond the last knot it stays";
    EXPECT_EQ(expected_error(weights_of(plain, 1), table(5)), 1) << "nothing errs by more";
}

TEST(ExpectedError, a_sample_tells_the_rms_of_all) {
    const DepthImage depth = with_holes(tilted_plane(test_camera({640, 480}), 50, 2), 0.002);
    const cv::Mat1f visible = open_where_known(depth);
    shared::ErrorTable uneven = table(-6);
    for (int ring = 0; ring < shared::error_rings; ++ring)
        uneven.factors[shared::error_holes_at + ring] = 4; // four times the error
    double squares = 0, known = 0;
    for (const float error : expected_error_of(depth, visible, radius_m, {}, uneven))
        if (error == error) {
            squares += std::pow(std::min(error, shared::hopeless_error), 2);
            ++known;
        }
    const double all = std::sqrt(squares / known);
    EXPECT_GT(all, 0.127);
    EXPECT_LT(all, 0.29) << "both kinds of pixels count";
    EXPECT_NEAR(expected_rms_of(depth, visible, radius_m, {}, uneven), all, 0.03 * all);
    const cv::Mat1f unknown(visible.size(), std::numeric_limits<float>::quiet_NaN());
    EXPECT_TRUE(std::isnan(expected_rms_of(depth, unknown, radius_m, {}, uneven)));
}

TEST(ExpectedError, without_a_radius_the_worst_is_expected) {
    shared::ErrorTable worse_with_noise{};
    for (int i = 0; i < shared::error_noises; ++i)
        worse_with_noise.factors[shared::error_noises_at + i] = static_cast<float>(i - 8);
    for (const DepthNoise& noise : {DepthNoise{}, DepthNoise{0.001, 0.002}}) {
        const cv::Mat1f errors = expected_error_of(wall(1), open_where_known(wall(1)), 0, noise, worse_with_noise);
        EXPECT_FLOAT_EQ(errors(120, 160), std::exp2(0.5F * (shared::error_noises - 1 - 8)));
    }
}

TEST(ExpectedError, confidence_is_one_less_error_over_its_limit) {
    EXPECT_EQ(confidence_from(0.0F), 1);
    EXPECT_FLOAT_EQ(confidence_from(0.15F), 0.5F);
    EXPECT_EQ(confidence_from(0.3F), 0);
    EXPECT_EQ(confidence_from(0.7F), 0);
    EXPECT_TRUE(std::isnan(confidence_from(std::numeric_limits<float>::quiet_NaN())));
    const cv::Mat1f errors = (cv::Mat1f(1, 2) << 0.06, 0.9);
    EXPECT_FLOAT_EQ(confidence_from(errors)(0, 0), 0.8F);
    EXPECT_TRUE(confidence_from(cv::Mat1f()).empty());
}

} // namespace
} // namespace scanshade
