// Planes tell whether an image holds depth along z, distances or disparities; noise and bent surfaces do not mislead.
#include "projection/sensor/depth_kind.h"

#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace scanshade {
namespace {

using Eigen::Vector3d;

/// A floor, a wall ahead that is askew, and a wall at the side, as a camera that looks down a little sees them.
DepthImage room() {
    DepthImage seen{{260, 260, 159.5, 119.5, {320, 240}}, cv::Mat1f(240, 320), {}};
    const auto nearest = [](const Vector3d& ray) {
        double z = 20;
        for (const auto& [normal, offset] : {std::pair{Vector3d(0, 0.94, 0.34), 1.5},
                                             {Vector3d(0.3, -0.1, 0.95), 3.5},
                                             {Vector3d(-0.95, 0, 0.3), 1.6}})
            if (const double along = normal.normalized().dot(ray); along > 0)
                z = std::min(z, offset / along);
        return z;
    };
    for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u)
            seen.z_m(v, u) = static_cast<float>(nearest(seen.camera.ray(u, v)));
    return seen;
}

template <class Of>
DepthImage with(DepthImage image, const Of& of) {
    for (int v = 0; v < image.z_m.rows; ++v)
        for (int u = 0; u < image.z_m.cols; ++u)
            image.z_m(v, u) = static_cast<float>(of(static_cast<double>(image.z_m(v, u)), image.camera.ray(u, v)));
    return image;
}
DepthImage ranges(const DepthImage& image) {
    return with(image, [](double z, const Vector3d& ray) { return z * ray.norm(); });
}
DepthImage disparities(const DepthImage& image) {
    return with(image, [](double z, const Vector3d&) { return 10 / z; });
}
/// As of a Kinect: it grows with the square of z.
DepthImage noisy(const DepthImage& image) {
    std::mt19937 random(23);
    std::normal_distribution<double> normal;
    return with(image, [&](double z, const Vector3d&) { return z + 0.0018 * z * z * normal(random); });
}

TEST(depth_kind, planes_tell_depth_from_ranges_and_disparities) {
    EXPECT_EQ(depth_kind(room()), DepthKind::z);
    EXPECT_EQ(depth_kind(ranges(room())), DepthKind::range);
    EXPECT_EQ(depth_kind(disparities(room())), DepthKind::inverse);
}

TEST(depth_kind, noise_of_a_sensor_leaves_it_told) {
    EXPECT_EQ(depth_kind(noisy(room())), DepthKind::z);
    EXPECT_EQ(depth_kind(ranges(noisy(room()))), DepthKind::range);
    EXPECT_EQ(depth_kind(disparities(noisy(room()))), DepthKind::inverse);
}

TEST(depth_kind, the_unit_does_not_matter_nor_does_an_offset_of_disparities) {
    const auto times = [](DepthImage image, float by) {
        image.z_m *= by;
        return image;
    };
    EXPECT_EQ(depth_kind(times(room(), 1000)), DepthKind::z);
    EXPECT_EQ(depth_kind(times(disparities(room()), 0.01F)), DepthKind::inverse);
    // As of networks that tell depth from one picture: nearness, up to a factor and an offset.
    const DepthImage near = with(room(), [](double z, const Vector3d&) { return 1 / z - 0.03; });
    EXPECT_EQ(depth_kind(near), DepthKind::inverse);
}

TEST(depth_kind, nothing_is_told_of_a_wall_ahead_of_holes_and_of_small_images) {
    EXPECT_EQ(depth_kind(with(room(), [](double, const Vector3d&) { return 0.0; })), DepthKind::unknown);
    EXPECT_EQ(depth_kind({{1, 1, 0, 0, {1, 1}}, cv::Mat1f(1, 1, 2.0F), {}}), DepthKind::unknown);
    EXPECT_EQ(depth_kind({{260, 260, 159.5, 119.5, {320, 0}}, cv::Mat1f(0, 320), {}}), DepthKind::unknown);
    EXPECT_NE(depth_kind(with(room(), [](double, const Vector3d&) { return 2.0; })), DepthKind::inverse);
    EXPECT_NE(depth_kind(with(room(), [](double, const Vector3d&) { return 2.0; })), DepthKind::range);
}

TEST(depth_kind, drawn_ramps_of_depth_are_not_called_disparities) {
    const auto drawn = [](auto value) {
        DepthImage image{{525, 525, 319.5, 239.5, {640, 480}}, cv::Mat1f(480, 640), {}};
        for (int v = 0; v < 480; ++v)
            for (int u = 0; u < 640; ++u)
                image.z_m(v, u) = std::round(1000 * static_cast<float>(value(u, v))) / 1000;
        return image;
    };
    for (const DepthImage& image : {drawn([](int u, int) { return 1 + 0.003 * u; }),
                                    drawn([](int u, int v) { return 4 - 0.003 * u - 0.002 * v; }),
                                    drawn([](int u, int) { return 2 - 0.003 * std::abs(u - 320); })})
        EXPECT_NE(depth_kind(image), DepthKind::inverse);
}

TEST(depth_kind, bent_surfaces_are_not_mistaken) {
    // Waves of a cloth, a ball before a wall, and the inside of a pipe along z.
    const DepthImage cloth = with(
        room(), [](double, const Vector3d& ray) { return 2 + 0.1 * std::sin(8 * ray.x()) * std::cos(9 * ray.y()); });
    const DepthImage ball = with(room(), [](double, const Vector3d& ray) {
        const double b = 2 / ray.squaredNorm(), under = b * b - (4 - 0.64) / ray.squaredNorm();
        return under > 0 ? b - std::sqrt(under) : 3.0;
    });
    const DepthImage pipe =
        with(room(), [](double, const Vector3d& ray) { return std::min(6.0, 1 / std::hypot(ray.x() - 0.1, ray.y())); });
    for (const DepthImage& image : {cloth, ball, pipe}) {
        EXPECT_NE(depth_kind(image), DepthKind::inverse);
        EXPECT_NE(depth_kind(image), DepthKind::range);
    }
}

TEST(depth_kind, waves_and_bowls_of_any_kind_are_depth) {
    for (const double bend : {-0.5, -0.25, -0.1, 0.1, 0.25, 0.5})
        for (const double x : {-0.6, 0.0, 0.4})
            for (const double slope : {0.0, 0.4, 0.9}) {
                const DepthImage bowl = with(room(), [&](double, const Vector3d& ray) {
                    const double right = ray.x() - x, down = ray.y() + 0.3;
                    return 2 + bend * (right * right + down * down) + slope * right;
                });
                const DepthImage waves = with(room(), [&](double, const Vector3d& ray) {
                    return 2 + 0.5 * bend * std::sin(4 * (ray.x() - x)) + slope * ray.y();
                });
                for (const DepthImage& image : {bowl, waves}) {
                    EXPECT_NE(depth_kind(image), DepthKind::inverse) << bend << " " << x << " " << slope;
                    EXPECT_NE(depth_kind(image), DepthKind::range) << bend << " " << x << " " << slope;
                }
            }
}

TEST(depth_kind, balls_before_the_camera_are_no_walls_of_ranges) {
    for (const double radius : {0.5, 0.8, 1.0})
        for (const double nearest : {0.4, 0.6, 0.8}) {
            const double middle = radius + nearest;
            const DepthImage ball = with(room(), [&](double, const Vector3d& ray) {
                const double b = middle / ray.squaredNorm(),
                             under = b * b - (middle * middle - radius * radius) / ray.squaredNorm();
                return under > 0 ? b - std::sqrt(under) : 0;
            });
            EXPECT_NE(depth_kind(ball), DepthKind::range) << radius << " " << nearest;
            EXPECT_NE(depth_kind(ball), DepthKind::inverse) << radius << " " << nearest;
        }
}

} // namespace
} // namespace scanshade
