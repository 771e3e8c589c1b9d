// Exact depth that looks noisy, as renderers and their files leave it: nothing of it is dropped or smoothed.
#include "projection/project.h"
#include "projection/sensor/depth_steps.h"
#include "projection/sensor/noise.h"
#include "tests/support/noisy.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <Eigen/Core>
#include <functional>
#include <gtest/gtest.h>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace scanshade {
namespace {

using namespace tests;

/// A floor 1.5 m below a level camera, and a wall.
DepthImage level_room(cv::Size size, double wall_m) {
    DepthImage room{test_camera(size), cv::Mat1f(size), {}};
    for (int y = 0; y < size.height; ++y) {
        const double down = (y + 0.25 - room.camera.cy) / room.camera.fy;
        room.z_m.row(y) = static_cast<float>(down > 1.5 / wall_m ? 1.5 / down : wall_m);
    }
    return room;
}

/// A room with five boxes on its floor, before a level camera, which turns from one number to the next. The first half
/// of the numbers look along a wall.
DepthImage cluttered_room(cv::Size size, int number) {
    std::minstd_rand dice(static_cast<unsigned>(number) + 1);
    const auto within = [&dice](double low, double high) {
        return low + (high - low) * static_cast<double>(dice() % 1000) / 1000;
    };
    using Box = std::pair<Eigen::Array3d, Eigen::Array3d>;
    const Eigen::Array3d half(within(2, 5), within(1.2, 1.6), within(2, 6));
    std::vector<Box> boxes;
    for (int i = 0; i < 5; ++i) {
        const Eigen::Array3d side(within(0.1, 0.5), within(0.1, 0.5), within(0.1, 0.5)),
            middle(within(-half.x(), half.x()), half.y() - side.y(), within(0, half.z()));
        boxes.emplace_back(middle - side, middle + side);
    }
    const Eigen::Array3d eye(within(-1, 1), half.y() - 0.9, -0.6 * half.z());
    const double turned = number < 8 ? 0 : within(-1, 1);
    DepthImage room{test_camera(size), cv::Mat1f(size), {}};
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const double right = (x - room.camera.cx) / room.camera.fx, down = (y - room.camera.cy) / room.camera.fy;
            const Eigen::Array3d ray(std::cos(turned) * right + std::sin(turned), down,
                                     std::cos(turned) - std::sin(turned) * right);
            double z = ((half * ray.sign() - eye) / ray).minCoeff();
            for (const auto& [least, most] : boxes) {
                const Eigen::Array3d to_least = (least - eye) / ray, to_most = (most - eye) / ray;
                const double in = to_least.min(to_most).maxCoeff(), out = to_least.max(to_most).minCoeff();
                z = in > 0 && in < out ? std::min(z, in) : z;
            }
            room.z_m(y, x) = static_cast<float>(z);
        }
    return room;
}

/// A plane that is turned about both axes of the image: no row and no column is at one depth.
DepthImage slope(cv::Size size, double z_m, double along, double down) {
    DepthImage plane{test_camera(size), cv::Mat1f(size), {}};
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x)
            plane.z_m(y, x) = static_cast<float>(z_m / (1 + along * (x - plane.camera.cx) / plane.camera.fx +
                                                        down * (y - plane.camera.cy) / plane.camera.fy));
    return plane;
}

std::vector<DepthImage> slopes(cv::Size size = {640, 480}) {
    return {slope(size, 2.5, 0.6, 0.35), slope(size, 4, -0.3, 0.5), slope(size, 1.2, 0.2, -0.7)};
}

std::vector<DepthImage> held(std::vector<DepthImage> images, const std::function<double(double)>& as) {
    for (DepthImage& image : images)
        for (float& z : image.z_m)
            z = static_cast<float>(as(static_cast<double>(z)));
    return images;
}

std::vector<DepthImage> with_noise(std::vector<DepthImage> images, const DepthNoise& noise) {
    for (std::size_t i = 0; i < images.size(); ++i)
        images[i] = noisy(images[i], noise, 0, static_cast<unsigned>(i));
    return images;
}

TEST(exact_depth, rows_of_a_floor_before_a_level_camera_are_no_steps) {
    for (const cv::Size size : {cv::Size(640, 480), cv::Size(320, 240)})
        for (const double unit : {0.0, 1000.0}) {
            const auto stored = [&](double z) { return unit > 0 ? std::round(z * unit) / unit : z; };
            const DepthNoise measured = measure_noise(held({level_room(size, 6)}, stored));
            EXPECT_EQ(measured.at(2), 0) << size << ", " << unit << " a metre: " << describe(measured);
        }
}

// A tenth to a half of these would seem noisy by the spread of their differences, with a sigma of up to 4 cm.
TEST(exact_depth, rooms_before_a_level_camera_are_exact_in_images_of_any_size) {
    for (const cv::Size size :
         {cv::Size(64, 64), cv::Size(84, 84), cv::Size(160, 120), cv::Size(256, 256), cv::Size(512, 512)})
        for (const double unit : {0.0, 1000.0}) {
            int noisy_rooms = 0;
            std::string told;
            for (int number = 0; number < 16; ++number) {
                DepthImage room = cluttered_room(size, number);
                for (float& z : room.z_m)
                    z = unit > 0 ? static_cast<float>(std::round(static_cast<double>(z) * unit) / unit) : z;
                const DepthNoise measured = measure_noise({&room, 1});
                noisy_rooms += measured.at(2) > 0;
                told += std::to_string(number) + ": " + describe(measured) + "\n";
            }
            EXPECT_EQ(noisy_rooms, 0) << size << ", " << unit << " a metre\n" << told;
        }
}

TEST(exact_depth, noise_is_found_in_rooms_before_a_level_camera) {
    for (const double unit : {0.0, 1000.0})
        for (const double floor_m : {0.002, 0.006})
            for (int number = 0; number < 16; ++number) {
                const DepthNoise measured =
                    measure_noise(held(with_noise({cluttered_room({320, 240}, number)}, {floor_m, 0}),
                                       [unit](double z) { return unit > 0 ? std::round(z * unit) / unit : z; }));
                EXPECT_NEAR(measured.at(3), floor_m, 0.4 * floor_m) << number << ": " << describe(measured);
            }
}

/// Ground that is rough at every scale, as far as 12 m before a camera 1.4 m above it, and a row of posts on it.
DepthImage uneven_ground(cv::Size size, double rough_m) {
    DepthImage ground{test_camera(size), cv::Mat1f(size), {}};
    const auto height = [rough_m](double x, double z) {
        double sum = 0;
        for (int octave = 0; octave < 6; ++octave) {
            const double cycles = 2 * std::exp2(octave);
            sum += std::sin(cycles * x + octave) * std::sin(cycles * z + 2 * octave) / std::exp2(octave);
        }
        return rough_m * sum;
    };
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const double right = (x - ground.camera.cx) / ground.camera.fx,
                         down = (y - ground.camera.cy) / ground.camera.fy + 0.45;
            double z = 0.5;
            while (z < 12 && down * z < 1.4 + height(right * z, z))
                z *= 1.02;
            double above = z / 1.02;
            for (int i = 0; i < 25; ++i) {
                const double middle = (above + z) / 2;
                (down * middle < 1.4 + height(right * middle, middle) ? above : z) = middle;
            }
            const double post_z = 2 + std::floor(8 * static_cast<double>(x) / size.width) / 2;
            const bool post = x % (size.width / 8) < size.width / 40 && down * post_z > 0.2;
            ground.z_m(y, x) = static_cast<float>(post ? std::min(z, post_z) : z);
        }
    return ground;
}

TEST(exact_depth, few_values_tell_the_step_that_all_are_whole_numbers_of) {
    std::vector<float> rows_mm, rows_m; // of a floor, 1.4 m below a camera of 365 pixels
    for (int row = 200; row > 40; row -= 4)
        rows_mm.push_back(static_cast<float>(std::round(1000 * 1.4 * 365 / row) / 1000)),
            rows_m.push_back(static_cast<float>(1.4 * 365 / row));
    EXPECT_NEAR(steps_of(rows_mm).step_m, 0.001, 1e-6);
    EXPECT_EQ(steps_of(rows_m).step_m, 0);
}

TEST(exact_depth, uneven_ground_is_no_noise) {
    const DepthImage rough = uneven_ground({320, 240}, 0.05), smoother = uneven_ground({320, 240}, 0.02);
    for (const double unit : {0.0, 1000.0}) {
        const auto stored = [unit](double z) { return unit > 0 ? std::round(z * unit) / unit : z; };
        const DepthNoise none = measure_noise(held({rough}, stored));
        EXPECT_EQ(none.at(2), 0) << unit << ": " << describe(none);
        const DepthNoise some = measure_noise(held(with_noise({smoother}, {0.004, 0}), stored));
        EXPECT_NEAR(some.at(2), 0.004, 0.002) << unit << ": " << describe(some);
    }
}

TEST(exact_depth, millimetres_behind_a_lens_are_steps_though_interpolation_hides_them) {
    Frame frame;
    frame.camera.pinhole = test_camera({512, 424});
    frame.camera.distortion = {.k1 = 0.09};
    const auto seen = [&](const std::vector<DepthImage>& images) {
        std::vector<DepthImage> straight;
        for (const DepthImage& image : held(images, [](double z) { return std::round(z * 1000) / 1000; })) {
            frame.depth_m = image.z_m;
            straight.push_back(project(frame));
        }
        return measure_noise(straight);
    };
    const DepthNoise none = seen(slopes({512, 424}));
    EXPECT_EQ(none.at(2), 0) << describe(none);
    EXPECT_NEAR(none.step_m, 0.001, 1e-5) << describe(none);
    const DepthNoise some = seen(with_noise(slopes({512, 424}), {0.004, 0}));
    EXPECT_NEAR(some.at(2), 0.0035, 0.001) << "interpolation takes some away: " << describe(some);
}

TEST(exact_depth, few_digits_are_no_noise) {
    // As OpenEXR files hold it, in 11 binary digits, and as a renderer's depth buffer of 16 bits does, from 0.1 to 20
    // m.
    const auto half = [](double z) {
        return static_cast<double>(static_cast<float>(static_cast<Eigen::half>(static_cast<float>(z))));
    };
    const auto buffered = [](double z) { return 1 / (10 - std::round((10 - 1 / z) / 9.95 * 65535) / 65535 * 9.95); };
    for (const std::function<double(double)>& as : {std::function<double(double)>(half), {buffered}}) {
        const DepthNoise none = measure_noise(held(slopes(), as));
        EXPECT_EQ(none.at(2), 0) << describe(none);
        EXPECT_FALSE(none.flies()) << describe(none);
        const DepthNoise some = measure_noise(held(with_noise(slopes(), {0.002, 0.001}), as));
        EXPECT_NEAR(some.at(2), 0.006, 0.0012) << describe(some);
        EXPECT_LT(some.correlation_px, 1.4) << describe(some);
    }
}

TEST(exact_depth, steps_of_a_power_of_two_are_even_though_16_bit_floats_hold_them) {
    const DepthNoise measured = measure_noise(held(slopes(), [](double z) { return std::round(z * 256) / 256; }));
    EXPECT_NEAR(measured.step_m, 1.0 / 256, 1e-5) << describe(measured);
    EXPECT_FALSE(measured.flies()) << describe(measured);
}

TEST(exact_depth, few_pixels_are_not_noisy_for_that) {
    for (const cv::Size size : {cv::Size(64, 48), cv::Size(96, 72)}) {
        const DepthNoise measured = measure_noise(slopes(size));
        EXPECT_EQ(measured.at(2), 0) << size << ": " << describe(measured);
    }
}

} // namespace
} // namespace scanshade
