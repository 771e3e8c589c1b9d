// One bounce of light: rays against closed forms, and what is gathered from an image against rays.
#include "ao/finish/finish.h"
#include "ao/gpu/device.h"
#include "apps/scenes/world/light.h"
#include "projection/srgb.h"

#include <cmath>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;

/// A wall 2 m ahead, and one that meets it at a right angle 0.5 m to the left.
scene::Scene corner(const Vector3d& ahead, const Vector3d& left) {
    scene::Scene made{.name = "corner", .summary = ""};
    made.bodies.push_back({scene::Box{{0, 2.5, 0}, {6, 0.5, 6}}, {.tone = ahead, .other_tone = ahead}});
    made.bodies.push_back({scene::Box{{-1.5, 0, 0}, {1, 5, 6}}, {.tone = left, .other_tone = left}});
    return made;
}

const Vector3d white(0.7, 0.7, 0.7), red(0.6, 0.05, 0.04);

/// A photograph of a scene without occlusion, and the bounce that rays find.
struct Bounced {
    Pinhole camera{260, 260, 159.5, 119.5, {320, 240}};
    scene::Geometry geometry;
    cv::Mat3b colour;
    scene::Bounce truth;

    explicit Bounced(const scene::Scene& scene, int rays = 256) {
        const scene::World world(scene);
        const Eigen::Isometry3d pose = scene::looking_at({0, 0, 0}, {0, 2, 0});
        const scene::SceneLight light{.kind = scene::LightKind::ambient, .occluded = false};
        geometry = render_geometry(world, camera, pose);
        colour = scene::photograph(render_lit(world, camera, pose, light), {});
        truth = true_bounce(world, camera, pose, light, {0.5, rays, 1, false});
    }
    /// On the wall ahead, so far from the corner.
    [[nodiscard]] int column_at(double metres) const {
        return static_cast<int>(std::lround(camera.cx + camera.fx * (metres - 0.5) / 2));
    }
};

TEST(Bounce, among_surfaces_of_one_colour_is_that_times_what_is_closed) {
    const Bounced bounced(corner(white, white), 64);
    const double sent = linear_from_srgb(bounced.colour(120, 200)[1] / 255.0);
    for (int v = 5; v < 240; v += 9)
        for (int u = 5; u < 320; u += 9)
            EXPECT_NEAR(bounced.truth.indirect(v, u)[1],
                        sent * (1 - static_cast<double>(bounced.truth.visibility(v, u))), 0.003);
}

/// What a wall at a right angle closes within R: 0.343 at R / 4, 0.196 at R / 2 (methods.md's closed form).
TEST(Bounce, of_a_red_wall_has_its_colour_and_the_closed_form) {
    const Bounced bounced(corner(white, red), 1024);
    const cv::Vec3b& on_red = bounced.colour(120, 10);
    for (const auto& [share, closed] : {std::pair(0.25, 0.343), std::pair(0.5, 0.196)}) {
        cv::Vec3d mean;
        int count = 0;
        for (int v = 100; v < 140; ++v, ++count)
            mean += cv::Vec3d(bounced.truth.indirect(v, bounced.column_at(share * 0.5)));
        mean /= count;
        EXPECT_NEAR(mean[0], closed * linear_from_srgb(on_red[2] / 255.0), 0.02);
        EXPECT_NEAR(mean[2], closed * linear_from_srgb(on_red[0] / 255.0), 0.003);
    }
    EXPECT_EQ(bounced.truth.indirect(120, bounced.column_at(0.6)), cv::Vec3f(0, 0, 0)) << "beyond the radius";
}

/// RMSE, bias, and the factor that would suit best, of found light against true light; red, green and blue together.
struct Agreement {
    double rmse, bias, factor, none;
};
Agreement agreement(const cv::Mat3f& found, const cv::Mat3f& truth) {
    double squares = 0, sum = 0, xx = 0, xy = 0, yy = 0;
    for (int v = 0; v < found.rows; ++v)
        for (int u = 0; u < found.cols; ++u)
            for (int c = 0; c < 3; ++c) {
                const double x = static_cast<double>(found(v, u)[2 - c]), y = static_cast<double>(truth(v, u)[c]);
                squares += (x - y) * (x - y);
                sum += x - y;
                xx += x * x;
                xy += x * y;
                yy += y * y;
            }
    const double n = 3.0 * static_cast<double>(found.total());
    return {std::sqrt(squares / n), sum / n, xy / xx, std::sqrt(yy / n)};
}

TEST(Bounce, from_the_image_is_that_of_rays) {
    gpu::Device device;
    for (const auto& [ahead, left] : {std::pair(white, red), std::pair(red, white), std::pair(white, white)}) {
        const Bounced bounced(corner(ahead, left));
        const FinishInput input{.camera = bounced.camera,
                                .z_m = bounced.geometry.z_m,
                                .visibility = bounced.truth.visibility,
                                .radius_m = 0.5,
                                .noise = {},
                                .colour = bounced.colour};
        const cv::Mat3f found =
            Finish(device).compute(input, {.indirect = true, .light_values = LightValues::unbounded}).linear.indirect;
        const Agreement with = agreement(found, bounced.truth.indirect);
        EXPECT_LT(with.rmse, 0.4 * with.none) << "none would be off by " << with.none;
        EXPECT_NEAR(with.factor, 1, 0.15);
        EXPECT_LT(std::abs(with.bias), 0.15 * with.none);
    }
}

} // namespace
} // namespace scanshade
