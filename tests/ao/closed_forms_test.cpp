// The classic methods at one point of scenes given by formulas: each method's own expected value, a mean over patterns
// of samples. They were found with exact depth at every tap; here depth is of the nearest pixel, which moves them by
// less than the tolerance. The laws of all methods are in method_test.
#include "ao/base/method.h"
#include "ao/gpu/device.h"
#include "projection/base/error.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using Settings = std::vector<std::pair<std::string, std::string>>;

constexpr double radius = 0.5;
const double s45 = std::sqrt(0.5);

gpu::Device& device() {
    static gpu::Device opened;
    return opened;
}

/// Distance along the ray in units of its z, of the surface seen; 0 for none.
using Scene = std::function<double(const Vector3d& ray)>;

/// A point on a surface, and all around it.
struct Place {
    Vector3d point, normal;
    Scene scene;
    cv::Point along = {}; ///< pixels in this direction are the same place; 0: no others are
};

/// z at which the ray meets the plane through `at`; infinite where it does not.
double plane_z(const Vector3d& ray, const Vector3d& normal, const Vector3d& at) {
    const double z = normal.dot(at) / normal.dot(ray);
    return z > 0 ? z : INFINITY;
}

double seen(double z) { return z < 100 ? z : 0; } // 0: no surface

const Vector3d on_axis(0, 0, 2);
const cv::Point down(0, 1), right(1, 0); // of the image

/// A plane tilted about the vertical axis.
Place plane(double degrees) {
    const double t = degrees * std::numbers::pi / 180;
    const Vector3d normal(std::sin(t), 0, -std::cos(t));
    return {on_axis, normal, [=](const Vector3d& ray) { return seen(plane_z(ray, normal, on_axis)); }, down};
}

/// A wall that faces the camera, and a side wall parallel to the view at `d` from the point.
Place back(double d) {
    return {on_axis,
            {0, 0, -1},
            [=](const Vector3d& ray) {
                return std::min(2.0, plane_z(ray, {1, 0, 0}, {-d, 0, 2}));
            },
            down};
}

/// Along a plane at 45 degrees to the view: its normal, and the direction up and away.
const Vector3d up(0, -s45, -s45), away(0, -s45, s45);

/// Two walls at 45 degrees to the view that meet at `d` from the point, which is on the lower one.
Place symmetric(double d) {
    return {on_axis, up,
            [=](const Vector3d& ray) {
                return std::min(plane_z(ray, up, on_axis), plane_z(ray, away, on_axis + d * away));
            },
            right};
}

/// A level floor 1 m below the camera, and a wall 2.2 m away, `d` behind the point.
Place on_floor(double d) {
    const Vector3d point(0, 1, 2.2 - d);
    return {point,
            {0, -1, 0},
            [=](const Vector3d& ray) {
                return std::min(2.2, plane_z(ray, {0, -1, 0}, point));
            },
            right};
}

/// As symmetric(), but the upper wall is the side of a box of height `h`.
Place box(double h, double d = 0.25 * radius) {
    return {on_axis, up,
            [=](const Vector3d& ray) {
                const auto along = [&](double z) { return away.dot(z * ray - on_axis); };
                const auto height = [&](double z) { return up.dot(z * ray - on_axis); };
                const double side = plane_z(ray, away, on_axis + d * away), top = plane_z(ray, up, on_axis + h * up);
                double z = plane_z(ray, up, on_axis);
                if (std::isfinite(side) && height(side) < h)
                    z = std::min(z, side);
                if (std::isfinite(top) && along(top) > d)
                    z = std::min(z, top);
                return seen(z);
            },
            right};
}

/// A ball on a plane at 45 degrees, which it touches at `x` behind the point.
Place ball(double x) {
    const double r = 0.4 * radius;
    const Vector3d centre = on_axis + x * away + r * up;
    return {on_axis, up, [=](const Vector3d& ray) {
                const double a = ray.dot(ray), b = ray.dot(centre), c = centre.dot(centre) - r * r,
                             root = b * b - a * c;
                const double z = plane_z(ray, up, on_axis);
                return seen(root > 0 ? std::min(z, (b - std::sqrt(root)) / a) : z);
            }};
}

/// Two faces toward the camera: the nearer one ends a quarter of the radius beside the point.
Place step() {
    const double nearer = 2 - 0.6 * radius;
    return {
        on_axis, {0, 0, -1}, [=](const Vector3d& ray) { return ray.x() * nearer < -0.25 * radius ? nearer : 2; }, down};
}

/// An image of the place, with the point in the middle.
DepthImage image_of(const Place& place) {
    constexpr int half = 140; // pixels; the radius is 127 or 132
    constexpr double f = 525;
    const Pinhole camera{f,
                         f,
                         half - f * place.point.x() / place.point.z(),
                         half - f * place.point.y() / place.point.z(),
                         {2 * half + 1, 2 * half + 1}};
    DepthImage depth{camera, cv::Mat1f(camera.size), {}};
    for (int v = 0; v < camera.size.height; ++v)
        for (int u = 0; u < camera.size.width; ++u)
            depth.z_m(v, u) = static_cast<float>(place.scene(Vector3d((u - camera.cx) / f, (v - camera.cy) / f, 1)));
    return depth;
}

struct Spread {
    double mean = 0, deviation = 0;
};

class ClosedForms : public testing::Test {
  protected:
    void TearDown() override {
        for (const std::string& message : device().validation_messages())
            ADD_FAILURE() << message;
    }

    static Method& method_with(const std::string& name, Settings settings) {
        static gpu::Device& opened = device(); // opened before the methods, destroyed after them
        static std::map<std::pair<std::string, Settings>, std::unique_ptr<Method>> made;
        settings.insert(settings.end(), {{"denoise", "false"}, {"curve", "0"}, {"radius", std::to_string(radius)}});
        auto& one = made[{name, settings}];
        if (!one) {
            const auto setup = method_named(name).setup();
            for (Parameter& row : setup->parameters())
                for (const auto& [key, value] : settings)
                    if (row.name == key)
                        set(row, value);
            one = setup->make(opened);
        }
        return *one;
    }

    /// Of the raw visibility of the place's point, over patterns of samples: each of up to eight pixels of the place
    /// has its own, and so has each computation.
    static Spread spread_at(const std::string& method, const Settings& settings, const Place& place,
                            int patterns = 64) {
        const int pixels = place.along == cv::Point() ? 1 : std::clamp(patterns / 8, 1, 8);
        const DepthImage depth = image_of(place);
        const auto n = place.normal.cast<float>();
        const NormalImage normals{cv::Mat3f(depth.z_m.size(), cv::Vec3f(n.x(), n.y(), n.z()))};
        View view{{depth, normals}};
        double sum = 0, squares = 0;
        for (view.instant = 0; view.instant < patterns / pixels; ++view.instant) {
            const cv::Mat1f v = method_with(method, settings).compute(view).visibility;
            for (int k = 0; k < pixels; ++k) {
                const double value = v(cv::Point(v.cols / 2, v.rows / 2) + (k - pixels / 2) * place.along);
                sum += value;
                squares += value * value;
            }
        }
        const double mean = sum / patterns;
        return {mean, std::sqrt(std::max(0.0, squares / patterns - mean * mean))};
    }

    struct Row {
        std::string name;
        Place place;
        double mean, deviation; ///< deviation 0: not compared
    };

    static void expect_rows(const std::string& method, const Settings& settings, const std::vector<Row>& rows) {
        for (const Row& row : rows) {
            const Spread found = spread_at(method, settings, row.place);
            EXPECT_NEAR(found.mean, row.mean, 0.03) << row.name;
            if (row.deviation >= 0.02) {
                EXPECT_NEAR(found.deviation, row.deviation, 0.3 * row.deviation) << row.name;
            }
            fmt::print("{:14} {:.3f} ({:.3f}), expected {:.3f} ({:.3f})\n", row.name, found.mean, found.deviation,
                       row.mean, row.deviation);
        }
        for (const double degrees : {0.0, 60.0, 80.0}) {
            const Spread open = spread_at(method, settings, plane(degrees), 8);
            EXPECT_GE(open.mean, 1 - 1e-6) << degrees;
        }
    }

    using Expected = std::array<std::pair<double, double>, 11>;

    /// The eleven places, in the order of the table of expected values.
    static std::vector<Row> rows_of(const Expected& expected) {
        const double near = 0.25 * radius, far = 0.5 * radius;
        const std::array<std::pair<const char*, Place>, 11> places{{{"back .25", back(near)},
                                                                    {"symmetric .25", symmetric(near)},
                                                                    {"floor .25", on_floor(near)},
                                                                    {"back .5", back(far)},
                                                                    {"symmetric .5", symmetric(far)},
                                                                    {"floor .5", on_floor(far)},
                                                                    {"height .2", box(0.2 * radius)},
                                                                    {"height .5", box(0.5 * radius)},
                                                                    {"ball .5", ball(0.5 * radius)},
                                                                    {"ball .8", ball(0.8 * radius)},
                                                                    {"step", step()}}};
        std::vector<Row> rows;
        for (std::size_t i = 0; i < places.size(); ++i)
            rows.push_back({places[i].first, places[i].second, expected[i].first, expected[i].second});
        return rows;
    }
};

TEST_F(ClosedForms, alchemy) {
    expect_rows("alchemy", {},
                rows_of({{{.921, .100},
                          {.305, .076},
                          {.295, .054},
                          {.926, .073},
                          {.664, .050},
                          {.657, .051},
                          {.757, .081},
                          {.423, .093},
                          {.559, .133},
                          {.799, .061},
                          {.537, .100}}}));
}

TEST_F(ClosedForms, sao) {
    // Without the pyramid, as the expected values are: taps of a pyramid come from other pixels.
    expect_rows("alchemy", {{"profile", "sao"}, {"pyramid", "off"}},
                rows_of({{{.939, .125},
                          {.548, .172},
                          {.458, .149},
                          {.985, .026},
                          {.937, .038},
                          {.925, .035},
                          {.711, .163},
                          {.552, .174},
                          {.612, .328},
                          {.944, .066},
                          {.944, .038}}}));
}

TEST_F(ClosedForms, abao) {
    expect_rows("abao", {},
                rows_of({{{.964, .034},
                          {.883, .004},
                          {.884, .004},
                          {.983, .015},
                          {.952, .003},
                          {.950, .004},
                          {.924, .011},
                          {.884, .005},
                          {.885, .023},
                          {.963, .006},
                          {.906, .014}}}));
}

TEST_F(ClosedForms, hdao_plane) {
    expect_rows("hdao", {},
                rows_of({{{.957, .026},
                          {.695, .022},
                          {.657, .019},
                          {.954, .021},
                          {.805, .020},
                          {.769, .018},
                          {.761, .023},
                          {.708, .022},
                          {.870, .017},
                          {.923, .014},
                          {.797, .021}}}));
}

TEST_F(ClosedForms, hdao_angle) {
    expect_rows("hdao", {{"test", "angle"}},
                rows_of({{{.920, .049},
                          {.513, .050},
                          {.569, .050},
                          {.922, .037},
                          {.735, .044},
                          {.737, .040},
                          {.592, .044},
                          {.513, .050},
                          {.766, .030},
                          {.878, .030},
                          {.594, .041}}}));
}

TEST_F(ClosedForms, hdao_z) {
    // Walls and steps without a partner on the mirrored side do not occlude: known of it, and kept.
    expect_rows("hdao", {{"test", "z"}},
                rows_of({{{1, 0},
                          {.622, .040},
                          {1, 0},
                          {1, 0},
                          {.901, .031},
                          {1, 0},
                          {1, 0},
                          {.728, .046},
                          {.748, .035},
                          {.922, .024},
                          {1, 0}}}));
}

TEST_F(ClosedForms, hbao_plus) {
    expect_rows("hbao", {{"profile", "plus"}},
                rows_of({{{.970, .022},
                          {.819, .014},
                          {.805, .012},
                          {.983, .010},
                          {.947, .008},
                          {.935, .007},
                          {.919, .007},
                          {.827, .012},
                          {.845, .035},
                          {.958, .008},
                          {.890, .019}}}));
}

TEST_F(ClosedForms, vxao) {
    // One view: the wall that is seen edge-on hardly counts. The values are this method's own, over offsets of its
    // grid; its tilt is always the same.
    const Expected expected{{{.959, 0},
                             {.765, 0},
                             {.557, 0},
                             {.965, 0},
                             {.906, 0},
                             {.780, 0},
                             {.900, 0},
                             {.754, 0},
                             {.756, 0},
                             {.922, 0},
                             {.867, 0}}};
    for (const Row& row : rows_of(expected)) {
        const Spread found = spread_at("vxao", {}, row.place, 4);
        fmt::print("{:14} {:.3f} ({:.3f}), expected {:.3f}\n", row.name, found.mean, found.deviation, row.mean);
        EXPECT_NEAR(found.mean, row.mean, 0.03) << row.name;
        std::fflush(stdout);
    }
}

TEST_F(ClosedForms, ssdo) {
    expect_rows("ssdo", {},
                rows_of({{{.972, .043},
                          {.835, .070},
                          {.831, .068},
                          {.984, .030},
                          {.944, .051},
                          {.944, .051},
                          {.970, .024},
                          {.892, .055},
                          {.863, .073},
                          {.957, .044},
                          {.888, .068}}}));
}

TEST_F(ClosedForms, more_taps_change_alchemys_noise_not_its_mean) {
    for (const Place& place : {symmetric(0.25 * radius), box(0.5 * radius), step()})
        EXPECT_NEAR(spread_at("alchemy", {{"taps", "512"}}, place).mean, spread_at("alchemy", {}, place, 512).mean,
                    0.015); // deviations are up to 0.18: 512 patterns leave 0.008
}

TEST_F(ClosedForms, hdaos_valleys_need_both_sides) {
    // What is documented of the published test: a wall behind a level floor is not seen.
    EXPECT_EQ(spread_at("hdao", {{"test", "z"}}, on_floor(0.25 * radius), 8).mean, 1);
    EXPECT_LT(spread_at("hdao", {{"test", "plane"}}, on_floor(0.25 * radius), 8).mean, 0.7);
}

TEST_F(ClosedForms, a_wall_is_closed_to_a_hard_radius) {
    // Lines of uniform angle, in the limit: .701, .775 and .845 of the table, from 16 lines and 2 x 16 steps.
    const Settings hard{{"hard", "true"}, {"lines", "16"}, {"steps", "16"}};
    EXPECT_NEAR(spread_at("abao", hard, symmetric(0.25 * radius), 4).mean, 0.775, 0.03);
    EXPECT_NEAR(spread_at("abao", hard, symmetric(0.5 * radius), 4).mean, 0.845, 0.03);
    EXPECT_NEAR(spread_at("abao", hard, step(), 4).mean, 0.739, 0.04);
}

double mean_difference(const cv::Mat1f& a, const cv::Mat1f& b) {
    return cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total());
}

cv::Mat1f map_of(const std::string& method, const DepthImage& depth, const Settings& settings) {
    const auto setup = method_named(method).setup();
    for (Parameter& row : setup->parameters())
        for (const auto& [key, value] : settings)
            if (row.name == key)
                set(row, value);
    return setup->make(device())->compute({depth}).visibility;
}

TEST_F(ClosedForms, far_taps_may_read_the_pyramid) {
    const DepthImage depth = tests::ball_on_floor(tests::test_camera({640, 480}));
    const cv::Mat1f with = map_of("alchemy", depth, {{"curve", "0"}, {"pyramid", "on"}}),
                    without = map_of("alchemy", depth, {{"curve", "0"}});
    EXPECT_GT(mean_difference(with, without), 0) << "it is read";
    EXPECT_LT(mean_difference(with, without), 0.02);
    EXPECT_NEAR(cv::mean(with)[0], cv::mean(without)[0], 0.003);
    for (const double degrees : {0.0, 60.0, 80.0}) {
        const DepthImage plane = tests::tilted_plane(tests::test_camera({640, 480}), degrees);
        double least = 0;
        cv::minMaxLoc(map_of("alchemy", plane, {{"pyramid", "on"}}), &least);
        EXPECT_GE(least, 0.999) << degrees;
    }
}

TEST_F(ClosedForms, a_layer_of_every_fourth_pixel_is_enough_for_hbao_plus) {
    // Odd sizes: some layers lack a row or a column.
    const DepthImage depth = tests::ball_on_floor(tests::test_camera({323, 241}));
    const Settings plus{{"profile", "plus"}, {"curve", "0"}};
    Settings interleaved = plus;
    interleaved.emplace_back("interleaved", "true");
    const cv::Mat1f a = map_of("hbao", depth, plus), b = map_of("hbao", depth, interleaved);
    EXPECT_GT(mean_difference(a, b), 0);
    EXPECT_LT(mean_difference(a, b), 0.01);
    EXPECT_NEAR(cv::mean(a)[0], cv::mean(b)[0], 0.003);
}

TEST_F(ClosedForms, a_hole_more_never_darkens) {
    // Unknown is open, and a tap of unknown depth stays in the denominator.
    const DepthImage whole = tests::ball_on_floor(tests::test_camera());
    DepthImage punched{whole.camera, whole.z_m.clone(), {}};
    punched.z_m(cv::Rect(60, 40, 25, 20)) = 0;
    const NormalImage normals{cv::Mat3f(whole.z_m.size(), cv::Vec3f(0, -0.6F, -0.8F))}; // holes change derived ones
    const Settings raw{{"denoise", "false"}, {"curve", "0"}};
    for (const auto& [method, more] : {std::pair<std::string, Settings>{"alchemy", {}},
                                       {"alchemy", {{"profile", "sao"}, {"pyramid", "off"}}},
                                       {"abao", {}},
                                       {"hdao", {}},
                                       {"hdao", {{"test", "angle"}}},
                                       {"hdao", {{"test", "z"}}},
                                       {"hbao", {{"profile", "plus"}}},
                                       {"hbao", {{"profile", "plus"}, {"interleaved", "true"}}},
                                       {"ssdo", {}}}) {
        Settings settings = raw;
        settings.insert(settings.end(), more.begin(), more.end());
        const auto setup = method_named(method).setup();
        for (Parameter& row : setup->parameters())
            for (const auto& [key, value] : settings)
                if (row.name == key)
                    set(row, value);
        const auto made = setup->make(device());
        const cv::Mat1f before = made->compute({{whole, normals}}).visibility.clone();
        const cv::Mat1f after = made->compute({{punched, normals}}).visibility;
        double least = 0;
        cv::minMaxLoc(after - before, &least, nullptr, nullptr, nullptr, punched.z_m > 0);
        EXPECT_GE(least, -1e-6) << method << " " << fmt::format("{}", fmt::join(more, " "));
    }
}

TEST_F(ClosedForms, a_hard_radius_never_opens_abao) {
    const DepthImage depth = tests::ball_on_floor(tests::test_camera());
    const cv::Mat1f faded = map_of("abao", depth, {{"denoise", "false"}, {"curve", "0"}}),
                    hard = map_of("abao", depth, {{"denoise", "false"}, {"curve", "0"}, {"hard", "true"}});
    double most = 0;
    cv::minMaxLoc(hard - faded, nullptr, &most);
    EXPECT_LE(most, 1e-6);
}

TEST_F(ClosedForms, the_tone_curve_is_an_exponential_that_keeps_open_open) {
    const DepthImage depth = tests::ball_on_floor(tests::test_camera());
    const cv::Mat1f raw = map_of("ssdo", depth, {{"curve", "0"}}), shown = map_of("ssdo", depth, {{"curve", "2.5"}});
    for (int i = 0; i < static_cast<int>(raw.total()); ++i)
        ASSERT_NEAR(shown(i), std::exp(-2.5 * (1 - raw(i))), 1e-5);
    EXPECT_LT(mean_difference(map_of("ssdo", depth, {}), map_of("ssdo", depth, {{"curve", "-1"}})), 1e-9)
        << "the fitted one is the default";
}

TEST_F(ClosedForms, hdao_takes_no_noise_for_valleys_that_plane_fits_have_left) {
    // Waves of one sigma, wider than the windows of plane fits.
    const Pinhole camera = tests::test_camera();
    DepthImage depth{camera, cv::Mat1f(camera.size), {}};
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u)
            depth.z_m(v, u) = 2 + 0.01F * std::sin(0.2F * static_cast<float>(u));
    const NormalImage normals{cv::Mat3f(depth.z_m.size(), cv::Vec3f(0, 0, -1))};
    const auto mean_of = [&](const Settings& settings, const DepthNoise& noise) {
        const cv::Mat1f v =
            method_with("hdao", settings).compute({{depth, normals}, noise, noise.floor_m > 0}).visibility;
        return cv::mean(v)[0];
    };
    DepthNoise noise;
    noise.floor_m = 0.01;
    EXPECT_LT(mean_of({}, {}), 0.95) << "clean depth has these waves";
    EXPECT_GT(mean_of({}, noise), 0.999);
    EXPECT_EQ(mean_of({{"test", "z"}}, noise), mean_of({{"test", "z"}}, {})) << "as published";
}

TEST_F(ClosedForms, settings_that_belong_to_another_are_refused) {
    EXPECT_THROW(map_of("hdao", tests::ball_on_floor(tests::test_camera()), {{"normal-rejection", "true"}}), Misuse);
    EXPECT_THROW(map_of("hbao", tests::ball_on_floor(tests::test_camera()), {{"interleaved", "true"}}), Misuse);
}

TEST_F(ClosedForms, published_profiles_and_options_run_within_the_range) {
    const DepthImage depth = tests::with_holes(tests::ball_on_floor(tests::test_camera()), 0.05);
    for (const auto& [method, settings] : {std::pair<std::string, Settings>{"abao", {{"profile", "published"}}},
                                           {"hdao", {{"test", "z"}, {"normal-rejection", "true"}}},
                                           {"alchemy", {{"renormalise", "true"}}},
                                           {"ssdo", {{"renormalise", "true"}}}}) {
        const cv::Mat1f v = map_of(method, depth, settings), plain = map_of(method, depth, {});
        for (int i = 0; i < static_cast<int>(v.total()); ++i)
            ASSERT_TRUE(std::isnan(v(i)) ? depth.z_m(i) == 0 : v(i) >= 0 && v(i) <= 1) << method;
        cv::Mat known = depth.z_m > 0;
        EXPECT_GT(cv::norm(v, plain, cv::NORM_L1, known), 0) << method;
    }
}

} // namespace
} // namespace scanshade
