// The classic methods compared with closed forms of visibility and with their own equations. The laws of all methods
// are in method_test.
#include "ao/base/method.h"
#include "ao/gpu/device.h"
#include "ao/gpu/program.h"
#include "ao/screen/noise.h"
#include "ao/screen/screen.h"
#include "projection/base/error.h"
#include "shaders/shared/screen.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <set>

namespace scanshade {
namespace {

using namespace tests;

constexpr double pi = std::numbers::pi;
constexpr float nan = std::numeric_limits<float>::quiet_NaN();

gpu::Device& device() {
    static gpu::Device opened;
    return opened;
}

using Settings = std::vector<std::pair<std::string, std::string>>;

/// A method with settings, made once, since pipelines take long to compile.
Method& method_with(const std::string& method, const Settings& settings) {
    static gpu::Device& opened = device(); // opened before the methods, destroyed after them
    static std::map<std::pair<std::string, Settings>, std::unique_ptr<Method>> made;
    auto& one = made[{method, settings}];
    if (!one) {
        const auto setup = method_named(method).setup();
        for (Parameter& row : setup->parameters())
            for (const auto& [name, value] : settings)
                if (row.name == name)
                    set(row, value);
        one = setup->make(opened);
    }
    return *one;
}

AoMap ao_of(const std::string& method, const DepthImage& depth, const Settings& settings = {}, DepthNoise noise = {},
            const NormalImage* normals = nullptr) {
    return method_with(method, settings).compute({normals ? Surfaces(depth, *normals) : Surfaces(depth), noise});
}

class Classics : public testing::Test {
  protected:
    void TearDown() override {
        for (const std::string& message : device().validation_messages())
            ADD_FAILURE() << message;
    }
};

const std::vector<std::string> classics{"luna", "hemisphere", "hbao", "gtao", "bitmask"};
const std::vector<std::string> slice_methods{"gtao", "bitmask"};

// ------------------------------------------------------------------------------------------------- scenes by formula

/// z of the surface along the ray (x, y, 1), 0 for none.
using Surface = std::function<double(double x, double y)>;

/// A camera whose disc of 0.5 m at 2 m (131 pixels) lies in the image.
Pinhole room_camera(cv::Size size = {360, 300}, double f = 525) {
    return {f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0, size};
}

DepthImage seen(const Pinhole& camera, const Surface& surface) {
    DepthImage depth{camera, cv::Mat1f(camera.size), {}};
    for (int v = 0; v < camera.size.height; ++v)
        for (int u = 0; u < camera.size.width; ++u)
            depth.z_m(v, u) = static_cast<float>(surface(camera.ray(u, v).x(), camera.ray(u, v).y()));
    return depth;
}

/// A plane through (0, 0, z), turned about the vertical axis by `tilt` degrees; nothing beyond 100 z.
Surface plane(double tilt, double z = 2) {
    return [=](double x, double) {
        const double s = std::sin(tilt * pi / 180), c = std::cos(tilt * pi / 180);
        const double along = c - s * x;
        return along > 0.01 * c ? z * c / along : 0.0;
    };
}

/// Back wall 2 m away, side wall 0.4 m to the left, coming towards the camera.
double back_and_side(double x, double) { return x < 0 ? std::min(2.0, 0.4 / -x) : 2.0; }

/// A sphere's nearer side (outside) or farther side (inside), 0 where it is missed.
Surface sphere(const cv::Vec3d& centre, double radius, bool inside) {
    return [=](double x, double y) {
        const cv::Vec3d ray(x, y, 1);
        const double a = ray.dot(ray), b = ray.dot(centre), c = centre.dot(centre) - radius * radius,
                     root = b * b - a * c;
        return root < 0 ? 0.0 : (b + (inside ? 1 : -1) * std::sqrt(root)) / a;
    };
}

/// Mean over rows of the middle, without holes.
double column_mean(const cv::Mat1f& v, int u, int half_height = 40) {
    return cv::mean(v(cv::Rect(u, v.rows / 2 - half_height, 1, 2 * half_height)))[0];
}

double lowest(const cv::Mat1f& v) {
    double low = 0;
    const cv::Mat known = v == v; // NOLINT(misc-redundant-expression): false for NaN
    cv::minMaxLoc(v, &low, nullptr, nullptr, nullptr, known);
    return low;
}

/// Visibility on a plane at distance d from an endless perpendicular wall, occluders up to R.
double beside_wall(double d, double radius) {
    const double c = std::min(d / radius, 1.0);
    return 1 - (std::acos(c) - c * std::sqrt(1 - c * c)) / pi;
}

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

// ------------------------------------------------------------------------------------------------- planes

TEST_F(Classics, planes_are_open_at_every_tilt) {
    // The reason for rule (2): pixels are next to the marched line, and on a slope some are above it.
    for (const std::string& method : classics)
        for (const double tilt : {0.0, 45.0, 60.0, 80.0, 85.0, 89.0})
            EXPECT_GE(lowest(ao_of(method, seen(room_camera({200, 150}), plane(tilt))).visibility), 0.999)
                << method << ", " << tilt;
}

TEST_F(Classics, planes_are_open_from_centimetres_to_where_the_radius_is_below_a_pixel) {
    for (const std::string& method : classics) {
        for (const double z : {0.02, 0.3, 50.0})
            EXPECT_GE(lowest(ao_of(method, seen(room_camera({200, 150}), plane(60, z))).visibility), 0.999)
                << method << ", " << z << " m";
        const AoMap far = ao_of(method, seen(room_camera({200, 150}), plane(0, 500)));
        EXPECT_EQ(lowest(far.visibility), 1) << method;
    }
}

TEST_F(Classics, planes_are_open_through_any_lens) {
    Pinhole wide = room_camera({300, 200}, 100), tele = room_camera({200, 150}, 20000),
            shifted = room_camera({200, 150});
    shifted.cx = 300;
    for (const std::string& method : classics)
        for (const Pinhole& camera : {wide, tele, shifted})
            EXPECT_GE(lowest(ao_of(method, seen(camera, plane(45))).visibility), 0.995)
                << method << ", f " << camera.fx;
}

TEST_F(Classics, quantised_planes_are_open_where_the_noise_is_given) {
    // Disparity steps of 2.85 mm z^2: 11 mm at 2 m. The step is given as sigma; normals are those of the plane.
    for (const auto& [tilt, z] : {std::pair{45.0, 2.0}, {60.0, 5.0}}) {
        DepthImage depth = seen(room_camera({300, 200}), plane(tilt, z));
        for (float& d : depth.z_m)
            if (d > 0)
                d = static_cast<float>(1 / (std::round(1 / (d * 2.85e-3)) * 2.85e-3));
        const double t = tilt * pi / 180;
        const NormalImage normals{cv::Mat3f(
            depth.z_m.size(), cv::Vec3f(static_cast<float>(std::sin(t)), 0, static_cast<float>(-std::cos(t))))};
        for (const std::string& method : classics) {
            const auto inner = [&](const cv::Mat1f& v) { return cv::mean(v(cv::Rect(60, 40, 180, 120)))[0]; };
            EXPECT_GE(inner(ao_of(method, depth, {}, {0, 2.85e-3}, &normals).visibility), 0.995)
                << method << ", " << tilt;
            if (method == "gtao") {
                EXPECT_LT(inner(ao_of(method, depth, {}, {}, &normals).visibility), 0.93)
                    << "untold, the steps are walls";
            }
        }
    }
}

// ------------------------------------------------------------------------------------------------- corners

struct Corner {
    double back, side, symmetric; ///< visibility 0.125 m from the edge, R = 0.5 m
};

Corner corner_of(const std::string& method, const Settings& settings) {
    const Pinhole camera = room_camera({400, 320});
    const DepthImage room = seen(camera, back_and_side);
    const cv::Mat1f v = ao_of(method, room, settings).visibility;
    const auto column_at = [&](double x, double z) { return static_cast<int>(std::lround(525 * x / z + camera.cx)); };
    const DepthImage edge = seen(camera, [](double x, double) { return 2 / (1 + std::abs(x)); });
    const cv::Mat1f w = ao_of(method, edge, settings).visibility;
    const double along = 0.125 * std::numbers::sqrt2 / 2;
    return {column_mean(v, column_at(-0.4 + 0.125, 2)), column_mean(v, column_at(-0.4, 2 - 0.125)),
            column_mean(w, column_at(along, 2 - along))};
}

void expect_corner(const std::string& method, const Settings& settings, Corner expected, double tolerance) {
    const Corner found = corner_of(method, settings);
    EXPECT_NEAR(found.back, expected.back, tolerance) << method;
    EXPECT_NEAR(found.side, expected.side, tolerance) << method;
    EXPECT_NEAR(found.symmetric, expected.symmetric, tolerance) << method;
}

TEST_F(Classics, a_right_angle_is_as_dark_as_the_closed_form_says) {
    // 0.657; occluders missed between finite steps make the result brighter.
    const double truth = beside_wall(0.125, 0.5);
    EXPECT_NEAR(truth, 0.6575, 0.0001);
    expect_corner("gtao", {{"quality", "highest"}}, {truth + 0.01, truth + 0.01, truth + 0.01}, 0.02);
    expect_corner("bitmask", {{"quality", "highest"}, {"thickness", "0.2"}}, {0.70, 0.68, 0.67}, 0.03);
}

TEST_F(Classics, the_corner_of_each_method_is_its_own) {
    // Obscurance is not visibility: these values follow from each method's equations, by independent prototypes.
    // Nothing occludes a side wall in Luna's method, a known defect: all its occluders are behind in z.
    expect_corner("hbao", {{"directions", "16"}, {"steps", "8"}, {"bias", "10"}, {"attenuated", "true"}},
                  {0.83, 0.82, 0.79}, 0.03);
    expect_corner("luna", {{"quality", "highest"}}, {0.91, 1.0, 0.76}, 0.05);
    expect_corner("hemisphere", {{"quality", "high"}}, {0.92, 0.85, 0.85}, 0.03);
}

TEST_F(Classics, a_bitmask_without_an_end_to_thickness_is_gtao) {
    const DepthImage depth = ball_on_floor(test_camera({240, 180}));
    for (const char* quality : {"medium", "highest"}) {
        const cv::Mat1f solid = ao_of("gtao", depth, {{"quality", quality}}).visibility;
        const cv::Mat1f thick = ao_of("bitmask", depth, {{"quality", quality}, {"thickness", "1000000"}}).visibility;
        EXPECT_NEAR(cv::mean(solid)[0], cv::mean(thick)[0], 0.005) << quality;
        cv::Mat difference;
        cv::absdiff(solid, thick, difference);
        EXPECT_LT(cv::mean(difference)[0], 0.01) << quality;
    }
}

TEST_F(Classics, telephoto_lenses_lose_no_bits) {
    // The same corner from 80 m through f = 20000 px: 125 pixels to 0.5 m.
    const Pinhole camera = room_camera({400, 320}, 20000);
    const DepthImage edge = seen(camera, [](double x, double) { return 80 / (1 + std::abs(x)); });
    const cv::Mat1f v = ao_of("gtao", edge, {{"quality", "highest"}}).visibility;
    const double along = 0.125 * std::numbers::sqrt2 / 2;
    EXPECT_NEAR(column_mean(v, static_cast<int>(std::lround(20000 * along / 80 + camera.cx))),
                beside_wall(0.125, 0.5) + 0.01, 0.02);
}

// ------------------------------------------------------------------------------------------------- other shapes

TEST_F(Classics, convex_shapes_are_open) {
    // From outside, no part of a sphere rises above its tangent planes. With exact normals this holds everywhere, with
    // normals from pixels except at the rim, where a pixel spans many degrees.
    const Pinhole camera = room_camera({200, 200});
    const DepthImage ball = seen(camera, sphere({0, 0, 2}, 0.25, false));
    NormalImage normals{cv::Mat3f(ball.z_m.size(), cv::Vec3f())};
    for (int v = 0; v < ball.z_m.rows; ++v)
        for (int u = 0; u < ball.z_m.cols; ++u) {
            const Eigen::Vector3d point = camera.point(u, v, ball.z_m(v, u));
            normals.normals(v, u) = cv::Vec3d(point.x(), point.y(), point.z() - 2) * 4;
        }
    for (const std::string& method : classics) {
        EXPECT_GE(lowest(ao_of(method, ball, {}, {}, &normals).visibility), 0.99) << method;
        const cv::Mat1f derived = ao_of(method, ball).visibility;
        EXPECT_GE(lowest(derived), 0.96) << method;
        EXPECT_GE(cv::mean(derived, derived == derived)[0], 0.998) << method;
    }
}

TEST_F(Classics, a_bowl_is_half_open_everywhere) {
    // Hemispherical, R beyond its size: the open share is one half everywhere in the bowl.
    const Pinhole camera = room_camera({300, 300});
    const Surface ball = sphere({0, 0, 2}, 0.5, true);
    const DepthImage bowl = seen(camera, [&](double x, double y) { // the half away from the camera, in a plane
        const double z = ball(x, y);
        return z > 2 ? z : 2.0;
    });
    for (const std::string& method : slice_methods) {
        const cv::Mat1f v =
            ao_of(method, bowl, {{"quality", "highest"}, {"radius", "1"}, {"thickness", "0.1"}}).visibility;
        for (const double part : {0.0, 0.3, 0.6}) {
            const int u = static_cast<int>(std::lround(camera.cx + part * 131 * 0.85)), c = 149;
            EXPECT_NEAR(cv::mean(v(cv::Rect(u - 4, c - 4, 9, 9)))[0], 0.535, 0.03) << method << " at " << part;
        }
    }
}

TEST_F(Classics, inside_a_sphere_the_open_share_is_known) {
    // 1 - R^2 / 4 r^2 = 0.96, its disc in view.
    const DepthImage depth = seen(room_camera({400, 400}), sphere({0, 0, 1}, 1, true));
    for (const std::string& method : slice_methods) {
        const cv::Mat1f v = ao_of(method, depth, {{"quality", "highest"}, {"radius", "0.4"}}).visibility;
        EXPECT_NEAR(cv::mean(v(cv::Rect(190, 190, 20, 20)))[0], 0.965, 0.01) << method;
    }
}

TEST_F(Classics, objects_farther_in_front_than_the_radius_cast_no_halo) {
    const DepthImage jump = seen(room_camera({200, 150}), [](double x, double) { return x < 0 ? 1.0 : 3.0; });
    for (const std::string& method : classics)
        EXPECT_GE(lowest(ao_of(method, jump).visibility), 0.9999) << method;
}

TEST_F(Classics, beside_a_step_thickness_decides) {
    // 1.0 to 1.3 m, five pixels from the step on its far side. A solid step gives 0.53, a sheet 0.70.
    const Pinhole camera = room_camera({600, 400});
    const DepthImage step = seen(camera, [](double x, double) { return x < 0 ? 1.0 : 1.3; });
    const auto beside = [&](const std::string& method, Settings settings) {
        settings.emplace_back("quality", "highest");
        return column_mean(ao_of(method, step, settings).visibility, 305);
    };
    EXPECT_NEAR(beside("gtao", {}), 0.53, 0.03);
    EXPECT_NEAR(beside("bitmask", {{"thickness", "0.2"}}), 0.62, 0.03);
    EXPECT_NEAR(beside("hemisphere", {}), 0.607, 0.05);
    EXPECT_NEAR(beside("hbao", {{"bias", "10"}, {"attenuated", "true"}}), 0.75, 0.05);
    EXPECT_NEAR(beside("luna", {}), 0.71, 0.06);
}

TEST_F(Classics, light_passes_behind_a_thin_pole_of_a_bitmask) {
    // One pixel wide, 0.2 m in front of a wall at 2 m; three pixels from it the truth is 0.99.
    const Pinhole camera = room_camera({361, 300});
    const DepthImage pole = seen(camera, [](double x, double) { return std::abs(x) < 0.5 / 525 ? 1.8 : 2.0; });
    const auto beside = [&](const std::string& method, const Settings& settings) {
        return column_mean(ao_of(method, pole, settings).visibility, 183);
    };
    EXPECT_NEAR(beside("bitmask", {{"quality", "highest"}, {"thickness", "0.2"}}), 0.975, 0.03);
    EXPECT_LT(beside("gtao", {{"quality", "highest"}}), 0.75) << "an endless wall to a heightfield";
    EXPECT_NEAR(beside("luna", {{"quality", "highest"}}), 0.995, 0.03);
    EXPECT_NEAR(beside("hemisphere", {{"quality", "highest"}}), 0.977, 0.03);
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

// ------------------------------------------------------------------------------------------------- symmetries

TEST_F(Classics, scene_radius_and_noise_scale_together) {
    DepthImage depth = ball_on_floor(test_camera());
    for (const std::string& method : classics) {
        const cv::Mat1f small = ao_of(method, depth, {{"radius", "0.5"}}, {0.001, 0}).visibility;
        DepthImage large{depth.camera, depth.z_m.clone(), {}};
        large.z_m *= 8;
        const cv::Mat1f big = ao_of(method, large, {{"radius", "4"}}, {0.008, 0}).visibility;
        cv::Mat difference;
        cv::absdiff(small, big, difference);
        EXPECT_LT(cv::mean(difference)[0], 1e-4) << method << ": an absolute length is left in it";
    }
}

TEST_F(Classics, a_mirrored_scene_gives_the_mirrored_answer) {
    const DepthImage depth = ball_on_floor(test_camera());
    DepthImage mirrored{depth.camera, {}, {}};
    cv::flip(depth.z_m, mirrored.z_m, 1);
    mirrored.camera.cx = depth.z_m.cols - 1 - depth.camera.cx;
    for (const std::string& method : classics) {
        const Settings many{{"quality", "highest"}};
        const cv::Mat1f one = ao_of(method, depth, many).visibility;
        cv::Mat1f two;
        cv::flip(ao_of(method, mirrored, many).visibility, two, 1);
        cv::Mat difference;
        cv::absdiff(one, two, difference);
        EXPECT_LT(cv::mean(difference)[0], 0.01) << method;
        EXPECT_NEAR(cv::mean(one)[0], cv::mean(two)[0], 0.001) << method << " prefers a direction";
    }
}

TEST_F(Classics, pixels_need_not_be_square) {
    const Pinhole square = room_camera({240, 240}, 260), flat = {520, 260, 239.5, 119.5, {480, 240}};
    const Surface corner = [](double x, double y) { return 2 / (1 + std::abs(x + 0.3 * y)); };
    for (const std::string& method : classics) {
        const Settings many{{"quality", "highest"}};
        const cv::Mat1f one = ao_of(method, seen(square, corner), many).visibility;
        cv::Mat1f two;
        cv::resize(ao_of(method, seen(flat, corner), many).visibility, two, one.size(), 0, 0, cv::INTER_AREA);
        cv::Mat difference;
        cv::absdiff(one, two, difference);
        EXPECT_LT(cv::mean(difference)[0], 0.012) << method;
    }
}

TEST_F(Classics, a_crop_knows_what_the_whole_knew) {
    const DepthImage whole = ball_on_floor(test_camera({320, 240}));
    const cv::Rect cut(64, 64, 193, 131); // multiples of the noise table's size, odd size
    DepthImage crop{whole.camera, whole.z_m(cut).clone(), {}};
    crop.camera.size = cut.size();
    crop.camera.cx -= cut.x;
    crop.camera.cy -= cut.y;
    for (const std::string& method : classics) {
        const cv::Mat1f one = ao_of(method, whole, {{"radius", "0.1"}}).visibility(cut),
                        two = ao_of(method, crop, {{"radius", "0.1"}}).visibility;
        const cv::Rect inner(40, 40, 193 - 80, 131 - 80);
        EXPECT_LT(cv::norm(one(inner), two(inner), cv::NORM_INF), 1e-3) << method;
    }
}

TEST_F(Classics, noise_falls_with_the_root_of_the_slices) {
    // The spread over seeds, before denoise. Slices are stratified, so it falls at least as fast.
    const DepthImage corner = wall_corner(test_camera({120, 90}));
    const auto spread = [&](const std::string& slices) {
        cv::Mat1d sum(corner.z_m.size(), 0.0), squares(corner.z_m.size(), 0.0);
        constexpr int seeds = 12;
        for (int seed = 0; seed < seeds; ++seed) {
            cv::Mat1d v;
            ao_of("gtao", corner,
                  {{"slices", slices}, {"steps", "8"}, {"seed", std::to_string(seed)}, {"denoise", "false"}})
                .visibility.convertTo(v, CV_64F);
            sum += v;
            squares += v.mul(v);
        }
        cv::Mat1d variance;
        cv::subtract(squares / seeds, sum.mul(sum) / (seeds * seeds), variance);
        return std::sqrt(cv::mean(variance)[0]);
    };
    EXPECT_LT(spread("16"), 0.65 * spread("4"));
}

// ------------------------------------------------------------------------------------------------- doors

TEST_F(Classics, a_radius_of_nothing_is_refused_by_name) {
    for (const std::string& method : classics)
        EXPECT_TRUE(says(refusal([&] {
                             (void)ao_of(method, seen(room_camera({8, 8}), plane(0)), {{"radius", "0"}});
                         }),
                         "radius"))
            << method;
}

TEST_F(Classics, sizes_that_do_not_fit_are_refused) {
    const DepthImage depth = seen(room_camera({8, 8}), plane(0));
    const NormalImage normals{cv::Mat3f(4, 8)};
    DepthImage other{room_camera({9, 8}), depth.z_m, {}};
    EXPECT_TRUE(says(refusal([&] { (void)ao_of("gtao", depth, {}, {}, &normals); }), "8x4"));
    EXPECT_TRUE(says(refusal([&] { (void)ao_of("gtao", other); }), "9x8"));
}

TEST_F(Classics, published_profiles_run_and_differ) {
    const DepthImage depth = ball_on_floor(test_camera());
    for (const auto& [method, profile] : {std::pair<std::string, std::string>{"luna", "published"},
                                          {"hemisphere", "published"},
                                          {"hbao", "published"},
                                          {"gtao", "xegtao"}}) {
        const cv::Mat1f v = ao_of(method, depth, {{"profile", profile}}).visibility;
        EXPECT_TRUE(cv::checkRange(v, true, nullptr, 0.0, 1.0 + 1e-6)) << method;
        EXPECT_GT(cv::norm(v, ao_of(method, depth).visibility, cv::NORM_L1) / static_cast<double>(v.total()), 0.005)
            << method;
    }
}

TEST_F(Classics, the_published_hemisphere_darkens_slopes_and_ours_does_not) {
    const DepthImage slope = seen(room_camera({200, 150}), plane(45));
    EXPECT_NEAR(cv::mean(ao_of("hemisphere", slope, {{"profile", "published"}, {"quality", "high"}}).visibility)[0],
                0.88, 0.05);
    EXPECT_GE(lowest(ao_of("hemisphere", slope).visibility), 0.999);
}

TEST_F(Classics, blurs_do_not_cross_a_depth_edge) {
    const DepthImage step = seen(room_camera({200, 100}), [](double x, double) { return x < 0 ? 1.0 : 1.3; });
    for (const char* method : {"luna", "hemisphere"}) {
        const cv::Mat1f near = ao_of(method, step, {{"blurs", "4"}}).visibility.colRange(0, 100);
        EXPECT_GE(lowest(near), 0.999) << method << ": the near side is open, however dark the far side";
    }
}

} // namespace
} // namespace scanshade
