// Depth frames found again in a cloud that was merged from them.
#include "projection/found_frames.h"

#include "projection/base/hash.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::Isometry3d, Eigen::Vector3d;

const Pinhole camera{131.25, 130.9, 78.3, 61.7, {160, 120}};

double uniform(std::size_t a, std::size_t b) {
    return hash(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b)) / 0x1p32;
}

/// Walks round in a room of 6 x 5 x 2.6 m with a ball in it, z up.
Isometry3d pose(int frame) {
    Isometry3d world_from_camera = Isometry3d::Identity();
    const double turn = 0.35 * frame;
    Eigen::Matrix3d level;
    level << 0, 0, 1, -1, 0, 0, 0, -1, 0; // looks along x
    world_from_camera.linear() = Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix() * level *
                                 Eigen::AngleAxisd(0.2 + 0.02 * frame, Vector3d::UnitX()).toRotationMatrix();
    world_from_camera.translation() = Vector3d(0.3 * frame - 1, 0.2 * frame, 1.5 + 0.05 * frame);
    return world_from_camera;
}

/// How far along a ray the room or the ball is.
double distance(const Vector3d& from, const Vector3d& ray) {
    double nearest = 1e9;
    const Vector3d low(-3, -2.5, 0), high(3, 2.5, 2.6), ball(1.2, 0.5, 0.8);
    for (int k = 0; k < 3; ++k)
        for (const double wall : {low[k], high[k]})
            if (const double t = (wall - from[k]) / ray[k]; t > 0)
                nearest = std::min(nearest, t);
    const Vector3d to = ball - from;
    const double along = to.dot(ray) / ray.squaredNorm(), across = (along * ray - to).norm();
    if (across < 0.4 && along > 0)
        nearest = std::min(nearest, along - std::sqrt(0.16 - across * across) / ray.norm());
    return nearest;
}

struct Merged {
    std::vector<Vector3d> points;
    std::vector<int> frame, pixel;
};

struct How {
    int frames = 4;
    double noise = 0.006;                              ///< times z^2
    std::array<Pinhole, 2> in_turn = {camera, camera}; ///< of even and of odd frames
    std::function<bool(int frame, int u, int v)> keeps = [](int, int, int) { return true; };
};

/// As single-precision files have them, with a border and a hole left out.
Merged merged(const How& how) {
    Merged all;
    for (int frame = 0; frame < how.frames; ++frame)
        for (int v = 0; v < camera.size.height; ++v)
            for (int u = 5; u < camera.size.width; ++u) {
                if ((u > 60 && u < 75 && v > 40 && v < 90) || !how.keeps(frame, u, v))
                    continue;
                const Pinhole& own = how.in_turn[static_cast<std::size_t>(frame % 2)];
                const Isometry3d at = pose(frame);
                const int pixel = v * camera.size.width + u;
                double z = distance(at.translation(), at.linear() * own.ray(u, v));
                const auto f = static_cast<std::size_t>(frame), p = static_cast<std::size_t>(pixel);
                z += how.noise * z * z * (uniform(f, 2 * p) + uniform(f, 2 * p + 1) + uniform(p, f + 9) - 1.5);
                all.points.push_back((at * own.point(u, v, z)).cast<float>().cast<double>());
                all.frame.push_back(frame);
                all.pixel.push_back(pixel);
            }
    return all;
}

/// That every frame is found, and that its camera and pixels are those that made it.
void expect_frames(const Merged& made, int frames, double within_m, double share = 0.999) {
    const std::optional<FoundFrames> found = found_frames(made.points);
    ASSERT_TRUE(found);
    ASSERT_EQ(found->frames.size(), static_cast<std::size_t>(frames));
    EXPECT_GE(found->share, share);
    for (int i = 0; i < frames; ++i) {
        const FoundFrame& one = found->frames[static_cast<std::size_t>(i)];
        EXPECT_LT((one.world_from_camera.translation() - pose(i).translation()).norm(), within_m) << i;
        EXPECT_GT((one.world_from_camera.linear().col(2)).dot(pose(i).linear().col(2)), 1 - within_m) << i;
        EXPECT_NEAR(one.camera.fx, camera.fx, 30 * within_m);
        EXPECT_NEAR(one.camera.fy, camera.fy, 30 * within_m);
        EXPECT_EQ(one.camera.size, found->frames.front().camera.size);
    }
    // The image is cut: its first column and row are some of the camera's.
    const cv::Size size = found->frames.front().camera.size;
    const int left = static_cast<int>(std::lround(camera.cx - found->frames.front().camera.cx));
    const int top = static_cast<int>(std::lround(camera.cy - found->frames.front().camera.cy));
    std::size_t right = 0;
    for (std::size_t i = 0; i < made.points.size(); ++i) {
        const int u = made.pixel[i] % camera.size.width - left, v = made.pixel[i] / camera.size.width - top;
        right += found->frame[i] == made.frame[i] && found->pixel[i] == v * size.width + u;
    }
    EXPECT_GE(static_cast<double>(right), share * static_cast<double>(made.points.size()));
}

TEST(FoundFrames, cameras_and_pixels_are_exact_however_large_noise_is) {
    expect_frames(merged({}), 4, 1e-4);
    expect_frames(merged({.noise = 0.03}), 4, 1e-4);
    expect_frames(merged({.frames = 1}), 1, 1e-4);
}

TEST(FoundFrames, depth_is_along_the_axis_of_the_camera) {
    const Merged made = merged({.frames = 2});
    const std::optional<FoundFrames> found = found_frames(made.points);
    ASSERT_TRUE(found);
    const cv::Mat1f z = found->depth(1, made.points);
    const Isometry3d camera_from_world = pose(1).inverse();
    std::size_t seen = 0;
    for (std::size_t i = 0; i < made.points.size(); ++i) {
        if (found->frame[i] != 1)
            continue;
        ++seen;
        const float at = z(found->pixel[i] / z.cols, found->pixel[i] % z.cols);
        EXPECT_NEAR(at, (camera_from_world * made.points[i]).z(), 1e-3);
    }
    EXPECT_EQ(static_cast<int>(seen), cv::countNonZero(z > 0));
    EXPECT_GT(seen, made.points.size() / 3);
}

TEST(FoundFrames, a_part_of_the_points_does_if_their_order_is_kept) {
    const auto part = [](double share) {
        return [=](int frame, int u, int v) {
            return uniform(static_cast<std::size_t>(v * 1000 + u), static_cast<std::size_t>(frame + 77)) < share;
        };
    };
    expect_frames(merged({.keeps = part(0.7)}), 4, 1e-3);
    expect_frames(merged({.keeps = part(0.4)}), 4, 1e-3, 0.99);
}

TEST(FoundFrames, every_second_column_is_an_image_half_as_wide) {
    const Merged made = merged({.keeps = [](int, int u, int) { return u % 2 == 0; }});
    const std::optional<FoundFrames> found = found_frames(made.points);
    ASSERT_TRUE(found);
    EXPECT_GT(found->share, 0.999);
    EXPECT_NEAR(found->frames.front().camera.fx, camera.fx / 2, 0.01);
    EXPECT_NEAR(found->frames.front().camera.fy, camera.fy, 0.01);
}

TEST(FoundFrames, coordinates_rounded_to_a_tenth_of_a_millimetre_or_to_one_do) {
    for (const double step : {1e-4, 1e-3}) {
        Merged made = merged({});
        for (Vector3d& point : made.points)
            point = (point / step).array().round().matrix() * step;
        expect_frames(made, 4, 30 * step, 0.98);
    }
}

TEST(FoundFrames, frames_of_one_camera_get_one) {
    for (const double step : {0.0, 2e-4}) {
        Merged made = merged({.frames = 6});
        for (Vector3d& point : made.points)
            if (step > 0)
                point = (point / step).array().round().matrix() * step;
        const std::optional<FoundFrames> found = found_frames(made.points);
        ASSERT_TRUE(found);
        ASSERT_EQ(found->frames.size(), 6U);
        for (const FoundFrame& frame : found->frames)
            EXPECT_EQ(frame.camera, found->frames.front().camera);
        EXPECT_NEAR(found->frames.front().camera.fx, camera.fx, step > 0 ? 5e-3 : 1e-5);
        EXPECT_NEAR(found->frames.front().camera.fy, camera.fy, step > 0 ? 5e-3 : 1e-5);
    }
}

TEST(FoundFrames, two_cameras_in_turn_stay_two) {
    Pinhole second = camera;
    second.fx *= 1.002;
    second.cy += 0.3;
    const std::optional<FoundFrames> found = found_frames(merged({.frames = 6, .in_turn = {camera, second}}).points);
    ASSERT_TRUE(found);
    ASSERT_EQ(found->frames.size(), 6U);
    EXPECT_GT(found->share, 0.999);
    for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_EQ(found->frames[i].camera, found->frames[i % 2].camera);
        EXPECT_NEAR(found->frames[i].camera.fx, i % 2 == 0 ? camera.fx : second.fx, 1e-5);
        EXPECT_NEAR(found->frames[i].camera.fy, camera.fy, 1e-5);
    }
    EXPECT_NEAR(found->frames[1].camera.cy - found->frames[0].camera.cy, 0.3, 1e-4);
}

TEST(FoundFrames, of_known_cameras_any_points_show_their_pixels) {
    const Merged made = merged({.frames = 3});
    std::vector<FoundFrame> known;
    std::vector<Vector3d> points;
    std::vector<int> pixel;
    for (int frame = 0; frame < 3; ++frame) {
        known.push_back({camera, pose(frame), points.size(), 0});
        for (std::size_t i = 0; i < made.points.size(); ++i)
            if (made.frame[i] == frame && uniform(i, 3) < 0.05) {
                points.push_back(made.points[i]);
                pixel.push_back(made.pixel[i]);
            }
        known.back().last = points.size();
    }
    EXPECT_FALSE(found_frames(points)) << "too few to show their frames";
    const FoundFrames found = pixels_of(known, points);
    EXPECT_EQ(found.share, 1);
    EXPECT_EQ(std::vector<int>(found.pixel.begin(), found.pixel.end()), pixel);
    EXPECT_EQ(cv::countNonZero(found.depth(1, points) > 0), static_cast<int>(known[1].last - known[1].first));
    for (Vector3d& point : points)
        point += Vector3d(0.01, 0.01, 0.01);
    EXPECT_LT(pixels_of(known, points).share, 0.5);
}

TEST(FoundFrames, map_coordinates_and_millimetres_do) {
    Merged made = merged({});
    const Vector3d offset(512300, 5403100, 210);
    std::vector<Vector3d> moved = made.points, in_mm = made.points;
    for (Vector3d& point : moved)
        point = ((point + offset) * 1e4).array().round().matrix() / 1e4;
    for (Vector3d& point : in_mm)
        point *= 1000;
    const std::optional<FoundFrames> far = found_frames(moved), large = found_frames(in_mm);
    ASSERT_TRUE(far);
    ASSERT_TRUE(large);
    EXPECT_LT((far->frames[2].world_from_camera.translation() - offset - pose(2).translation()).norm(), 0.01);
    EXPECT_LT((large->frames[2].world_from_camera.translation() / 1000 - pose(2).translation()).norm(), 1e-3);
}

TEST(FoundFrames, rows_that_are_not_finite_are_left_out) {
    Merged made = merged({});
    for (std::size_t i = 0; i < made.points.size(); i += 50)
        made.points[i] = Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    const std::optional<FoundFrames> found = found_frames(made.points);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->frame[0], -1);
    EXPECT_EQ(found->pixel[50], -1);
    EXPECT_GT(found->share, 0.999);
}

TEST(FoundFrames, a_shuffled_cloud_has_none) {
    Merged whole = merged({}), within = whole;
    for (std::size_t i = whole.points.size() - 1; i > 0; --i)
        std::swap(whole.points[i], whole.points[hash(static_cast<std::uint32_t>(i), 1) % (i + 1)]);
    EXPECT_FALSE(found_frames(whole.points));
    std::size_t first = 0;
    while (first < within.points.size()) {
        std::size_t last = first;
        while (last < within.points.size() && within.frame[last] == within.frame[first])
            ++last;
        for (std::size_t i = last - 1; i > first; --i)
            std::swap(within.points[i],
                      within.points[first + hash(static_cast<std::uint32_t>(i), 2) % (i - first + 1)]);
        first = last;
    }
    EXPECT_FALSE(found_frames(within.points));
}

/// Columns of a scanner at even angles lie in planes through it, too.
TEST(FoundFrames, a_laser_scan_has_none) {
    for (const double step : {0.5, 0.2}) {
        std::vector<Vector3d> points;
        const Vector3d station(-0.5, 0.4, 1.5);
        for (double azimuth = 0; azimuth < 180; azimuth += step)
            for (double elevation = -50; elevation < 60; elevation += step) {
                const double a = azimuth * std::numbers::pi / 180, e = elevation * std::numbers::pi / 180;
                const Vector3d ray(std::cos(a) * std::cos(e), std::sin(a) * std::cos(e), std::sin(e));
                const double noise = 0.004 * (uniform(points.size(), 5) - 0.5);
                points.push_back((station + (distance(station, ray) + noise) * ray).cast<float>().cast<double>());
            }
        EXPECT_FALSE(found_frames(points)) << step;
    }
}

TEST(FoundFrames, a_grid_and_an_even_cloud_have_none) {
    std::vector<Vector3d> grid, even;
    for (int i = 0; i < 200; ++i)
        for (int k = 0; k < 200; ++k) {
            grid.emplace_back(0.01 * k, 0.01 * i, 0.2 * std::sin(0.05 * k) * std::cos(0.04 * i));
            const std::size_t n = static_cast<std::size_t>(i) * 200 + static_cast<std::size_t>(k);
            even.emplace_back(uniform(n, 1), uniform(n, 2), 0.3 * uniform(n, 3));
        }
    EXPECT_FALSE(found_frames(grid));
    EXPECT_FALSE(found_frames(even));
    EXPECT_FALSE(found_frames(std::vector<Vector3d>(5000, Vector3d(1, 2, 3))));
    EXPECT_FALSE(found_frames({}));
}

} // namespace
} // namespace scanshade
