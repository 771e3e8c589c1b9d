// The last passes of a frame, on the device: what they make is what the host's own formulas say.
#include "ao/finish/finish.h"

#include "apps/picture.h"
#include "projection/attach.h"
#include "projection/base/error.h"
#include "projection/sensor/expected_error.h"
#include "projection/srgb.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

using namespace tests;

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
const DepthNoise noise{.floor_m = 0.001, .per_z2 = 0.002};

/// Every factor differs from the others.
shared::ErrorTable some_errors() {
    cv::RNG random(5);
    shared::ErrorTable table{};
    for (float& factor : table.factors)
        factor = random.uniform(-3.0F, 0.0F);
    return table;
}

/// A step with a slanted wall behind it, holes, and pixels of which the visibility is not known.
FinishInput scene(cv::Size size) {
    cv::RNG random(7);
    Pinhole camera = test_camera(size);
    camera.fy *= 0.7; // pixels need not be square
    DepthImage depth = with_holes(tilted_plane(camera, 50, 2), 0.02);
    cv::Mat1f near = depth.z_m.colRange(0, std::max(1, size.width / 3));
    near.setTo(1.2F, near > 0);
    cv::Mat1f visibility(size);
    random.fill(visibility, cv::RNG::UNIFORM, -0.05, 1.05); // rounding may go beyond 0 .. 1
    visibility.setTo(unknown, depth.z_m == 0);
    visibility(size.height / 2, size.width / 2) = unknown;
    cv::Mat3b colour(size);
    random.fill(colour, cv::RNG::UNIFORM, 0, 256);
    return {.camera = depth.camera,
            .z_m = depth.z_m,
            .visibility = visibility,
            .radius_m = 0.3,
            .noise = noise,
            .errors = some_errors(),
            .colour = colour,
            .strength = 0.9};
}

/// Share of the samples that differ by more than `tolerance`.
double share_beyond(const cv::Mat& a, const cv::Mat& b, double tolerance) {
    cv::Mat apart;
    cv::absdiff(a.reshape(1), b.reshape(1), apart);
    return cv::countNonZero(apart > tolerance) / static_cast<double>(apart.total());
}

template <class Integer>
cv::Mat_<Integer> quantised(const cv::Mat1f& values) {
    constexpr double most = std::numeric_limits<Integer>::max();
    cv::Mat_<Integer> integers(values.size());
    std::transform(values.begin(), values.end(), integers.begin(), [](float v) {
        return std::isnan(v) ? Integer(0)
                             : static_cast<Integer>(1 + std::lround(std::clamp<double>(v, 0, 1) * (most - 1)));
    });
    return integers;
}

class FinishTest : public testing::Test {
  protected:
    gpu::Device device;
    void TearDown() override {
        for (const std::string& message : device.validation_messages())
            ADD_FAILURE() << message;
    }
};

constexpr FinishOutputs everything{.error = true, .confidence_bits = 8, .map_bits = 16, .picture = true};

TEST_F(FinishTest, the_device_packs_what_the_host_would) {
    Finish finish(device, Packing::on_device);
    for (const cv::Size size : {cv::Size(321, 203), cv::Size(5, 3), cv::Size(1, 1), cv::Size(640, 4)}) {
        const FinishInput input = scene(size);
        const cv::Mat1f error = expected_error_of({input.camera, input.z_m, {}}, input.visibility, input.radius_m,
                                                  input.noise, input.errors);
        for (const int bits : {16, 8}) {
            FinishOutputs outputs = everything;
            outputs.map_bits = bits;
            const Finished made = finish.compute(input, outputs);
            ASSERT_EQ(made.error.size(), size);
            const cv::Mat known = error == error;                // NOLINT(misc-redundant-expression): false for NaN
            const cv::Mat known_here = made.error == made.error; // NOLINT(misc-redundant-expression)
            EXPECT_EQ(cv::countNonZero(known != known_here), 0);
            cv::Mat1f a = error.clone(), b = made.error.clone();
            a.setTo(0, ~known);
            b.setTo(0, ~known);
            EXPECT_LT(share_beyond(a, b, 1e-4), 0.002) << "a position on a pixel's border may round to the other side";
            EXPECT_EQ(share_beyond(made.confidence_map, quantised<uchar>(confidence_from(made.error)), 1), 0);
            EXPECT_LT(share_beyond(made.confidence_map, quantised<uchar>(confidence_from(made.error)), 0), 0.001)
                << "halves may round either way";
            const cv::Mat expected =
                bits == 16 ? cv::Mat(quantised<ushort>(input.visibility)) : cv::Mat(quantised<uchar>(input.visibility));
            ASSERT_EQ(made.map.type(), expected.type());
            EXPECT_EQ(share_beyond(made.map, expected, 1), 0);
            EXPECT_LT(share_beyond(made.map, expected, 0), 0.01) << "halves may round either way";
            EXPECT_EQ(cv::countNonZero((made.map == 0) != (expected == 0)), 0) << "0 is no surface, and nothing else";
            EXPECT_EQ(share_beyond(made.picture, shade(input.colour, input.visibility, input.strength), 1), 0);
            EXPECT_LT(share_beyond(made.picture, shade(input.colour, input.visibility, input.strength), 0), 0.01);
        }
    }
}

TEST_F(FinishTest, clay_is_that_of_the_host_where_colour_is_missing) {
    FinishInput input = scene({161, 123});
    const cv::Mat3b host_clay = clay(input.z_m, input.camera);
    cv::Mat3b expected_clay = shade(host_clay, input.visibility, input.strength), expected_both;
    cv::Mat1b known(input.z_m.size());
    cv::RNG random(3);
    random.fill(known, cv::RNG::UNIFORM, 0, 2);
    cv::Mat3b base = host_clay.clone();
    input.colour.copyTo(base, known);
    expected_both = shade(base, input.visibility, input.strength);
    for (const Packing packing : {Packing::on_device, Packing::on_host}) {
        Finish finish(device, packing);
        FinishInput colourless = input, partly = input;
        colourless.colour.release();
        partly.colour_known = known;
        const cv::Mat3b both = finish.compute(partly, {.picture = true}).picture;
        const cv::Mat3b alone = finish.compute(colourless, {.picture = true}).picture;
        EXPECT_LT(share_beyond(alone, expected_clay, 1), 0.001);
        EXPECT_LT(share_beyond(both, expected_both, 1), 0.001);
        EXPECT_TRUE(finish.compute(input, {}).picture.empty()) << "not asked for";
    }
}

TEST_F(FinishTest, clay_shows_the_depth_of_plane_fits_where_there_are_any) {
    FinishInput input = scene({160, 120});
    input.colour.release();
    input.visibility.setTo(1);
    const DepthImage flat = tilted_plane(input.camera, 0, 2);
    input.fitted_m = flat.z_m;
    Finish finish(device);
    const cv::Mat3b picture = finish.compute(input, {.picture = true}).picture;
    EXPECT_EQ(share_beyond(picture, clay(flat.z_m, input.camera), 1), 0);
    EXPECT_EQ(finish.compute(input, {.error = true}).picture.size(), cv::Size());
}

// ---------------------------------------------------------------------------------------------------- light

/// The same expected error everywhere.
shared::ErrorTable errors_of(float error) {
    shared::ErrorTable table{};
    std::fill_n(table.factors, shared::error_values * shared::error_shares, 2 * std::log2(error));
    return table;
}

constexpr FinishOutputs all_of_light{.picture = true, .unshaded = true, .split = true};

/// Light from the camera's left and behind it, twice as strong as ambient light.
constexpr shared::LightConstants light{.direct = {-1.2F, -0.4F, -1.5F}};

double linear(uchar stored) { return linear_from_srgb(stored / 255.0); }

TEST_F(FinishTest, ambient_and_direct_light_add_up_to_the_colour) {
    FinishInput input = scene({160, 120});
    input.light = light;
    const Finished made = Finish(device).compute(input, all_of_light);
    ASSERT_EQ(made.ambient.size(), input.colour.size());
    ASSERT_EQ(made.direct.size(), input.colour.size());
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u)
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(linear(made.ambient(v, u)[c]) + linear(made.direct(v, u)[c]), linear(input.colour(v, u)[c]),
                            0.006);
    EXPECT_GT(cv::countNonZero(made.direct.reshape(1) > 20), 160 * 120 / 2) << "most of it faces the light";
}

TEST_F(FinishTest, visibility_multiplies_the_ambient_part_alone) {
    FinishInput input = scene({160, 120});
    const DepthImage wall = tilted_plane(input.camera, 30, 2);
    input.z_m = wall.z_m;
    input.visibility.setTo(0.5);
    input.strength = 1;
    input.colour.setTo(cv::Scalar(120, 150, 180));
    input.light = light;
    const Finished multiplied = Finish(device).compute(input, {.picture = true});
    input.shade = Shade::ambient;
    const Finished made = Finish(device).compute(input, all_of_light);
    // The wall's normal is the same everywhere, so the share of ambient light is.
    const float ratio = shared::direct_over_ambient(
        light,
        {static_cast<float>(std::sin(std::numbers::pi / 6)), 0, -static_cast<float>(std::cos(std::numbers::pi / 6))},
        0.5F, 1);
    const float other = shared::direct_over_ambient(
        light,
        {-static_cast<float>(std::sin(std::numbers::pi / 6)), 0, -static_cast<float>(std::cos(std::numbers::pi / 6))},
        0.5F, 1);
    for (int c = 0; c < 3; ++c) {
        const double whole = linear(input.colour(60, 80)[c]), found = linear(made.picture(60, 80)[c]);
        const auto expected = [&](float of) {
            return whole * (1 - 0.5 * static_cast<double>(shared::ambient_share(of)));
        };
        EXPECT_TRUE(std::abs(found - expected(ratio)) < 0.01 || std::abs(found - expected(other)) < 0.01)
            << found << " " << expected(ratio) << " " << expected(other);
        EXPECT_GT(made.picture(60, 80)[c], multiplied.picture(60, 80)[c]) << "direct light is not darkened";
        EXPECT_LT(made.picture(60, 80)[c], input.colour(60, 80)[c]);
    }
}

TEST_F(FinishTest, without_direct_light_ambient_shading_is_plain_multiplication) {
    FinishInput input = scene({160, 120});
    const cv::Mat3b plain = Finish(device, Packing::on_device).compute(input, {.picture = true}).picture;
    input.shade = Shade::ambient;
    EXPECT_EQ(share_beyond(Finish(device, Packing::on_device).compute(input, {.picture = true}).picture, plain, 0), 0);
    input.light = shared::LightConstants{.direct = {}};
    EXPECT_EQ(share_beyond(Finish(device, Packing::on_device).compute(input, {.picture = true}).picture, plain, 0), 0);
}

TEST_F(FinishTest, unshaded_undoes_the_multiplication_where_confidence_is_high) {
    FinishInput input = scene({160, 120});
    input.z_m = tilted_plane(input.camera, 0, 2).z_m;
    input.strength = 1;
    cv::RNG random(11);
    random.fill(input.visibility, cv::RNG::UNIFORM, 0.3, 1.0);
    random.fill(input.colour, cv::RNG::UNIFORM, 60, 256);
    const cv::Mat3b before = input.colour.clone();
    input.colour = shade(before, input.visibility, 1);
    input.errors = errors_of(0.1F);
    const Finished made = Finish(device).compute(input, {.error = true, .unshaded = true});
    int tried = 0;
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u)
            if (made.error(v, u) < 0.15F) {
                ++tried;
                for (int c = 0; c < 3; ++c)
                    EXPECT_NEAR(made.unshaded(v, u)[c], before(v, u)[c], 3);
            }
    EXPECT_GT(tried, 5000);
}

TEST_F(FinishTest, unshaded_blows_up_neither_unsure_nor_black_nor_clipped_pixels) {
    FinishInput input = scene({160, 120});
    input.z_m = tilted_plane(input.camera, 0, 2).z_m;
    input.visibility.setTo(0.02);
    input.colour.setTo(cv::Scalar(20, 30, 40));
    input.colour(60, 80) = {0, 0, 0};
    input.colour(60, 81) = {255, 128, 64};
    input.visibility(60, 82) = unknown;
    FinishInput unknown_errors = input;
    unknown_errors.errors = {}; // confidence is zero
    input.errors = errors_of(0.1F);
    const Finished sure = Finish(device).compute(input, {.unshaded = true});
    const Finished unsure = Finish(device).compute(unknown_errors, {.unshaded = true});
    EXPECT_EQ(share_beyond(unsure.unshaded, input.colour, 1), 0);
    EXPECT_EQ(sure.unshaded(60, 80), cv::Vec3b(0, 0, 0));
    EXPECT_EQ(sure.unshaded(60, 81), cv::Vec3b(255, 128, 64)) << "its true light is unknown, its hue is kept";
    EXPECT_EQ(sure.unshaded(60, 82), input.colour(60, 82));
    EXPECT_LE(linear(sure.unshaded(60, 90)[0]), linear(20) / 0.15 + 0.01);
    EXPECT_GT(sure.unshaded(60, 90)[0], 40);
}

// ---------------------------------------------------------------------------------------------------- floats

constexpr FinishOutputs as_floats{
    .unshaded = true, .split = true, .indirect = true, .light_values = LightValues::unbounded};

cv::Mat3w sixteen_bits(cv::Size size) {
    cv::Mat3w colour(size);
    cv::RNG random(13);
    random.fill(colour, cv::RNG::UNIFORM, 0, 65536);
    return colour;
}

double linear_of_16(ushort stored) { return linear_from_srgb(stored / 65535.0); }

/// Light of every step of 65,536 survives, and the two parts are exactly the whole.
TEST_F(FinishTest, open_surfaces_keep_every_one_of_16_bits) {
    FinishInput input = scene({160, 120});
    input.visibility.setTo(1);
    input.strength = 1;
    input.deep_colour = sixteen_bits({160, 120});
    input.light = light;
    const LinearLight made = Finish(device).compute(input, as_floats).linear;
    ASSERT_EQ(made.unshaded.size(), input.colour.size());
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u)
            for (int c = 0; c < 3; ++c) {
                const double expected = linear_of_16(input.deep_colour(v, u)[c]);
                ASSERT_EQ(std::lround(65535 * srgb_from_linear(static_cast<double>(made.unshaded(v, u)[c]))),
                          input.deep_colour(v, u)[c]);
                ASSERT_NEAR(made.unshaded(v, u)[c], expected, 1e-6 * expected);
                ASSERT_NEAR(made.ambient(v, u)[c] + made.direct(v, u)[c], expected, 2e-7);
            }
}

TEST_F(FinishTest, floats_are_quotients_that_may_exceed_white_and_integers_keep_the_hue) {
    FinishInput input = scene({160, 120});
    input.z_m = tilted_plane(input.camera, 0, 2).z_m;
    input.visibility.setTo(0.5);
    input.strength = 1;
    input.errors = errors_of(0.1F);
    input.colour.setTo(cv::Scalar(40, 100, 220));
    FinishOutputs outputs{.error = true, .unshaded = true, .light_values = LightValues::unbounded};
    const Finished made = Finish(device).compute(input, outputs);
    ASSERT_LT(made.error(60, 80), 0.15F) << "confidence is high";
    const cv::Vec3f quotient = made.linear.unshaded(60, 80);
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(quotient[c], 2 * linear(input.colour(60, 80)[c]), 1e-6);
    EXPECT_GT(quotient[2], 1.4F);
    outputs.light_values = LightValues::to_white;
    const cv::Vec3f limited = Finish(device).compute(input, outputs).linear.unshaded(60, 80);
    EXPECT_NEAR(limited[2], 1, 1e-6);
    EXPECT_NEAR(limited[1] / limited[2], quotient[1] / quotient[2], 1e-5);
}

/// 8 bits round to the nearest of 256 values; floats are what was rounded.
TEST_F(FinishTest, floats_are_what_bytes_were_rounded_from) {
    FinishInput input = scene({161, 123});
    input.light = light;
    FinishOutputs outputs = as_floats;
    outputs.light_values = LightValues::to_white;
    const LinearLight floats = Finish(device).compute(input, outputs).linear;
    outputs.light_values = LightValues::bytes;
    const Finished bytes = Finish(device).compute(input, outputs);
    EXPECT_TRUE(bytes.linear.unshaded.empty() && Finish(device).compute(input, as_floats).unshaded.empty());
    const auto worst = [](const cv::Mat3f& fine, const cv::Mat3b& coarse) {
        double off = 0;
        for (int v = 0; v < fine.rows; ++v)
            for (int u = 0; u < fine.cols; ++u)
                for (int c = 0; c < 3; ++c) {
                    const double stored = 255 * srgb_from_linear(static_cast<double>(fine(v, u)[c]));
                    off = std::max(off, std::abs(stored - coarse(v, u)[c]));
                }
        return off;
    };
    EXPECT_LT(worst(floats.unshaded, bytes.unshaded), 1.1) << "4096 steps of light have a step of dark greys";
    EXPECT_LT(worst(floats.ambient, bytes.ambient), 1.1);
    EXPECT_LT(worst(floats.direct, bytes.direct), 1.1);
    EXPECT_LT(worst(floats.indirect, bytes.indirect), 1.1);
}

TEST_F(FinishTest, without_colour_nothing_is_divided_or_split) {
    FinishInput input = scene({64, 48});
    input.colour.release();
    input.light = light;
    input.shade = Shade::ambient;
    const Finished made = Finish(device).compute(input, all_of_light);
    EXPECT_TRUE(made.unshaded.empty() && made.ambient.empty() && made.direct.empty());
    EXPECT_TRUE(Finish(device).compute(input, {.indirect = true}).indirect.empty());
    EXPECT_FALSE(made.picture.empty());
}

/// A wall 2 m away, and to the left another one that meets it at a right angle.
struct Corner {
    static constexpr float left_m = -0.5F, back_m = 2;
    FinishInput input;
    int corner_u; ///< the first column of the wall behind

    explicit Corner(cv::Size size = {640, 480}) { // coarser, the wall to the left would jump from column to column
        input = scene(size);
        const Pinhole& camera = input.camera;
        input.z_m = cv::Mat1f(size);
        corner_u = static_cast<int>(std::ceil(camera.cx + camera.fx * static_cast<double>(left_m / back_m)));
        for (int v = 0; v < size.height; ++v)
            for (int u = 0; u < size.width; ++u)
                input.z_m(v, u) = u < corner_u ? left_m / static_cast<float>((u - camera.cx) / camera.fx) : back_m;
        input.visibility = cv::Mat1f(size, 0.5F);
        input.noise = {};
        input.colour = cv::Mat3b(size, cv::Vec3b(200, 200, 200));
        input.colour.colRange(0, corner_u) = cv::Scalar(0, 0, 220); // red
    }
    /// Of the wall behind, so many metres from the corner.
    [[nodiscard]] int column_at(float metres) const {
        return corner_u + static_cast<int>(input.camera.fx * static_cast<double>(metres / back_m));
    }
    [[nodiscard]] cv::Vec3b indirect(gpu::Device& device, int u) const {
        return Finish(device).compute(input, {.indirect = true}).indirect(240, u);
    }
};

TEST_F(FinishTest, a_red_wall_lights_its_neighbour_red_within_the_radius) {
    const Corner corner; // the radius is 0.3 m
    const cv::Mat3b indirect = Finish(device).compute(corner.input, {.indirect = true}).indirect;
    const cv::Vec3b& near = indirect(240, corner.column_at(0.07F));
    const cv::Vec3b& far = indirect(240, corner.column_at(0.5F));
    const cv::Vec3b& on_red = indirect(240, corner.corner_u - 10);
    EXPECT_NEAR(linear(near[2]), 0.5 * linear(220), 0.005) << "closed by half, and all that closes it is red";
    EXPECT_LE(near[0], 5) << "the corner is a little round";
    EXPECT_NEAR(linear(far[2]), 0.5 * linear(200), 0.005)
        << "what closes it is not to be seen, so it looks as the wall";
    EXPECT_NEAR(far[0], far[2], 1);
    EXPECT_NEAR(linear(on_red[0]), 0.5 * linear(200), 0.005) << "what the red wall sees is grey";
    EXPECT_NEAR(on_red[0], on_red[2], 3);
}

TEST_F(FinishTest, where_everything_has_one_colour_a_bounce_is_it_times_what_is_closed) {
    FinishInput input = Corner().input;
    input.colour.setTo(cv::Scalar(90, 140, 190));
    cv::RNG random(3);
    random.fill(input.visibility, cv::RNG::UNIFORM, 0.0, 1.0);
    const cv::Mat3b indirect = Finish(device).compute(input, {.indirect = true}).indirect;
    int compared = 0;
    for (int v = 0; v < indirect.rows; ++v)
        for (int u = 0; u < indirect.cols; ++u) {
            const double closed = 1 - static_cast<double>(input.visibility(v, u));
            compared += closed > 0.05;
            for (int c = 0; c < 3; ++c)
                EXPECT_NEAR(linear(indirect(v, u)[c]), linear(input.colour(v, u)[c]) * closed, 0.004);
        }
    EXPECT_GT(compared, 100000);
}

TEST_F(FinishTest, a_bounce_in_floats_has_the_light_of_16_bits) {
    FinishInput input = Corner().input;
    input.deep_colour = cv::Mat3w(input.colour.size(), cv::Vec3w(301, 20001, 65535)); // 301 is 1.2 of 255
    const cv::Mat3f indirect =
        Finish(device).compute(input, {.indirect = true, .light_values = LightValues::unbounded}).linear.indirect;
    const cv::Vec3f& near = indirect(240, Corner().column_at(0.07F));
    EXPECT_NEAR(near[2], 0.5, 1e-5) << "white, closed by half";
    for (int c = 0; c < 2; ++c)
        EXPECT_NEAR(near[c] / near[2], linear_of_16(input.deep_colour(0, 0)[c]), 1e-6);
}

TEST_F(FinishTest, light_bounces_neither_across_a_gap_nor_from_what_is_not_known) {
    FinishInput input = Corner().input;
    input.z_m.setTo(2);
    input.z_m.colRange(0, 160) = 1.2F; // a red board 0.8 m before the wall
    input.colour.setTo(cv::Scalar(200, 200, 200));
    input.colour.colRange(0, 160) = cv::Scalar(0, 0, 220);
    const cv::Mat3b indirect = Finish(device).compute(input, {.indirect = true}).indirect;
    for (int u = 163; u < 640; u += 9) {
        EXPECT_NEAR(indirect(240, u)[0], indirect(240, u)[2], 1) << "no red from the board, column " << u;
        EXPECT_NEAR(linear(indirect(240, u)[0]), 0.5 * linear(200), 0.005);
    }
    Corner corner;
    corner.input.colour_known = cv::Mat1b(corner.input.z_m.size(), uchar(255));
    corner.input.colour_known.colRange(0, corner.corner_u) = 0;
    const cv::Vec3b near = corner.indirect(device, corner.column_at(0.1F));
    EXPECT_NEAR(near[0], near[2], 1) << "nobody knows that the wall is red";
    corner.input.colour_known.setTo(0);
    EXPECT_EQ(corner.indirect(device, corner.column_at(0.1F)), cv::Vec3b(0, 0, 0)) << "nothing is known of any colour";
    Corner holes;
    holes.input.z_m.colRange(0, holes.corner_u) = 0;
    const cv::Vec3b beside = holes.indirect(device, holes.column_at(0.1F));
    EXPECT_NEAR(beside[0], beside[2], 1);
    EXPECT_EQ(holes.indirect(device, 4), cv::Vec3b(0, 0, 0));
}

TEST_F(FinishTest, clay_hides_colour_where_it_was_asked_for) {
    FinishInput input = scene({160, 120}), colourless = input;
    colourless.colour.release();
    input.shade = Shade::clay;
    for (const Packing packing : {Packing::on_device, Packing::on_host})
        EXPECT_EQ(share_beyond(Finish(device, packing).compute(input, {.picture = true}).picture,
                               Finish(device, packing).compute(colourless, {.picture = true}).picture, 0),
                  0);
}

TEST_F(FinishTest, clay_has_the_normals_of_plane_fits) {
    FinishInput input = scene({160, 120});
    input.colour.release();
    input.visibility.setTo(1);
    cv::RNG random(5);
    input.z_m = tilted_plane(input.camera, 45, 2).z_m;
    cv::Mat1f noise_m(input.z_m.size());
    random.fill(noise_m, cv::RNG::NORMAL, 0, 0.008);
    input.z_m += noise_m;
    input.fitted_m = input.z_m;
    input.fitted_normals_host = cv::Mat3f(input.z_m.size(), cv::Vec3f(std::sqrt(0.5F), 0, -std::sqrt(0.5F)));
    cv::Mat3b smooth = Finish(device).compute(input, {.picture = true}).picture;
    input.fitted_normals_host.release();
    cv::Mat3b rough = Finish(device).compute(input, {.picture = true}).picture;
    const auto spread = [](const cv::Mat3b& picture) {
        const cv::Rect here(70, 50, 20, 20);
        return cv::norm(picture(here), picture(here + cv::Point(1, 0)), cv::NORM_L1) / (3 * here.area());
    };
    EXPECT_LT(spread(smooth), 1) << "grey levels from one pixel to the next";
    EXPECT_GT(spread(rough), 3 * spread(smooth));
}

TEST_F(FinishTest, many_frames_at_once_do_not_disturb_each_other) {
    Finishers finishers(device);
    const FinishInput large = scene({320, 240}), small = scene({64, 48});
    std::vector<std::pair<std::string, double>> unused;
    const Finished large_alone = finishers.compute(large, everything, unused);
    const Finished small_alone = finishers.compute(small, everything, unused);
    cv::parallel_for_(cv::Range(0, 16), [&](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i) {
            std::vector<std::pair<std::string, double>> timings;
            const Finished made = finishers.compute(i % 2 ? large : small, everything, timings);
            const Finished& alone = i % 2 ? large_alone : small_alone;
            EXPECT_EQ(share_beyond(made.picture, alone.picture, 0), 0);
            EXPECT_FALSE(timings.empty());
        }
    });
}

TEST_F(FinishTest, images_of_different_sizes_are_refused) {
    Finish finish(device);
    FinishInput input = scene({64, 48});
    input.colour = cv::Mat3b(10, 10);
    EXPECT_THROW((void)finish.compute(input, everything), Error);
}

} // namespace
} // namespace scanshade
