// What the classic methods share: noise, normals and denoising, each compared with its own definition, and holes.
#include "ao/gpu/program.h"
#include "ao/screen/noise.h"
#include "ao/screen/screen.h"
#include "shaders/shared/screen.h"
#include "tests/support/classics.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <set>

namespace scanshade {
namespace {

using namespace tests;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();

// ------------------------------------------------------------------------------------------------- noise

TEST(Noise, the_hilbert_curve_visits_every_cell_and_never_jumps) {
    std::vector<cv::Point> place(64 * 64, {-1, -1});
    for (std::uint32_t y = 0; y < 64; ++y)
        for (std::uint32_t x = 0; x < 64; ++x) {
            const std::uint32_t i = hilbert_index(x, y);
            ASSERT_LT(i, place.size());
            ASSERT_EQ(place[i].x, -1) << "visited twice";
            place[i] = {static_cast<int>(x), static_cast<int>(y)};
        }
    for (std::size_t i = 1; i < place.size(); ++i)
        ASSERT_EQ(std::abs(place[i].x - place[i - 1].x) + std::abs(place[i].y - place[i - 1].y), 1) << i;
}

TEST(Noise, any_8x8_pixels_hold_numbers_spread_over_zero_to_one) {
    // 64 consecutive values of a golden-ratio-like sequence: no gap is wider than a few of the 64 even ones.
    const auto table = noise_table(3);
    for (int part = 0; part < 2; ++part) {
        std::set<float> values;
        for (int y = 8; y < 16; ++y)
            for (int x = 24; x < 32; ++x)
                values.insert(table[static_cast<std::size_t>(2 * (64 * y + x) + part)]);
        ASSERT_EQ(values.size(), 64U);
        float before = 0, widest = 0;
        for (const float value : values) {
            widest = std::max(widest, value - before);
            before = value;
        }
        EXPECT_LT(std::max(widest, 1 - before), 4.0F / 64) << part;
        EXPECT_GE(*values.begin(), 0);
        EXPECT_LT(*values.rbegin(), 1);
    }
    EXPECT_NE(table, noise_table(4));
}

// ------------------------------------------------------------------------------------------------- normals

/// Only the shared passes: depth, given normals and raw visibility in; normals and shown visibility out.
struct SharedPasses {
    enum : int { depth, given, raw, surfaces, visibility };
    std::unique_ptr<gpu::Program> program;

    SharedPasses(cv::Size size, bool supplied) {
        using Row = gpu::BufferRow;
        const auto pixels = static_cast<std::size_t>(size.area());
        ScreenTables tables{{{}, size}, size, 0, {}, {}};
        tables.buffers = {{"depth", pixels * 4, Row::Host::upload, Row::Texels::r32f},
                          {"given", pixels * 12, Row::Host::upload, Row::Texels::r32f},
                          {"raw", pixels * 4, Row::Host::upload, Row::Texels::r32f},
                          {"surfaces", pixels * 16, Row::Host::download, Row::Texels::rgba32f},
                          {"visibility", pixels * 4, Row::Host::download, Row::Texels::r32f}};
        tables.add_pass("normals", "normals", {depth, given}, {surfaces}, {{shared::spec_supplied, supplied}});
        tables.add_pass("denoise", "denoise", {surfaces, raw}, {visibility}, {}, 2);
        program = tables.program(device(), sizeof(shared::ScreenConstants));
    }

    void put(int buffer, const cv::Mat& image) {
        std::memcpy(program->host(buffer).data(), image.clone().data, image.total() * image.elemSize());
    }
};

/// Normal and depth of each pixel.
cv::Mat4f surfaces_of(const DepthImage& depth, const cv::Mat3f& supplied = {}, const DepthNoise& noise = {}) {
    SharedPasses passes(depth.z_m.size(), !supplied.empty());
    passes.put(SharedPasses::depth, depth.z_m);
    if (!supplied.empty())
        passes.put(SharedPasses::given, supplied);
    const shared::ScreenConstants k = constants_from(ScreenOptions{}, {.surfaces = depth, .noise = noise});
    passes.program->run(std::as_bytes(std::span(&k, 1)));
    cv::Mat4f surfaces(depth.z_m.size());
    std::ranges::copy(passes.program->host_as<cv::Vec4f>(SharedPasses::surfaces), surfaces.begin());
    return surfaces;
}

cv::Mat3f normals_of(const DepthImage& depth, const cv::Mat3f& supplied = {}) {
    const cv::Mat4f surfaces = surfaces_of(depth, supplied);
    cv::Mat3f normals(depth.z_m.size());
    std::ranges::transform(surfaces, normals.begin(), [](const cv::Vec4f& s) { return cv::Vec3f(s[0], s[1], s[2]); });
    return normals;
}

double degrees_between(const cv::Vec3f& a, const cv::Vec3f& b) {
    return std::atan2(cv::norm(a.cross(b)), a.dot(b)) * 180 / pi;
}

TEST_F(Classics, normals_of_a_plane_are_its_own_up_to_grazing) {
    for (const double tilt : {0.0, 45.0, 80.0, 89.0}) {
        const DepthImage depth = seen(room_camera({120, 90}), plane(tilt));
        const cv::Mat3f normals = normals_of(depth);
        const cv::Vec3f truth(static_cast<float>(std::sin(tilt * pi / 180)), 0,
                              static_cast<float>(-std::cos(tilt * pi / 180)));
        for (int v = 0; v < 90; ++v)
            for (int u = 0; u < 120; ++u)
                if (depth.z_m(v, u) > 0) {
                    ASSERT_LT(degrees_between(normals(v, u), truth), 0.2) << tilt << " degrees, at " << u << ", " << v;
                }
    }
}

TEST_F(Classics, normals_stop_at_edges_and_lend_nothing_across) {
    // Two walls facing the camera, one metre apart in depth: every normal is (0, 0, -1), even next to the step.
    const DepthImage depth = seen(room_camera({64, 48}), [](double x, double) { return x < 0 ? 1.0 : 2.0; });
    for (const cv::Vec3f& n : normals_of(depth))
        ASSERT_LT(degrees_between(n, {0, 0, -1}), 0.01);
}

TEST_F(Classics, normals_are_absent_in_holes_and_only_there) {
    const DepthImage depth = with_holes(ball_on_floor(test_camera()), 0.3);
    const cv::Mat3f normals = normals_of(depth);
    for (int v = 0; v < depth.z_m.rows; ++v)
        for (int u = 0; u < depth.z_m.cols; ++u)
            ASSERT_NEAR(cv::norm(normals(v, u)), depth.z_m(v, u) > 0 ? 1 : 0, 1e-5) << u << ", " << v;
}

TEST_F(Classics, normals_between_holes_are_those_of_the_surface) {
    // Only every third column and row of a plane is left: no axis has a neighbour within two pixels.
    DepthImage depth = seen(room_camera({96, 72}), plane(40));
    for (int v = 0; v < 72; ++v)
        for (int u = 0; u < 96; ++u)
            if (u % 3 || v % 3)
                depth.z_m(v, u) = 0;
    const cv::Vec3f truth(static_cast<float>(std::sin(40 * pi / 180)), 0, static_cast<float>(-std::cos(40 * pi / 180)));
    const cv::Mat3f normals = normals_of(depth);
    for (int v = 0; v < 72; v += 3)
        for (int u = 0; u < 96; u += 3)
            ASSERT_LT(degrees_between(normals(v, u), truth), 0.5) << u << ", " << v;
}

TEST_F(Classics, a_wire_faces_the_camera) {
    // One pixel wide in front of a wall: there is no slope across, so the normal is perpendicular to the wire and faces
    // the camera.
    const DepthImage depth =
        seen(room_camera({65, 48}), [](double x, double) { return std::abs(x) < 0.5 / 525 ? 1.0 : 2.0; });
    const cv::Mat3f normals = normals_of(depth);
    for (int v = 4; v < 44; ++v)
        ASSERT_LT(degrees_between(normals(v, 32), {0, 0, -1}), 0.1) << v;
}

TEST_F(Classics, supplied_normals_are_kept_and_mended) {
    const DepthImage depth = seen(room_camera({32, 24}), plane(30));
    cv::Mat3f given(depth.z_m.size(), cv::Vec3f(0, 0, -2)); // too long, otherwise right
    given(3, 4) = {0, 0, 1};                                // turned away
    given(5, 6) = {0, 0, 0};
    given(7, 8) = {nan, 0, -1};
    const cv::Mat3f normals = normals_of(depth, given);
    const cv::Vec3f derived(0.5F, 0, static_cast<float>(-std::cos(pi / 6)));
    EXPECT_LT(degrees_between(normals(0, 0), {0, 0, -1}), 0.01);
    EXPECT_LT(degrees_between(normals(3, 4), {0, 0, -1}), 0.01);
    EXPECT_LT(degrees_between(normals(5, 6), derived), 0.1);
    EXPECT_LT(degrees_between(normals(7, 8), derived), 0.1);
    EXPECT_NEAR(cv::norm(normals(0, 0)), 1, 1e-5);
}

TEST_F(Classics, pixels_without_a_plane_join_one_within_three_sigma_and_else_face_the_camera) {
    // Differences of noisy depth tell no normal. Two sigma from the neighbours' plane a pixel is of that plane; half a
    // metre before it, a pixel is something of its own, and stays where it is.
    const DepthImage clean = seen(room_camera({32, 24}), plane(30));
    const cv::Vec3f plane_normal(0.5F, 0, static_cast<float>(-std::cos(pi / 6)));
    cv::Mat3f given(clean.z_m.size(), plane_normal);
    DepthImage depth{clean.camera, clean.z_m.clone(), {}};
    depth.z_m(5, 6) += 0.02F;
    depth.z_m(15, 20) -= 0.5F;
    given(5, 6) = given(15, 20) = {0, 0, 0};
    const cv::Mat4f surfaces = surfaces_of(depth, given, {.floor_m = 0.01});
    const auto normal_of = [&](int v, int u) {
        const cv::Vec4f& s = surfaces(v, u);
        return cv::Vec3f(s[0], s[1], s[2]);
    };
    EXPECT_NEAR(surfaces(5, 6)[3], clean.z_m(5, 6), 1e-4);
    EXPECT_LT(degrees_between(normal_of(5, 6), plane_normal), 0.1);
    EXPECT_EQ(surfaces(15, 20)[3], depth.z_m(15, 20));
    const Pinhole& camera = depth.camera;
    const cv::Vec3f to_camera(static_cast<float>((camera.cx - 20) / camera.fx),
                              static_cast<float>((camera.cy - 15) / camera.fy), -1);
    EXPECT_LT(degrees_between(normal_of(15, 20), to_camera), 0.1);
    EXPECT_EQ(surfaces(10, 10)[3], depth.z_m(10, 10)); // a pixel with a plane stays where its plane is
}

// ------------------------------------------------------------------------------------------------- denoise

cv::Mat1f denoised(const DepthImage& depth, const cv::Mat1f& raw, float strength = 1, float power = 1) {
    SharedPasses passes(depth.z_m.size(), false);
    passes.put(SharedPasses::depth, depth.z_m);
    passes.put(SharedPasses::raw, raw);
    ScreenOptions curve;
    curve.strength = strength;
    curve.power = power;
    const shared::ScreenConstants k = constants_from(curve, {depth});
    passes.program->run(std::as_bytes(std::span(&k, 1)));
    cv::Mat1f shown(raw.size());
    std::memcpy(shown.data, passes.program->host(SharedPasses::visibility).data(), shown.total() * 4);
    return shown;
}

TEST_F(Classics, denoise_is_a_5x5_mean_on_a_plane) {
    // At odd sizes, and whatever the slope: weights of pixels on one plane are all one.
    const DepthImage depth = seen(room_camera({37, 23}), plane(60));
    cv::Mat1f raw(depth.z_m.size());
    cv::randu(raw, 0, 1);
    cv::Mat1f mean, count;
    cv::boxFilter(raw, mean, CV_32F, {5, 5}, {-1, -1}, false, cv::BORDER_CONSTANT);
    cv::boxFilter(cv::Mat1f(raw.size(), 1.0F), count, CV_32F, {5, 5}, {-1, -1}, false, cv::BORDER_CONSTANT);
    cv::Mat difference;
    cv::absdiff(denoised(depth, raw), mean / count, difference);
    EXPECT_LT(cv::norm(difference, cv::NORM_INF), 1e-4);
}

TEST_F(Classics, denoise_keeps_a_step_at_a_depth_edge_and_at_a_crease) {
    const Surface step = [](double x, double) { return x < 0 ? 1.0 : 1.2; };
    const Surface crease = back_and_side;
    for (const Surface& surface : {step, crease}) {
        const DepthImage depth = seen(room_camera({400, 24}), surface);
        const int edge = [&] { // first column of the farther or the frontal part
            int u = 0;
            while (depth.z_m(0, u) < 1.9999F && !(u > 0 && depth.z_m(0, u) > depth.z_m(0, u - 1) + 0.1F))
                ++u;
            return u;
        }();
        cv::Mat1f raw(depth.z_m.size(), 0.2F);
        raw.colRange(edge, raw.cols) = 0.9F;
        cv::Mat difference;
        cv::absdiff(denoised(depth, raw), raw, difference);
        // The crease's own column may belong to either wall.
        difference.colRange(edge - 1, edge + 1) = 0;
        EXPECT_LT(cv::norm(difference, cv::NORM_INF), 1e-5);
    }
}

TEST_F(Classics, the_tone_curve_is_strength_then_power) {
    const DepthImage depth = seen(room_camera({16, 16}), plane(0));
    const auto shown = [&](float v, float strength, float power) {
        return denoised(depth, cv::Mat1f(16, 16, v), strength, power)(8, 8);
    };
    EXPECT_NEAR(shown(0.6F, 1, 1), 0.6, 1e-6);
    EXPECT_NEAR(shown(0.6F, 0.5F, 1), 0.8, 1e-6);
    EXPECT_NEAR(shown(0.6F, 1, 2), 0.36, 1e-4);
    EXPECT_NEAR(shown(0.4F, 2, 3), 0, 1e-6) << "clamped before the power";
    EXPECT_EQ(shown(1, 0.7F, 2.2F), 1) << "open stays open";
}

TEST_F(Classics, denoise_keeps_the_mean_of_a_smooth_surface) {
    const DepthImage depth = seen(room_camera(), sphere({0, 0, 1}, 1.4, true));
    for (const std::string& method : classics) {
        const double with = cv::mean(ao_of(method, depth).visibility)[0];
        const double without = cv::mean(ao_of(method, depth, {{"denoise", "false"}}).visibility)[0];
        EXPECT_NEAR(with, without, 0.002) << method;
    }
}

// ------------------------------------------------------------------------------------------------- holes

TEST_F(Classics, invalid_depth_is_a_hole) {
    DepthImage clean = ball_on_floor(test_camera()), dirty{clean.camera, clean.z_m.clone(), {}};
    const std::vector<float> sentinels{
        nan, std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(), -1.0F, 1e30F, -nan};
    for (int i = 0; i < 120; ++i) {
        const cv::Point at(i * 37 % 160, i);
        clean.z_m(at) = 0;
        dirty.z_m(at) = sentinels[static_cast<std::size_t>(i) % sentinels.size()];
    }
    for (const std::string& method : classics) {
        const AoMap one = ao_of(method, clean), two = ao_of(method, dirty);
        EXPECT_EQ(0, std::memcmp(one.visibility.data, two.visibility.data, one.visibility.total() * 4)) << method;
        EXPECT_TRUE(std::isnan(two.visibility(5, 5 * 37 % 160)));
    }
}

TEST_F(Classics, renormalised_corners_keep_their_darkness_among_holes) {
    // Methods that test points one by one lose occlusion with every unknown point. Measured near the corner's edge with
    // given normals, since holes affect normals, too.
    const Pinhole camera = test_camera({240, 180});
    const DepthImage corner = wall_corner(camera), holed = with_holes(corner, 0.35);
    const NormalImage normals{normals_of(corner)};
    const cv::Rect near(cvRound(camera.cx) - 20, 20, 40, 140);
    const cv::Mat known = holed.z_m(near) > 0;
    for (const char* method : {"luna", "hemisphere"}) {
        const auto mean = [&](const DepthImage& depth, const Settings& settings) {
            return cv::mean(ao_of(method, depth, settings, {}, &normals).visibility(near), known)[0];
        };
        const double whole = mean(corner, {}), open = mean(holed, {}),
                     renormalised = mean(holed, {{"renormalise", "true"}});
        EXPECT_GT(open, whole + 0.015) << method << ": unknown counts as open";
        EXPECT_NEAR(renormalised, whole, 0.4 * (open - whole)) << method;
    }
}

} // namespace
} // namespace scanshade
