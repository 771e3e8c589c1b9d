// The last passes of a frame, on the device: what they make is what the host's own formulas say.
#include "ao/finish/finish.h"

#include "apps/picture.h"
#include "projection/attach.h"
#include "projection/base/error.h"
#include "projection/expected_error.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <gtest/gtest.h>
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
