// The camera of a depth image that was written as a cloud without its grid.
#include "projection/pixel_cloud.h"

#include "projection/base/hash.h"

#include <cmath>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

const Pinhole camera{541.3, 542.1, 318.4, 236.8, {640, 480}};

/// A floor and a ball before a wall; 0 where `is_hole`.
template <class IsHole>
Cloud written(const Pinhole& pinhole, const IsHole& is_hole, bool by_columns = false) {
    Cloud cloud;
    const int outer = by_columns ? pinhole.size.width : pinhole.size.height,
              inner = by_columns ? pinhole.size.height : pinhole.size.width;
    for (int i = 0; i < outer; ++i)
        for (int k = 0; k < inner; ++k) {
            const int u = by_columns ? i : k, v = by_columns ? k : i;
            if (is_hole(u, v))
                continue;
            const double x = (u - pinhole.cx) / pinhole.fx, y = (v - pinhole.cy) / pinhole.fy;
            const double z = std::min(3.0 + 0.4 * x, y > 0.05 ? 1.1 / y : 9.0) - (std::hypot(x, y) < 0.2 ? 0.6 : 0);
            cloud.points.emplace_back(x * z, y * z, z);
        }
    cloud.grid = {static_cast<int>(cloud.points.size()), 1};
    return cloud;
}

const auto no_hole = [](int, int) { return false; };
/// A shadow, a border of holes on the left, and specks.
const auto holes = [](int u, int v) { return u < 11 || (u > 200 && u < 260 && v > 100) || hash(u, v) % 10 == 0; };

void expect_camera(const std::optional<PixelCloud>& found, double cx, double cy, cv::Size size, double within) {
    ASSERT_TRUE(found);
    const Pinhole& pinhole = found->fit.camera;
    EXPECT_NEAR(pinhole.fx, camera.fx, 100 * within);
    EXPECT_NEAR(pinhole.fy, camera.fy, 100 * within);
    EXPECT_NEAR(pinhole.cx, cx, 50 * within);
    EXPECT_NEAR(pinhole.cy, cy, 50 * within);
    EXPECT_EQ(pinhole.size, size);
    EXPECT_LT(found->fit.rms_px, 0.15);
}

TEST(PixelCloud, a_whole_image_has_its_camera) {
    expect_camera(pixel_cloud(written(camera, no_hole)), camera.cx, camera.cy, camera.size, 1e-6);
    expect_camera(pixel_cloud(written(camera, no_hole, true)), camera.cx, camera.cy, camera.size, 1e-6);
}

TEST(PixelCloud, holes_are_left_out_and_the_image_is_cut_to_its_points) {
    expect_camera(pixel_cloud(written(camera, holes)), camera.cx - 11, camera.cy, {629, 480}, 1e-6);
}

TEST(PixelCloud, coordinates_in_whole_millimetres_and_single_precision_do) {
    Cloud rounded = written(camera, holes), single = rounded;
    for (Eigen::Vector3d& point : rounded.points)
        point = (point * 1000).array().round().matrix() / 1000;
    for (Eigen::Vector3d& point : single.points)
        point = point.cast<float>().cast<double>();
    expect_camera(pixel_cloud(rounded), camera.cx - 11, camera.cy, {629, 480}, 0.01);
    expect_camera(pixel_cloud(single), camera.cx - 11, camera.cy, {629, 480}, 1e-5);
}

TEST(PixelCloud, points_that_are_no_numbers_or_at_the_origin_are_holes) {
    Cloud cloud = written(camera, no_hole);
    for (std::size_t i = 0; i < cloud.points.size(); i += 17)
        cloud.points[i] = i % 2 == 0 ? Eigen::Vector3d(Eigen::Vector3d::Constant(NAN)) : Eigen::Vector3d::Zero();
    expect_camera(pixel_cloud(cloud), camera.cx, camera.cy, camera.size, 1e-6);
}

TEST(PixelCloud, an_image_seen_along_minus_z_is_turned) {
    Cloud cloud = written(camera, holes);
    for (Eigen::Vector3d& point : cloud.points)
        point = {point.x(), -point.y(), -point.z()};
    const auto found = pixel_cloud(cloud);
    expect_camera(found, camera.cx - 11, camera.cy, {629, 480}, 1e-6);
    EXPECT_TRUE(found->flipped);
    EXPECT_FALSE(pixel_cloud(written(camera, holes))->flipped);
}

TEST(PixelCloud, other_clouds_have_no_pixels) {
    const Cloud image = written(camera, no_hole);
    Cloud turned = image, sampled = image, shuffled = image, both = image, moved = image;
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 0.5).normalized()).toRotationMatrix();
    for (Eigen::Vector3d& point : turned.points)
        point = turn * point;
    for (Eigen::Vector3d& point : moved.points)
        point += Eigen::Vector3d(0.05, 0.02, 0.1);
    sampled.points.clear();
    for (std::size_t i = 0; i < image.points.size(); ++i) {
        if (hash(static_cast<std::uint32_t>(i)) % 10 < 7)
            sampled.points.push_back(image.points[i]);
        const std::size_t other = hash(static_cast<std::uint32_t>(i), 7U) % (i + 1);
        std::swap(shuffled.points[i], shuffled.points[other]);
    }
    for (const Eigen::Vector3d& point : image.points)
        both.points.push_back(1.01 * point); // a second image through the same pixels
    for (Cloud* cloud : {&turned, &sampled, &shuffled, &both, &moved}) {
        cloud->grid = {static_cast<int>(cloud->points.size()), 1};
        EXPECT_FALSE(pixel_cloud(*cloud));
    }
    Cloud random; // a scan of a room in no order
    for (std::uint32_t i = 0; i < 20000; ++i)
        random.points.emplace_back(hash(i) * 0x1p-32 - 0.5, hash(i, 1U) * 0x1p-32 - 0.5, 1 + hash(i, 2U) * 0x1p-32);
    random.grid = {20000, 1};
    EXPECT_FALSE(pixel_cloud(random));
    Cloud organised = image;
    organised.grid = camera.size;
    EXPECT_FALSE(pixel_cloud(organised)); // its grid is known
}

} // namespace
} // namespace scanshade
