// Generated captures: the truth is true, the sensors err as stated, and the same options give the same bytes.
#include "apps/scenes/generate.h"

#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "io/captures/capture.h"
#include "projection/base/error.h"
#include "projection/project.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"
#include "tests/support/small_capture.h"

#include <gtest/gtest.h>
#include <map>
#include <numbers>
#include <set>
#include <tbb/global_control.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using scene::Body, scene::Box, scene::Cylinder, scene::Plane, scene::Scene, scene::Sphere;
using tests::refusal, tests::says, tests::TemporaryFolder, tests::test_camera;

Scene scene_of(std::vector<Body> bodies) { return {.name = "test", .summary = "", .bodies = std::move(bodies)}; }

// ---------------------------------------------------------------------------------------------------- geometry

TEST(Scene, DepthOfAWallIsTheDistanceToItsPlaneNotTheRaysLength) {
    // World: z up, the camera at the origin looks along y at a wall 2.5 m away.
    const Scene room = scene_of({{Box{{0, 3, 0}, {10, 0.5, 10}}, {}}});
    const auto exact = render_geometry(scene::World(room), test_camera(), scene::looking_at({0, 0, 0}, {0, 1, 0}));
    for (const float z : exact.z_m)
        ASSERT_FLOAT_EQ(z, 2.5F);
    for (const auto& n : exact.normals)
        ASSERT_NEAR(cv::norm(n - cv::Vec3f(0, 0, -1)), 0, 1e-6) << "facing the camera";
}

TEST(Scene, RaysHitEverySolidWhereItsFormulaSays) {
    const auto t = [](const scene::Solid& solid, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
        return scene::cast({{solid, {}}}, {origin, direction}).t;
    };
    EXPECT_DOUBLE_EQ(t(Plane{{0, 0, 1}, {0, 0, 1}}, {0, 0, 3}, {0, 0, -1}), 2);
    EXPECT_DOUBLE_EQ(t(Sphere{{0, 5, 0}, 1}, {0, 0, 0}, {0, 1, 0}), 4);
    EXPECT_DOUBLE_EQ(t(Sphere{{0, 5, 0}, 1}, {0, 5, 0}, {0, 1, 0}), 1) << "from inside";
    EXPECT_DOUBLE_EQ(t(Cylinder{{0, 5, -1}, 1, 2}, {0, 0, 0}, {0, 1, 0}), 4) << "its side";
    EXPECT_DOUBLE_EQ(t(Cylinder{{0, 5, -1}, 1, 2}, {0.5, 5, 3}, {0, 0, -1}), 2) << "its upper end";
    EXPECT_DOUBLE_EQ(t(Cylinder{{0, 5, -1}, 1, 2}, {0, 5, 0}, {0, 1, 0}), 1) << "from inside";
    EXPECT_DOUBLE_EQ(t(Box{{0, 5, 0}, {1, 1, 1}}, {0, 5, 0}, {0, 0, 1}), 1) << "from inside";
    const double s = std::numbers::sqrt2;
    const auto diagonal = Eigen::AngleAxisd(std::numbers::pi / 4, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    EXPECT_NEAR(t(Box{{0, 5, 0}, {1, 1, 1}, diagonal}, {0, 0, 0}, {0, 1, 0}), 5 - s, 1e-12) << "turned: its edge";
    EXPECT_TRUE(std::isinf(t(Box{{0, 5, 0}, {1, 1, 1}}, {0, 0, 1.01}, {0, 1, 0}))) << "just above";
    EXPECT_TRUE(std::isinf(t(Box{{0, 5, 0}, {1, 1, 1}}, {0, 0, 0}, {0, -1, 0}))) << "behind";
}

TEST(Scene, CameraPosesAreRigidUprightAndSmooth) {
    for (const Scene& scene : scene::scenes()) {
        const double steady = 0.01 * std::max(1.0, scene.ao_radius_m); // under a metre per second; outdoors two
        for (int i = 0; i < 10 * scene.walk.period_s; ++i) {
            const Eigen::Isometry3d pose = world_from_camera(scene.walk, i * 0.1);
            const Eigen::Isometry3d next = world_from_camera(scene.walk, i * 0.1 + 0.01);
            EXPECT_LT((pose.linear() * pose.linear().transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
            EXPECT_NEAR(pose.linear().determinant(), 1, 1e-12);
            EXPECT_LT(pose.linear().col(1).z(), -0.5) << scene.name << " " << i << ": image y points down";
            EXPECT_LT((next.translation() - pose.translation()).norm(), steady) << scene.name << " " << i;
            EXPECT_LT(Eigen::AngleAxisd(pose.linear().transpose() * next.linear()).angle(), 0.03)
                << scene.name << " " << i << ": no faster than a person turns";
        }
    }
}

TEST(Scene, RoomsAreClosedAndTheCameraWalksFreely) {
    for (const Scene& scene : scene::scenes()) {
        const scene::World world(scene);
        for (double time = 0; time < scene.walk.period_s; time += 0.5) {
            const auto exact = render_geometry(world, test_camera({80, 60}), world_from_camera(scene.walk, time));
            double nearest = 0, farthest = 0;
            cv::minMaxLoc(exact.z_m, &nearest, &farthest, nullptr, nullptr, exact.z_m > 0);
            EXPECT_GT(nearest, 0.45) << scene.name << " " << time << ": nothing nearer than a Kinect can see";
            EXPECT_LT(farthest, scene.far_m) << scene.name << " " << time;
            const double seen = cv::countNonZero(exact.z_m) / static_cast<double>(exact.z_m.total());
            EXPECT_GE(seen, scene.name == "outdoor" ? 0.6 : 1.0) << scene.name << " " << time << ": rooms are closed";
        }
    }
}

// ---------------------------------------------------------------------------------------------------- truth

/// Mean truth over the image, of a floor seen from above at world (x, 0, 0).
double visibility_at(const Scene& scene, double x, double radius_m, int rays = 1024) {
    const Pinhole telescope{1e5, 1e5, 7.5, 7.5, {16, 16}}; // all of its 256 pixels see the same millimetre
    const cv::Mat1f truth =
        true_visibility(scene::World(scene), telescope, scene::looking_at({x, 0, 1.5}, {x, 0, 0}), {radius_m, rays})
            .visibility[0];
    return cv::mean(truth)[0];
}

TEST(Truth, FloorNextToALongWallFollowsTheClosedForm) {
    const Scene room =
        scene_of({{Box{{0, 0, -1}, {50, 50, 1}}, {}}, {Box{{-1, 0, 5}, {1, 50, 5}}, {}}}); // wall at x < 0
    for (const double share : {0.05, 0.25, 0.5, 0.8, 1.2}) {
        const double radius = 0.5, c = std::min(share, 1.0);
        const double expected = 1 - (std::acos(c) - c * std::sqrt(1 - c * c)) / std::numbers::pi;
        EXPECT_NEAR(visibility_at(room, share * radius, radius), expected, 0.003) << "d / R = " << share;
    }
}

TEST(Truth, FloorUnderACeilingAndNextToABallFollowTheClosedForms) {
    const Scene low = scene_of({{Plane{{0, 0, 0}, {0, 0, 1}}, {}}, {Box{{0, 3, 0.35}, {50, 2.9, 0.05}}, {}}});
    // A ceiling at h = 0.3 over all directions would leave h^2 / R^2 = 0.36; this one starts 0.1 m to the side, so look
    // below it.
    const Pinhole telescope{1e5, 1e5, 7.5, 7.5, {16, 16}};
    const cv::Mat1f under =
        true_visibility(scene::World(low), telescope, scene::looking_at({0, 3, 0.2}, {0, 3, 0}), {0.5, 1024})
            .visibility[0];
    EXPECT_NEAR(cv::mean(under)[0], 0.36, 0.003);

    const double r = 0.1; // resting on the floor, 0.2 m from the point
    const Scene ball = scene_of({{Plane{{0, 0, 0}, {0, 0, 1}}, {}}, {Sphere{{0, 0, r}, r}, {}}});
    EXPECT_NEAR(visibility_at(ball, 0.2, 1), 1 - std::pow(r * r / (0.04 + r * r), 1.5), 0.003);
}

TEST(Truth, TheTreeAndTheFormulasAgree) {
    // The same question to every solid's formula, without tessellation and tree, by other rays: both answers are within
    // their noise (0.003 each at 1024 rays, more where wires are many).
    for (const char* name : {"office", "thin"}) {
        const Scene& scene = scene::scene_named(name);
        const scene::World world(scene);
        const Pinhole camera = test_camera({80, 60});
        const Eigen::Isometry3d pose = world_from_camera(scene.walk, 3);
        const cv::Mat1f truth = true_visibility(world, camera, pose, {0.5, 1024}).visibility[0];
        const CosineDirections directions(1024, 99);
        double squares = 0, sum = 0;
        int count = 0;
        for (int v = 2; v < 60; v += 10)
            for (int u = 3; u < 80; u += 10, ++count) {
                const Eigen::Vector3d sight = camera.ray(u, v);
                const scene::Ray ray{pose.translation(), pose.linear() * sight};
                const scene::Hit hit = scene::cast(scene.bodies, ray);
                const Eigen::Vector3d point = ray.origin + hit.t * ray.direction + 1e-6 * hit.normal;
                const auto turn = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), hit.normal);
                double open = 0;
                for (const auto& d : directions.set_for(static_cast<std::uint32_t>(count)))
                    open += scene::cast(scene.bodies, {point, turn * Eigen::Vector3d(d.x, d.y, d.z)}, 1e-7).t > 0.5;
                const double difference = static_cast<double>(truth(v, u)) - open / 1024;
                squares += difference * difference;
                sum += difference;
            }
        EXPECT_LT(std::sqrt(squares / count), 0.01) << name;
        EXPECT_LT(std::abs(sum / count), 0.003) << name;
    }
}

TEST(Truth, ConvexBodiesAreOpenEverywhere) {
    const Scene ball = scene_of({{Sphere{{0, 2, 0}, 0.5}, {}}});
    const cv::Mat1f truth =
        true_visibility(scene::World(ball), test_camera(), scene::looking_at({0, 0, 0}, {0, 1, 0}), {0.5, 64})
            .visibility[0];
    int seen = 0;
    for (const float v : truth)
        if (!std::isnan(v)) {
            ++seen;
            ASSERT_EQ(v, 1);
        }
    EXPECT_GT(seen, 500);
    EXPECT_LT(seen, static_cast<int>(truth.total())) << "where nothing is seen, nothing is known";
}

// ---------------------------------------------------------------------------------------------------- sensors

/// A sensor's depth of a wall straight ahead.
cv::Mat1f recorded_wall(std::string_view sensor, double z_m, int frame = 0) {
    const Scene room = scene_of({{Plane{{0, z_m, 0}, {0, 1, 0}}, {}}});
    const Pinhole camera{525, 525, 159.5, 119.5, {320, 240}};
    const Eigen::Isometry3d pose = scene::looking_at({0, 0, 0}, {0, 1, 0});
    const scene::World world(room);
    return sensor_named(sensor).record({world, camera, pose, render_geometry(world, camera, pose), 1, frame});
}

struct Spread {
    double mean, sigma;
};
Spread spread_of(const cv::Mat1f& z_m) {
    cv::Scalar mean, sigma;
    cv::meanStdDev(z_m, mean, sigma, z_m > 0);
    return {mean[0], sigma[0]};
}

TEST(Kinect, DepthsAreWholeDisparityStepsApart) {
    for (const double z : {1.0, 2.0, 3.0}) {
        const cv::Mat1f recorded = recorded_wall("kinect", z);
        const std::set<float> levels(recorded.begin(), recorded.end());
        ASSERT_GT(levels.size(), 3U);
        double before = 0;
        for (const float level : levels) {
            if (before > 0 && level > 0) {
                EXPECT_NEAR(level - before, kinect_step_per_m * level * before, 1e-5);
            }
            before = level;
        }
    }
}

TEST(Kinect, NoiseHasTheStatedSigma) {
    for (const double z : {1.0, 2.0, 3.0}) {
        const auto [mean, sigma] = spread_of(recorded_wall("kinect", z));
        const double step = kinect_step_per_m * z * z; // rounding to steps adds a twelfth of their square
        EXPECT_NEAR(sigma, std::hypot(kinect_sigma_m(z), step / std::sqrt(12)), 0.06 * sigma) << z;
        EXPECT_NEAR(mean, z, 0.1 * sigma) << z;
    }
}

TEST(Kinect, HasNoDepthAtItsBorderNorOutOfRange) {
    const cv::Mat1f recorded = recorded_wall("kinect", 2);
    EXPECT_EQ(cv::countNonZero(recorded.colRange(312, 320)), 0);
    EXPECT_EQ(cv::countNonZero(recorded.colRange(0, 312)), 312 * 240);
    EXPECT_EQ(cv::countNonZero(recorded_wall("kinect", 0.38)), 0);
    EXPECT_EQ(cv::countNonZero(recorded_wall("kinect", 9)), 0);
}

TEST(Kinect, ObjectsCastAShadowToOneSideAsWideAsTheBaselineImplies) {
    // A post at 1 m before a wall at 2 m: 7.5 cm of baseline leave f b (1/1 - 1/2) = 19.7 columns without dots.
    const Scene room = scene_of({{Plane{{0, 2, 0}, {0, 1, 0}}, {}}, {Box{{0, 1.05, 0}, {0.1, 0.05, 5}}, {}}});
    const Pinhole camera{525, 525, 159.5, 119.5, {320, 240}};
    const Eigen::Isometry3d pose = scene::looking_at({0, 0, 0}, {0, 1, 0});
    const scene::World world(room);
    const Sight sight{world, camera, pose, render_geometry(world, camera, pose), 1, 0};
    const cv::Mat1f recorded = sensor_named("kinect").record(sight);
    const int left_rim = static_cast<int>(std::lround(159.5 - 52.5)),
              right_rim = static_cast<int>(std::lround(159.5 + 52.5));
    const double left = cv::countNonZero(recorded.colRange(left_rim - 30, left_rim - 2) == 0) / 240.0;
    const double right = cv::countNonZero(recorded.colRange(right_rim + 2, right_rim + 30) == 0) / 240.0;
    EXPECT_NEAR(left, 19.7 - 2, 2);
    EXPECT_LT(right, 1);
}

TEST(TimeOfFlight, NoiseGrowsWithTheSquareOfTheDistance) {
    for (const double z : {1.0, 4.0}) {
        const cv::Mat1f recorded = recorded_wall("tof", z);
        const auto [mean, sigma] = spread_of(recorded(cv::Rect(140, 100, 40, 40)));
        EXPECT_NEAR(sigma, tof_sigma_m(z), 0.1 * tof_sigma_m(z)) << z;
        EXPECT_NEAR(mean, z, 0.2 * sigma) << z;
    }
}

TEST(TimeOfFlight, PixelsFlyBetweenTheSurfacesOfAnOutline) {
    const Scene room = scene_of({{Plane{{0, 3, 0}, {0, 1, 0}}, {}}, {Box{{0, 1.05, 0}, {0.1, 0.05, 5}}, {}}});
    const Pinhole camera{525, 525, 159.5, 119.5, {320, 240}};
    const Eigen::Isometry3d pose = scene::looking_at({0, 0, 0}, {0, 1, 0});
    const scene::World world(room);
    const Sight sight{world, camera, pose, render_geometry(world, camera, pose), 1, 0};
    const cv::Mat1f recorded = sensor_named("tof").record(sight);
    const int flying = cv::countNonZero((recorded > 1.1) & (recorded < 2.9));
    EXPECT_GT(flying, 240); // two outlines of 240 rows, two pixels each, 60 % of them
    EXPECT_LT(flying, 4 * 240);
}

/// A box of 20 cm, 1 m away, before a wall 3 m away.
cv::Mat1f recorded_box(std::string_view sensor) {
    const Scene room = scene_of({{Plane{{0, 3, 0}, {0, 1, 0}}, {}}, {Box{{0, 1.05, 0}, {0.1, 0.05, 5}}, {}}});
    const Pinhole camera{525, 525, 159.5, 119.5, {320, 240}};
    const Eigen::Isometry3d pose = scene::looking_at({0, 0, 0}, {0, 1, 0});
    const scene::World world(room);
    return sensor_named(sensor).record({world, camera, pose, render_geometry(world, camera, pose), 1, 0});
}

TEST(Stereo, NoiseGrowsWithTheSquareOfTheDistance) {
    for (const double z : {1.5, 3.0}) {
        const auto [mean, sigma] = spread_of(recorded_wall("stereo", z)(cv::Rect(140, 100, 40, 40)));
        EXPECT_NEAR(sigma, z * z * stereo_sigma_px / (525 * stereo_base_m), 0.2 * sigma) << z;
        EXPECT_NEAR(mean, z, 0.5 * sigma) << z;
    }
}

TEST(Stereo, NearThingsGrowAndOneSideOfThemHasNoMatch) {
    const cv::Mat1f recorded = recorded_box("stereo");
    const double width = 0.2 * 525; // of the box, in pixels
    const double near = cv::countNonZero((recorded > 0.5) & (recorded < 1.5)) / 240.0;
    EXPECT_GT(near, width + 2);
    EXPECT_LT(near, width + 8);
    const double unmatched = cv::countNonZero(recorded == 0) / 240.0;
    EXPECT_NEAR(unmatched, 525 * stereo_base_m * (1 - 1 / 3.0), 8) << "the shift between the two cameras";
}

TEST(PhoneLidar, HasNoHolesAndSmearsOutlines) {
    const cv::Mat1f recorded = recorded_box("lidar");
    EXPECT_EQ(cv::countNonZero(recorded == 0), 0);
    EXPECT_GT(cv::countNonZero((recorded > 1.1) & (recorded < 2.9)) / 240.0, 4) << "two outlines of two pixels or more";
    EXPECT_EQ(cv::countNonZero(recorded_wall("lidar", 5.5)), 0) << "beyond its reach";
}

TEST(Sensors, NoiseDependsOnSeedAndFrameAlone) {
    for (const Sensor& sensor : sensors()) {
        const auto bytes = [&](int frame) {
            const cv::Mat1f image = recorded_wall(sensor.name, 2, frame);
            return std::string(reinterpret_cast<const char*>(image.data), image.total() * sizeof(float));
        };
        const std::string all_cores = bytes(0);
        const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
        EXPECT_EQ(bytes(0), all_cores) << sensor.name;
        EXPECT_EQ(bytes(1) == all_cores, sensor.name == "ideal") << sensor.name;
    }
}

TEST(Sensors, UnknownNamesAreRefusedWithTheKnownOnes) {
    EXPECT_TRUE(says(refusal([] { (void)sensor_named("sonar"); }), "ideal, kinect, tof, stereo, lidar"));
    EXPECT_THROW((void)scene::scene_named("moon"), Misuse);
}

// ---------------------------------------------------------------------------------------------------- captures

GenerateOptions tiny() {
    GenerateOptions options;
    options.frames = 3;
    options.size = "80x60";
    options.truth_rays = 8;
    return options;
}

std::map<std::string, std::string> contents(const fs::path& folder) {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
        if (entry.is_regular_file())
            files[fs::relative(entry.path(), folder).string()] = tests::read_bytes(entry.path());
    return files;
}

TEST(Generate, SameOptionsSameBytes) {
    const TemporaryFolder folder;
    generate(tiny(), folder / "a");
    generate(tiny(), folder / "b");
    const auto first = contents(folder / "a");
    EXPECT_EQ(first, contents(folder / "b"));
    EXPECT_EQ(first.size(), 3U * 5 + 5)
        << "colour, depth, exact depth, normals and AO of each; three lists, a camera, a note";
    GenerateOptions other = tiny();
    other.seed = 2;
    generate(other, folder / "c");
    EXPECT_NE(first, contents(folder / "c"));
}

TEST(Generate, TheCaptureOpensAsATumRecording) {
    const TemporaryFolder folder;
    GenerateOptions options = tiny();
    options.sensor = "ideal";
    generate(options, folder / "room");
    const Capture capture = open_capture(folder / "room");
    EXPECT_TRUE(says(capture.kind, "TUM"));
    ASSERT_EQ(capture.entries.size(), 3U);
    ASSERT_TRUE(capture.camera);
    EXPECT_EQ(capture.camera->pinhole.size, cv::Size(80, 60));
    EXPECT_EQ(capture.registration, Registration::yes);
    const auto& walk = scene::scene_named("office").walk;
    for (std::size_t i = 0; i < 3; ++i) {
        const Frame frame = capture.load(i);
        EXPECT_FALSE(frame.colour.empty());
        ASSERT_TRUE(frame.world_from_camera);
        const Eigen::Isometry3d pose = world_from_camera(walk, static_cast<double>(i) / 10 + 0.004);
        EXPECT_LT((frame.world_from_camera->matrix() - pose.matrix()).norm(), 1e-6) << "the pose of the depth image";
        const auto exact = render_geometry(scene::World(scene::scene_named("office")), capture.camera->pinhole, pose);
        EXPECT_LT(cv::norm(frame.depth_m, exact.z_m, cv::NORM_INF), 0.5 / 5000 + 1e-6) << "rounded to 0.2 mm";
    }
}

TEST(Generate, AFrameIsTheSameFromWhereverItIsReached) {
    const TemporaryFolder folder;
    GenerateOptions options = tiny();
    options.frames = 5;
    generate(options, folder / "all");
    options.frames = 2;
    options.first = 2;
    options.step = 2;
    generate(options, folder / "some");
    const auto all = contents(folder / "all"), some = contents(folder / "some");
    int compared = 0;
    for (const auto& [name, bytes] : some)
        if (name.find("17000000") != std::string::npos) {
            ASSERT_TRUE(all.contains(name)) << name;
            EXPECT_EQ(all.at(name), bytes) << name;
            ++compared;
        }
    EXPECT_EQ(compared, 2 * 5);
    EXPECT_EQ(open_capture(folder / "some").entries.size(), 2U);
}

TEST(Generate, ScenesFartherThanPngReachesKeepTheirDepth) {
    const TemporaryFolder folder;
    GenerateOptions options = tiny();
    options.scene = "outdoor";
    options.sensor = "ideal";
    options.frames = 1;
    generate(options, folder / "lane");
    const Capture capture = open_capture(folder / "lane");
    const Frame frame = capture.load(0);
    const Scene& scene = scene::scene_named("outdoor");
    const auto exact =
        render_geometry(scene::World(scene), capture.camera->pinhole, world_from_camera(scene.walk, 0.004));
    double farthest = 0;
    cv::minMaxLoc(frame.depth_m, nullptr, &farthest);
    EXPECT_GT(farthest, 60);
    EXPECT_LT(cv::norm(frame.depth_m, exact.z_m, cv::NORM_INF), 1e-4);
    EXPECT_TRUE(says(tests::read_bytes(folder / "lane/truth/truth.json"), "\"radius_m\": 2.0")) << "the scene's own";
}

TEST(Generate, FalloffsComeFromTheSameRays) {
    const TemporaryFolder folder;
    GenerateOptions options = tiny();
    options.frames = 1;
    options.truth_falloff = "hard,quad,lin";
    generate(options, folder / "room");
    const std::string name = "1700000000.004000.tiff";
    const cv::Mat1f hard = read_ao(folder / "room/truth/ao" / name),
                    quad = read_ao(folder / "room/truth/ao_quad" / name),
                    lin = read_ao(folder / "room/truth/ao_lin" / name);
    EXPECT_EQ(cv::countNonZero(quad < hard - 1e-6), 0) << "a falloff only opens";
    EXPECT_EQ(cv::countNonZero(lin < hard - 1e-6), 0);
    EXPECT_GT(cv::countNonZero(lin > hard), 100);
    EXPECT_TRUE(says(tests::read_bytes(folder / "room/truth/truth.json"), "standard_error_of_ao"));
    options.truth_falloff = "hard,soft";
    EXPECT_THROW(generate(options, folder / "other"), Misuse);
    EXPECT_FALSE(fs::exists(folder / "other"));
}

TEST(Generate, AnExistingCaptureIsNotOverwrittenUnasked) {
    const TemporaryFolder folder;
    GenerateOptions options = tiny();
    options.truth = false;
    generate(options, folder / "room");
    EXPECT_THROW(generate(options, folder / "room"), Misuse);
    options.overwrite = true;
    options.frames = 1;
    generate(options, folder / "room");
    EXPECT_EQ(contents(folder / "room").size(), 2U + 5) << "nothing of the longer capture is left";

    fs::create_directory(folder / "mine");
    fs::copy_file(folder / "room" / "rgb.txt", folder / "mine" / "rgb.txt");
    EXPECT_THROW(generate(options, folder / "mine"), Misuse) << "not a generated capture: never removed";
    EXPECT_TRUE(fs::exists(folder / "mine" / "rgb.txt"));
}

TEST(Generate, ImpossibleOptionsAreRefusedBeforeAnythingIsWritten) {
    const TemporaryFolder folder;
    for (const char* size : {"640", "640x", "x480", "0x480", "640x480x3", "640x-480", "99999x10"}) {
        GenerateOptions options = tiny();
        options.size = size;
        EXPECT_THROW(generate(options, folder / "room"), Misuse) << size;
    }
    GenerateOptions options = tiny();
    options.frames = 0;
    EXPECT_THROW(generate(options, folder / "room"), Misuse);
    options = tiny();
    options.sensor = "sonar";
    EXPECT_THROW(generate(options, folder / "room"), Misuse);
    EXPECT_FALSE(fs::exists(folder / "room"));
}

} // namespace
} // namespace scanshade
