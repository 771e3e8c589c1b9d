// Depth buffers of renderers are told from depth along z, whatever their near and far planes; what is z is left alone.
#include "projection/sensor/depth_buffer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <random>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using Surface = std::function<double(const Vector3d&)>; ///< z along a ray (x, y, 1)

DepthImage seen(const Surface& surface) {
    DepthImage image{{140, 140, 79.5, 59.5, {160, 120}}, cv::Mat1f(120, 160), {}};
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u)
            image.z_m(v, u) = static_cast<float>(surface(image.camera.ray(u, v)));
    return image;
}
DepthImage with(DepthImage image, const std::function<double(double)>& of) {
    std::ranges::transform(image.z_m, image.z_m.begin(),
                           [&](float z) { return z > 0 ? static_cast<float>(of(double{z})) : 0; });
    return image;
}

double plane(const Vector3d& normal, double offset, const Vector3d& ray) {
    const double along = normal.normalized().dot(ray);
    return along > 0 ? offset / along : 1e9;
}
/// A floor, a wall ahead that is askew, and a wall at the side.
double room(const Vector3d& ray) {
    return std::min(
        {plane({0, 0.94, 0.34}, 1.2, ray), plane({0.3, -0.1, 0.95}, 2.5, ray), plane({-1, 0, 0}, 0.8, ray)});
}
double floor_alone(const Vector3d& ray) { return plane({0, 0.7, 0.7}, 1.2, ray); }
double ball(const Vector3d& ray) {
    const double b = 2 / ray.squaredNorm(), under = b * b - (4 - 0.64) / ray.squaredNorm();
    return under > 0 ? b - std::sqrt(under) : 3.0;
}
double cloth(const Vector3d& ray) { return 2 + 0.1 * std::sin(8 * ray.x()) * std::cos(9 * ray.y()); }

/// As of OpenGL: 0 at the near plane, 1 at the far one and beyond.
auto buffer(double near, double far) {
    return [=](double z) { return far / (far - near) * (1 - near / std::clamp(z, near, far)); };
}

TEST(depth_buffer, is_told_by_planes_at_all_near_and_far_planes) {
    for (const double near : {0.01, 0.02, 0.05, 0.1, 0.5})
        for (const double far : {3.0, 10.0, 100.0, 1000.0}) {
            EXPECT_TRUE(is_depth_buffer(with(seen(room), buffer(near, far)))) << near << " " << far;
            const auto stored = [=](double z) { return std::round(buffer(near, far)(z) * 0xffffff) / 0xffffff; };
            EXPECT_TRUE(is_depth_buffer(with(seen(room), stored))) << near << " " << far << ", of 24 bits";
        }
}

TEST(depth_buffer, is_told_in_other_conventions) {
    const auto of = [](double z) { return buffer(0.1, 100)(z); };
    EXPECT_TRUE(is_depth_buffer(with(seen(room), [&](double z) { return 2 * of(z) - 1; }))) << "-1 .. 1";
    EXPECT_TRUE(is_depth_buffer(with(seen(room), [&](double z) { return 1 - of(z); }))) << "1 is near";
    EXPECT_TRUE(is_depth_buffer(with(seen(floor_alone), of))) << "of one plane";
    EXPECT_TRUE(is_depth_buffer(with(seen([](const Vector3d& ray) { return std::min(room(ray), ball(ray)); }), of)))
        << "with a ball in it";
}

/// As near as a buffer's numbers: the largest is 1.
DepthImage within_one(DepthImage image) {
    image.z_m /= *std::ranges::max_element(image.z_m);
    return image;
}

TEST(depth_buffer, is_not_what_near_depth_is) {
    for (const Surface& surface : {Surface(room), Surface(floor_alone), Surface(ball), Surface(cloth)}) {
        const DepthImage z = within_one(seen(surface));
        std::mt19937 random(5);
        std::normal_distribution<double> normal;
        EXPECT_FALSE(is_depth_buffer(z));
        EXPECT_FALSE(is_depth_buffer(with(z, [](double value) { return std::round(1000 * value) / 1000; })));
        EXPECT_FALSE(is_depth_buffer(with(z, [](double value) { return std::round(65535 * value) / 65535; })));
        EXPECT_FALSE(is_depth_buffer(with(z, [&](double value) { return value + 1e-3 * normal(random); })));
        EXPECT_FALSE(is_depth_buffer(with(z, [](double value) { return 0.9 + 0.1 * value; }))) << "far and flat";
    }
}

TEST(depth_buffer, is_no_table_below_a_camera_one_metre_above_it) {
    const DepthImage table = seen([](const Vector3d& ray) {
        const bool box = std::abs(ray.x() - 0.1) < 0.2 && std::abs(ray.y()) < 0.15;
        return box ? 0.9 : 1.0;
    });
    EXPECT_FALSE(is_depth_buffer(table));
    EXPECT_FALSE(is_depth_buffer(seen([](const Vector3d&) { return 0.998; })));
    EXPECT_FALSE(is_depth_buffer(seen([](const Vector3d& ray) { return plane({0.02, 0.03, 1}, 0.95, ray); })));
}

TEST(depth_buffer, is_no_ramp_that_somebody_drew_nor_waves_nor_bowls) {
    const DepthImage ramp = seen([](const Vector3d& ray) { return 0.5 + 0.3 * ray.x(); });
    EXPECT_FALSE(is_depth_buffer(ramp));
    EXPECT_FALSE(is_depth_buffer(with(ramp, [](double value) { return std::round(1000 * value) / 1000; })));
    for (const double bend : {-0.5, -0.25, -0.1, 0.1, 0.25, 0.5})
        for (const double slope : {0.0, 0.4, 0.9}) {
            EXPECT_FALSE(is_depth_buffer(within_one(seen([&](const Vector3d& ray) {
                return 2 + bend * (ray.x() * ray.x() + ray.y() * ray.y()) + slope * ray.x();
            }))));
            EXPECT_FALSE(is_depth_buffer(within_one(
                seen([&](const Vector3d& ray) { return 2 + 0.5 * bend * std::sin(4 * ray.x()) + slope * ray.y(); }))));
        }
}

TEST(depth_buffer, nothing_is_told_of_holes_and_of_small_images) {
    EXPECT_FALSE(is_depth_buffer(seen([](const Vector3d&) { return 0; })));
    EXPECT_FALSE(is_depth_buffer({{1, 1, 0, 0, {1, 1}}, cv::Mat1f(1, 1, 0.99F), {}}));
    EXPECT_FALSE(is_depth_buffer({{260, 260, 159.5, 119.5, {320, 0}}, cv::Mat1f(0, 320), {}}));
}

} // namespace
} // namespace scanshade
