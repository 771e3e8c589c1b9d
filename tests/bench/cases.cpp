#include "tests/bench/cases.h"

#include "apps/scenes/sensor.h"
#include "apps/scenes/shapes.h"
#include "apps/scenes/world/scene.h"

#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

namespace scanshade::hard_cases {
namespace {

using namespace scene;
using Eigen::Vector3d;

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
constexpr double degrees = std::numbers::pi / 180;

Pinhole lens(double field_of_view, cv::Size size = {160, 120}) {
    const double f = size.width / (2 * std::tan(field_of_view / 2 * degrees));
    return {f, f, 0.5 * (size.width - 1), 0.5 * (size.height - 1), size};
}

/// Bodies in camera space: exact depth, and ray-traced visibility.
Case traced(std::string name, const Pinhole& camera, std::vector<Body> bodies, double radius_m = 0.5) {
    const Scene scene{"hard case", "", std::move(bodies)};
    const World world(scene);
    const auto here = Eigen::Isometry3d::Identity();
    Case made{std::move(name), {camera, render_geometry(world, camera, here).z_m, {}}, {}, radius_m};
    made.expected = true_visibility(world, camera, here, {.radius_m = radius_m, .rays = 128}).visibility[0];
    made.expected.setTo(unknown, made.depth.z_m == 0);
    return made;
}

Case open_everywhere(std::string name, DepthImage depth, double radius_m = 0.5, DepthNoise noise = {}) {
    Case made{std::move(name), std::move(depth), {}, radius_m, noise};
    made.expected = cv::Mat1f(made.depth.z_m.size(), 1.0F);
    made.expected.setTo(unknown, made.depth.z_m == 0);
    return made;
}

Body plane(Vector3d point, const Vector3d& normal) { return {Plane{std::move(point), normal.normalized()}, {}}; }
Body ball(Vector3d centre, double radius) { return {Sphere{std::move(centre), radius}, {}}; }
Body box(Vector3d centre, Vector3d half) { return {Box{std::move(centre), std::move(half)}, {}}; }
Body rod(Vector3d base, const Vector3d& axis, double radius, double height) {
    return {Cylinder{std::move(base), radius, height, axis.normalized()}, {}};
}

std::vector<Body> corner_of_walls(double z_m = 2) {
    return {plane({0, 0, z_m}, {1, 0, -1}), plane({0, 0, z_m}, {-1, 0, -1})};
}

std::vector<Body> ball_on_floor() {
    return {plane({0, 1, 0}, {0, -1, 0}), plane({0, 0, 4}, {0, 0, -1}), ball({0.1, 0.7, 2.2}, 0.3)};
}

std::vector<Body> stairs() {
    std::vector<Body> steps{plane({0, 0, 6}, {0, 0, -1})};
    for (int i = 0; i < 8; ++i)
        steps.push_back(box({0, 1.0 - 0.17 * i + 1, 1.6 + 0.28 * i + 2}, {3, 1, 2}));
    return steps;
}

std::vector<Body> crevice() { // two blocks, 8 cm apart, before a wall
    return {plane({0, 0, 2.6}, {0, 0, -1}), box({-1.04, 0, 2.3}, {1, 2, 0.3}), box({1.04, 0, 2.3}, {1, 2, 0.3})};
}

std::vector<Body> grate() {
    std::vector<Body> bars{plane({0, 0, 2.5}, {0, 0, -1})};
    for (int i = -6; i <= 6; ++i) {
        bars.push_back(rod({0.15 * i, -2, 2}, {0, 1, 0}, 0.008, 4));
        bars.push_back(rod({-2, 0.15 * i, 2}, {1, 0, 0}, 0.008, 4));
    }
    return bars;
}

/// z = 2 + x^2 - y^2, in patches of 4 cm.
std::vector<Body> saddle() {
    std::vector<Body> patches;
    const auto at = [](int i, int j) {
        const double x = 0.04 * i, y = 0.04 * j;
        return Vector3d(x, y, 2 + x * x - y * y);
    };
    for (int i = -50; i < 50; ++i)
        for (int j = -40; j < 40; ++j) {
            patches.push_back({Triangle{at(i, j), at(i + 1, j), at(i + 1, j + 1)}, {}});
            patches.push_back({Triangle{at(i, j), at(i + 1, j + 1), at(i, j + 1)}, {}});
        }
    return patches;
}

/// Depth as a structured-light sensor writes it: noise correlated by its windows, then disparity steps.
DepthImage structured_light(const DepthImage& clean, unsigned seed) {
    cv::Mat1f white(clean.z_m.size()), correlated;
    std::mt19937 random(seed);
    std::normal_distribution<float> normal;
    for (float& value : white)
        value = normal(random);
    constexpr double deviation = 0.9; // of the window, pixels: a correlation length of 3.2
    cv::GaussianBlur(white, correlated, {9, 9}, deviation);
    correlated *= 2 * deviation * std::sqrt(std::numbers::pi);
    DepthImage noisy{clean.camera, clean.z_m.clone(), {}};
    for (int v = 0; v < white.rows; ++v)
        for (int u = 0; u < white.cols; ++u)
            if (float& z = noisy.z_m(v, u); z > 0) {
                const double measured = z + kinect_sigma_m(z) * static_cast<double>(correlated(v, u));
                z = static_cast<float>(
                    1 / (std::max(1.0, std::round(1 / (measured * kinect_step_per_m))) * kinect_step_per_m));
            }
    return noisy;
}

/// As `run` would measure it on a recording with such frames.
const DepthNoise& structured_light_noise() {
    static const DepthNoise noise = [] {
        std::vector<DepthImage> images;
        for (const double z_m : {0.8, 1.5, 2.5, 3.5})
            images.push_back(structured_light(shapes::tilted_plane(shapes::off_centre_camera({320, 240}), 40, z_m), 5));
        return measure_noise(images);
    }();
    return noise;
}

Case recorded(Case clean) {
    clean.depth = structured_light(clean.depth, 3);
    clean.noise = structured_light_noise();
    return clean;
}

template <class Keep>
DepthImage punched(const DepthImage& depth, Keep&& keep) {
    DepthImage holed{depth.camera, depth.z_m.clone(), {}};
    for (int v = 0; v < holed.z_m.rows; ++v)
        for (int u = 0; u < holed.z_m.cols; ++u)
            if (!keep(u, v))
                holed.z_m(v, u) = 0;
    return holed;
}

DepthImage random_holes(const DepthImage& depth, double share) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> even;
    return punched(depth, [&](int, int) { return even(random) >= share; });
}

// ---------------------------------------------------------------------------------------------------- families

/// Planes on which the radius covers two pixels or more.
std::vector<Case> planes(bool noisy) {
    std::vector<Case> all;
    const Pinhole camera = shapes::off_centre_camera();
    const std::vector<double> tilts =
        noisy ? std::vector<double>{0, 45, 60, 70} : std::vector<double>{0, 45, 70, 80, 85, 89};
    const std::vector<double> depths =
        noisy ? std::vector<double>{0.5, 1, 2, 3, 4} : std::vector<double>{0.3, 1, 5, 20, 50, 200};
    for (const double tilt : tilts)
        for (const double z_m : depths) {
            if (0.5 * camera.fx / z_m < 2)
                continue;
            Case one =
                open_everywhere(fmt::format("{} degrees, {} m", tilt, z_m), shapes::tilted_plane(camera, tilt, z_m));
            if (noisy) {
                one.depth.z_m.setTo(0, one.depth.z_m > 8); // structured light reaches no farther
                one.expected.setTo(unknown, one.depth.z_m == 0);
                one = recorded(std::move(one));
            }
            all.push_back(std::move(one));
        }
    return all;
}

std::vector<Case> shapes() {
    const Pinhole camera = shapes::off_centre_camera({320, 240});
    return {traced("corner", camera, corner_of_walls()), traced("ball on a floor", camera, ball_on_floor()),
            traced("saddle", camera, saddle()), traced("stairs", camera, stairs()),
            traced("crevice", camera, crevice())};
}

std::vector<Case> thin_things() {
    const Pinhole camera = shapes::off_centre_camera({320, 240});
    const double pixel_m = 2 / camera.fx;
    return {traced("pole of one pixel", camera,
                   {plane({0, 0, 2.2}, {0, 0, -1}), rod({0, -3, 2}, {0, 1, 0}, 0.5 * pixel_m, 6)}),
            traced("wires", camera,
                   {plane({0, 0, 2.5}, {0, 0, -1}), rod({-3, 0.1, 2}, {1, 0.2, 0}, 0.6 * pixel_m, 8),
                    rod({-3, -0.4, 1.7}, {1, -0.05, 0.1}, 0.6 * pixel_m, 8)}),
            traced("grate", camera, grate())};
}

std::vector<Case> steps_in_depth() {
    std::vector<Case> all;
    for (const double jump_m : {0.01, 0.1, 0.3, 1.0, 10.0, 100.0})
        all.push_back(traced(fmt::format("{} m", jump_m), shapes::off_centre_camera({320, 240}),
                             {plane({0, 0, 1.5 + jump_m}, {0, 0, -1}), box({-2, 0, 2}, {2, 4, 0.5})}));
    return all;
}

std::vector<Case> noisy_shapes() {
    std::vector<Case> all = shapes();
    for (Case& one : all)
        one = recorded(std::move(one));
    return all;
}

std::vector<Case> cameras() {
    Pinhole shifted = shapes::off_centre_camera({320, 240}), narrow = lens(65, {320, 240});
    shifted.cx = -60;
    narrow.fy *= 2;
    const Pinhole tele{20.0 * 160, 20.0 * 160, 79.5, 59.5, {160, 120}};
    return {traced("principal point outside", shifted,
                   {plane({1.2, 0, 2.4}, {1, 0, -1}), plane({1.2, 0, 2.4}, {-1, 0, -1})}),
            traced("fy = 2 fx", narrow, corner_of_walls()), traced("telephoto, fx = 20 W", tele, corner_of_walls(40)),
            traced("150 degrees", lens(150, {320, 240}), corner_of_walls(1))};
}

std::vector<Case> radii() {
    std::vector<Case> all;
    for (const double radius_m : {0.001, 0.02, 0.1, 2.0, 100.0})
        all.push_back(
            traced(fmt::format("{} m", radius_m), shapes::off_centre_camera({160, 120}), ball_on_floor(), radius_m));
    all.front().expected.setTo(1.0F, all.front().depth.z_m >
                                         0); // coordinates of a kilometre round too coarsely for rays to start so close
    all.back().expected.release();           // most occluders within 100 m are outside the image
    return all;
}

std::vector<Case> sizes() {
    std::vector<Case> all;
    for (const cv::Size size :
         {cv::Size{1, 1}, {1, 7}, {7, 1}, {3, 2}, {17, 1}, {641, 479}, {2000, 3}, {3, 2000}, {3840, 2160}}) {
        const double f = 0.8 * std::max(size.width, size.height);
        const Pinhole camera{f, f, 0.5 * size.width, 0.5 * size.height, size};
        Case one = open_everywhere(fmt::format("{}x{}", size.width, size.height), shapes::tilted_plane(camera, 30));
        if (std::min(size.width, size.height) < 2)
            one.expected.release(); // a line has no normal: any value is right, NaN too
        all.push_back(std::move(one));
    }
    return all;
}

std::vector<Case> no_depth() {
    const DepthImage ball = shapes::ball_on_floor(shapes::off_centre_camera());
    const float infinite = std::numeric_limits<float>::infinity();
    std::vector<Case> all;
    for (const float value : {unknown, infinite, -infinite, -1.0F, 1e-40F, 0.0F}) {
        DepthImage sprinkled{ball.camera, ball.z_m.clone(), {}};
        for (int i = 0; i < 120; ++i)
            sprinkled.z_m(i, i * 37 % 160) = value;
        all.push_back({fmt::format("{}", value), sprinkled, {}, 0.5});
    }
    DepthImage sentinel{ball.camera, ball.z_m.clone(), {}};
    sentinel.z_m.colRange(60, 80).setTo(65.535F); // the sentinel of 16-bit millimetres, read as metres
    all.push_back({"65535 taken for depth", sentinel, {}, 0.5});
    const DepthImage none{ball.camera, cv::Mat1f(ball.z_m.size(), 0.0F), {}};
    all.push_back({"all holes", none, {}, 0.5});
    DepthImage one{ball.camera, none.z_m.clone(), {}};
    one.z_m(60, 80) = 2;
    all.push_back({"one pixel", one, {}, 0.5});
    return all;
}

/// Three scenes, each paired with copies that have holes. `punch` hands every copy of a depth image to its second
/// argument, with the kind of its holes.
using AddHoled = std::function<void(const std::string& kind, DepthImage holed)>;
std::vector<std::pair<Case, Case>>
paired_with_holed(const std::function<void(const DepthImage&, const AddHoled&)>& punch) {
    std::vector<std::pair<Case, Case>> all;
    for (const auto& [name, bodies] :
         {std::pair{"corner", corner_of_walls()}, {"ball", ball_on_floor()}, {"stairs", stairs()}}) {
        const Case whole = traced(name, shapes::off_centre_camera({320, 240}), bodies);
        punch(whole.depth, [&, scene = name](const std::string& kind, DepthImage holed) {
            all.emplace_back(whole, Case{fmt::format("{}, {}", scene, kind), std::move(holed), {}, 0.5});
        });
    }
    return all;
}

std::vector<std::pair<Case, Case>> holes() {
    return paired_with_holed([](const DepthImage& depth, const AddHoled& add) {
        for (const double share : {0.05, 0.3})
            add(fmt::format("{:.0f} % random", 100 * share), random_holes(depth, share));
    });
}

std::vector<std::pair<Case, Case>> worse_holes() {
    return paired_with_holed([](const DepthImage& depth, const AddHoled& add) {
        add("60 % random", random_holes(depth, 0.6));
        add("30 % in blocks", shapes::with_holes(depth, 0.3));
        add("checkerboard", punched(depth, [](int u, int v) { return (u + v) % 2 == 0; }));
        add("every third column", punched(depth, [](int u, int) { return u % 3 != 0; }));
        add("every fourth row", punched(depth, [](int, int v) { return v % 4 != 0; }));
    });
}

std::vector<std::pair<Case, Case>> units() {
    std::vector<std::pair<Case, Case>> all;
    const DepthImage metres = shapes::ball_on_floor(shapes::off_centre_camera({320, 240}));
    for (const double scale : {0.01, 0.1, 10.0, 100.0})
        all.emplace_back(
            Case{"metres", metres, {}, 0.5},
            Case{fmt::format("times {}", scale), {metres.camera, cv::Mat1f(metres.z_m * scale), {}}, {}, 0.5 * scale});
    return all;
}

/// The same corner from 0.2 to 200 m away, radius to match, through a normal, a long and a wide lens: the error of
/// single precision. A fifth of a step of 8 bits is the bound.
std::vector<std::pair<Case, Case>> precision() {
    std::vector<std::pair<Case, Case>> all;
    const Pinhole tele{20.0 * 160, 20.0 * 160, 79.5, 59.5, {160, 120}};
    for (const auto& [name, camera, z_m] : {std::tuple{"normal lens", shapes::off_centre_camera({160, 120}), 2.0},
                                            {"fx = 20 W", tele, 40.0},
                                            {"150 degrees", lens(150), 1.0}}) {
        const Scene scene{"corner", "", corner_of_walls(z_m)};
        const cv::Mat1f z = render_geometry(World(scene), camera, Eigen::Isometry3d::Identity()).z_m;
        for (const double away_m : {0.2, 2.0, 20.0, 200.0}) {
            const double scale = away_m / z_m;
            all.emplace_back(
                Case{name, {camera, z, {}}, {}, 0.5},
                Case{fmt::format("{}, {} m", name, away_m), {camera, cv::Mat1f(z * scale), {}}, {}, 0.5 * scale});
        }
    }
    return all;
}

/// Depths between two surfaces, as time of flight reads them at outlines, and the same view without them.
std::vector<std::pair<Case, Case>> flying_pixels() {
    std::vector<std::pair<Case, Case>> all;
    const DepthNoise tof{0.001, 0.0006};
    for (const double gap_m : {0.1, 0.3, 1.0}) {
        const Case clean = traced(fmt::format("{} m", gap_m), shapes::off_centre_camera({320, 240}),
                                  {plane({0, 0, 1.5 + gap_m}, {0, 0, -1}), box({0, 0, 1.6}, {0.4, 0.3, 0.1})});
        Case flown = clean, quiet = clean;
        flown.noise = quiet.noise = tof;
        std::mt19937 random(9);
        std::uniform_real_distribution<float> even;
        const cv::Mat1f& z = clean.depth.z_m;
        flown.depth.z_m = z.clone();
        for (int v = 1; v + 1 < z.rows; ++v)
            for (int u = 1; u + 1 < z.cols; ++u) {
                const auto [low, high] = std::minmax({z(v, u - 1), z(v, u + 1), z(v - 1, u), z(v + 1, u)});
                if (high - low > 0.05F && even(random) < 0.6F)
                    flown.depth.z_m(v, u) = low + (high - low) * even(random);
            }
        all.emplace_back(std::move(quiet), std::move(flown));
    }
    return all;
}

} // namespace

const std::vector<Family>& families() {
    static const std::vector<Family> all{
        {"planes",
         "0 .. 89 degrees, 0.3 .. 200 m, radius of two pixels and more",
         {.least = 0.9, .mean = 0.98},
         [] { return planes(false); }},
        {"planes, structured light",
         "0 .. 70 degrees, 0.5 .. 4 m, noise and disparity steps",
         {.mean = 0.95},
         [] { return planes(true); }},
        {"shapes", "corner, ball, saddle, stairs, crevice", {}, shapes},
        {"shapes, structured light", "the same with noise and disparity steps", {}, noisy_shapes},
        {"thin things", "a pole and wires of one pixel, a grate", {}, thin_things},
        {"steps in depth", "1 cm .. 100 m", {}, steps_in_depth},
        {"holes up to 30 %", "against the same view without", {.rmse = 0.02}, {}, holes},
        {"more holes", "60 %, blocks, checkerboard, stripes", {}, {}, worse_holes},
        {"flying pixels", "against the same view without", {}, {}, flying_pixels},
        {"cameras", "principal point outside, oblong pixels, telephoto, 150 degrees", {}, cameras},
        {"radii", "1 mm .. 100 m", {}, radii},
        {"units", "scene and radius times 0.01 .. 100", {.rmse = 1.0 / 255}, {}, units},
        {"precision",
         "0.2 .. 200 m, fx = 20 W and 150 degrees, against another distance",
         {.rmse = 0.2 / 255},
         {},
         precision},
        {"sizes", "1x1 .. 3840x2160, lines", {.least = 0.9, .mean = 0.98}, sizes},
        {"no depth", "NaN, infinities, negative, denormal, sentinels, nothing", {}, no_depth},
    };
    return all;
}

} // namespace scanshade::hard_cases
