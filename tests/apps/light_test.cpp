// Light of colours: what is estimated on scenes whose light is known.
#include "ao/finish/finish.h"
#include "ao/gpu/device.h"
#include "ao/light/light.h"
#include "apps/scenes/world/light.h"
#include "projection/base/hash.h"
#include "projection/srgb.h"

#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::Vector3d;

/// Spheres and boxes on a floor, seen from one place; each of one albedo.
const scene::Scene& still_life() {
    static const scene::Scene scene = [] {
        scene::Scene made{.name = "still life", .summary = ""};
        const auto add = [&](const scene::Solid& solid, const Vector3d& albedo) {
            made.bodies.push_back({solid, {.tone = albedo, .pattern = scene::Pattern::plain}});
        };
        add(scene::Box{{0, 0, -0.5}, {3, 3, 0.5}}, {0.5, 0.45, 0.4});
        add(scene::Box{{0, 3.5, 1.5}, {3, 0.5, 3.5}}, {0.55, 0.55, 0.5});
        for (int i = 0; i < 12; ++i) {
            const int row = i / 4;
            const double x = -1.8 + 1.2 * (i % 4), y = -1.2 + 1.3 * row;
            const Vector3d albedo(0.25 + 0.4 * hash(3U * i) * 0x1p-32, 0.25 + 0.4 * hash(3U * i + 1) * 0x1p-32,
                                  0.25 + 0.4 * hash(3U * i + 2) * 0x1p-32);
            if (i % 2)
                add(scene::Sphere{{x, y, 0.4}, 0.4}, albedo);
            else
                add(scene::Box{{x, y, 0.3},
                               {0.35, 0.3, 0.3},
                               Eigen::AngleAxisd(0.5 * i, Vector3d::UnitZ()).toRotationMatrix()},
                    albedo);
        }
        return made;
    }();
    return scene;
}

/// A photograph with everything that is known of it.
struct Photograph {
    scene::Geometry geometry;
    cv::Mat1f visibility;
    cv::Mat3b colour;
    scene::LitImages lit;
    Pinhole camera;
    Eigen::Isometry3d pose;
};

Photograph taken(const scene::SceneLight& light, const Vector3d& eye, cv::Size size = {320, 240}) {
    static const scene::World world(still_life());
    const Pinhole camera{260, 260, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size};
    const Eigen::Isometry3d pose = scene::looking_at(eye, {0, 0.3, 0.2});
    Photograph made{scene::render_geometry(world, camera, pose), {}, {}, {}, camera, pose};
    made.visibility = true_visibility(world, camera, pose, {0.5, 64, 1, false}).visibility[0];
    made.lit = scene::render_lit(world, camera, pose, light);
    made.colour = scene::photograph(made.lit, light.occluded ? made.visibility : cv::Mat1f());
    return made;
}

void add(LightSamples& samples, const Photograph& photograph) {
    const DepthImage depth{photograph.camera, photograph.geometry.z_m, {}};
    const NormalImage normals{photograph.geometry.normals};
    samples.add({depth, normals, photograph.visibility, photograph.colour, {}, photograph.pose});
}

const Vector3d eyes[] = {{0.5, -3.5, 2.2}, {-2.5, -2.8, 1.8}, {2.6, -2.2, 2.6}};

LightEstimate estimated(const scene::SceneLight& light, const LightRequest& request = {}) {
    LightSamples samples(true);
    for (const Vector3d& eye : eyes)
        add(samples, taken(light, eye));
    samples.group();
    return estimate_light(samples, request);
}

double degrees_between(const Vector3d& a, const Vector3d& b) {
    return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) * 180 / std::numbers::pi;
}

TEST(LightTest, a_sun_is_found_with_its_direction_and_strength) {
    for (const Vector3d& towards : {Vector3d(0.45, -0.35, 0.82), Vector3d(-0.7, -0.5, 0.5)}) {
        const LightEstimate found = estimated({.kind = scene::LightKind::sun, .towards = towards, .ratio = 1.5});
        SCOPED_TRACE(found.sentence);
        ASSERT_TRUE(found.light.has_direct());
        EXPECT_LT(degrees_between(found.light.direct, towards), 10);
        EXPECT_NEAR(found.light.direct.norm(), 1.5, 0.3);
        EXPECT_GT(found.light.tint.x(), found.light.tint.z()) << "the sun is warmer than the sky";
    }
}

TEST(LightTest, ambient_light_alone_holds_no_direct_light) {
    for (const scene::LightKind kind : {scene::LightKind::ambient, scene::LightKind::overcast}) {
        const LightEstimate found = estimated({.kind = kind});
        EXPECT_FALSE(found.light.has_direct()) << found.sentence;
        EXPECT_NE(found.sentence.find("all of it is ambient"), std::string::npos) << found.sentence;
        EXPECT_NEAR(found.light.power, 1, 0.3);
    }
}

TEST(LightTest, a_term_is_kept_only_where_it_explains_unseen_surfaces_better) {
    const LightEstimate ambient = estimated({.kind = scene::LightKind::ambient});
    ASSERT_EQ(ambient.models.size(), 6U);
    EXPECT_EQ(ambient.chosen, "ambient");
    EXPECT_LT(ambient.models[1].held_out, 0.9 * ambient.models[0].held_out) << "visibility explains something";
    const LightEstimate overcast = estimated({.kind = scene::LightKind::overcast});
    EXPECT_EQ(overcast.chosen, "ambient with a gradient");
    EXPECT_NEAR(overcast.light.gradient.z(), 0.5, 0.2);
}

TEST(LightTest, colours_that_show_no_occlusion_have_a_power_near_zero) {
    const LightEstimate found = estimated({.kind = scene::LightKind::ambient, .occluded = false});
    EXPECT_LT(found.light.power, 0.1);
}

TEST(LightTest, a_direction_that_was_given_is_kept_and_none_is_none) {
    const Vector3d towards(0.45, -0.35, 0.82);
    const scene::SceneLight sun{.kind = scene::LightKind::sun, .towards = towards, .ratio = 1.5};
    const LightEstimate given = estimated(sun, {.direct = true, .towards = towards});
    ASSERT_TRUE(given.light.has_direct()) << given.sentence;
    EXPECT_LT(degrees_between(given.light.direct, towards), 0.01);
    EXPECT_NEAR(given.light.direct.norm(), 1.5, 0.3);
    EXPECT_FALSE(estimated(sun, {.direct = false, .towards = {}}).light.has_direct());
}

/// A depth camera's noise: disparity off by a normal deviate for each pixel.
Photograph with_noise(Photograph made, double disparity_px) {
    made.geometry.z_m = made.geometry.z_m.clone();
    made.geometry.normals = made.geometry.normals.clone();
    for (int i = 0; i < static_cast<int>(made.geometry.z_m.total()); ++i) {
        const auto share = [&](std::uint32_t salt) {
            return (hash(static_cast<std::uint32_t>(i), salt) + 0.5) * 0x1p-32;
        };
        const double deviate = std::sqrt(-2 * std::log(share(1))) * std::cos(2 * std::numbers::pi * share(2));
        float& z = made.geometry.z_m(i);
        const double baseline_px_m = made.camera.fx * 0.075;
        if (z > 0)
            z = static_cast<float>(1 / (1 / static_cast<double>(z) + deviate * disparity_px / baseline_px_m));
        made.geometry.normals(i) = {0, 0, -1}; // whoever takes these finds nothing
    }
    return made;
}

TEST(LightTest, a_sun_is_found_through_a_depth_cameras_noise) {
    const Vector3d towards(0.45, -0.35, 0.82);
    LightSamples samples(true);
    std::vector<double> off;
    for (const Vector3d& eye : eyes) {
        const Photograph clean =
            taken({.kind = scene::LightKind::sun, .towards = towards, .ratio = 1.5}, eye, {640, 480});
        add(samples, with_noise(clean, 0.05));
        for (std::size_t i = off.size(); i < samples.all().size(); ++i) {
            const LightSample& sample = samples.all()[i];
            const cv::Vec3f n = clean.geometry.normals(sample.v, sample.u);
            off.push_back(degrees_between(sample.normal, clean.pose.linear() * Vector3d(static_cast<double>(n[0]),
                                                                                        static_cast<double>(n[1]),
                                                                                        static_cast<double>(n[2]))));
        }
    }
    std::ranges::sort(off);
    EXPECT_LT(off[off.size() / 2], 1.5) << "samples lie where normals are sure";
    EXPECT_LT(off[off.size() * 9 / 10], 4);
    samples.group();
    const LightEstimate found = estimate_light(samples);
    SCOPED_TRACE(found.sentence);
    ASSERT_TRUE(found.light.has_direct());
    EXPECT_LT(degrees_between(found.light.direct, towards), 10);
    EXPECT_NEAR(found.light.direct.norm(), 1.5, 0.4);
}

TEST(LightTest, paint_in_two_tones_is_no_light) {
    LightSamples samples(true);
    for (const Vector3d& eye : eyes) {
        Photograph photograph = taken({.kind = scene::LightKind::ambient}, eye);
        for (int v = 0; v < photograph.colour.rows; ++v)
            for (int u = 0; u < photograph.colour.cols; ++u)
                if ((u / 12 + v / 12) % 2 == 0)
                    for (unsigned char& c : photograph.colour(v, u).val)
                        c = static_cast<unsigned char>(0.7 * c);
        add(samples, photograph);
    }
    samples.group();
    const LightEstimate found = estimate_light(samples);
    EXPECT_FALSE(found.light.has_direct()) << found.sentence;
}

/// Wrong directions were found on scenes where a direct light explained little (ao/light/README.md).
TEST(LightTest, a_direction_is_doubted_where_the_light_explains_little) {
    int found = 0;
    for (const double ratio : {0.2, 0.4, 1.5}) {
        const LightEstimate estimate = estimated({.kind = scene::LightKind::sun, .ratio = ratio});
        if (!estimate.light.has_direct()) {
            EXPECT_TRUE(estimate.light.doubt.empty());
            continue;
        }
        ++found;
        const auto of = [&](const std::string& name) {
            return std::ranges::find(estimate.models, name, &LightModel::name)->held_out;
        };
        const double explained = 1 - of(estimate.chosen) / of("ambient");
        EXPECT_EQ(explained < 0.13, !estimate.light.doubt.empty()) << ratio << ": " << explained;
        EXPECT_EQ(estimate.sentence.find("not sure") != std::string::npos, !estimate.light.doubt.empty());
    }
    EXPECT_GE(found, 1);
    const LightEstimate given =
        estimated({.kind = scene::LightKind::sun, .ratio = 0.3}, {.towards = Vector3d(0.45, -0.35, 0.82).normalized()});
    EXPECT_TRUE(given.light.doubt.empty()) << "its direction was given";
}

TEST(LightTest, the_same_samples_give_the_same_light) {
    const scene::SceneLight sun{.kind = scene::LightKind::sun};
    const LightEstimate a = estimated(sun), b = estimated(sun);
    EXPECT_EQ(a.light.direct, b.light.direct);
    EXPECT_EQ(a.sentence, b.sentence);
}

TEST(LightTest, grey_black_and_clipped_pixels_do_no_harm) {
    const scene::SceneLight sun{.kind = scene::LightKind::sun};
    LightSamples samples(true), dark(true);
    for (const Vector3d& eye : eyes) {
        Photograph photograph = taken(sun, eye);
        for (cv::Vec3b& c : photograph.colour)
            c = cv::Vec3b::all(c[1]);
        photograph.colour.colRange(0, 40).setTo(cv::Scalar::all(255));
        photograph.colour.colRange(280, 320).setTo(cv::Scalar::all(0));
        add(samples, photograph);
        photograph.colour.setTo(cv::Scalar::all(0));
        add(dark, photograph);
    }
    samples.group();
    dark.group();
    for (const LightSample& sample : samples.all())
        EXPECT_TRUE(sample.u >= 40 && sample.u < 280);
    const LightEstimate found = estimate_light(samples);
    EXPECT_TRUE(found.light.direct.allFinite());
    EXPECT_NEAR(found.light.tint.x(), found.light.tint.z(), 0.02);
    const LightEstimate none = estimate_light(dark);
    EXPECT_FALSE(none.light.has_direct());
    EXPECT_NE(none.sentence.find("too little"), std::string::npos);
}

// ---------------------------------------------------------------------------------------------------- one bounce

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
