// Cameras refined from recordings: tracks, planes, time offsets and a secondary colour camera.
#include "apps/refine/recording.h"
#include "apps/refine/report.h"
#include "apps/scenes/generate.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "io/cameras/camera_file.h"
#include "projection/base/error.h"
#include "projection/calibration/recording/agreement.h"
#include "projection/calibration/recording/planes.h"
#include "projection/calibration/recording/residuals.h"
#include "projection/calibration/recording/sequence.h"
#include "projection/calibration/recording/tracks.h"
#include "projection/calibration/refinement.h"
#include "tests/support/files.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <set>
#include <sstream>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace calibration;
using tests::says;

fs::path generated(const fs::path& folder, int frames, int step) {
    GenerateOptions options;
    options.frames = frames;
    options.step = step;
    options.truth = false;
    generate(options, folder);
    return folder;
}

/// A generated office seen by a Kinect: noise that grows with depth, in steps, and colour 4 ms before depth. 525 px.
const fs::path& office_folder() {
    static const tests::TemporaryFolder folder;
    static const fs::path path = generated(folder / "office", 16, 4);
    return path;
}

/// The same in smaller steps, for estimated poses.
const fs::path& slow_office_folder() {
    static const tests::TemporaryFolder folder;
    static const fs::path path = generated(folder / "slow", 12, 1);
    return path;
}

RecordingResult refined(const Capture& capture, const RecordingOptions& recording = {}, const FirstCamera& first = {}) {
    std::vector<std::size_t> frames(capture.entries.size());
    std::iota(frames.begin(), frames.end(), std::size_t{0});
    return refine_from_recording(capture, frames, first, recording, {});
}

Capture office(const std::string& camera = "") {
    return open_capture(office_folder(), {.camera = camera, .depth_scale = {}});
}

const char* five_percent_off = "551,551,319.5,239.5";

TEST(Recordings, AWrongFocalLengthIsFoundAndTheRightOneKept) {
    for (const char* observations : {"tracks", "depth"}) {
        const Capture wrong = office(five_percent_off);
        const Refinement r = refined(wrong, {.observations = observations}).refinement;
        std::printf("%s: fx %.2f +- %.2f\n", r.source.c_str(), r.after.pinhole.fx, r.selection.fit.sigma(f));
        ASSERT_TRUE(r.selection.free[f]) << observations;
        EXPECT_NEAR(r.after.pinhole.fx, 525, 3 * r.selection.fit.sigma(f) + 0.5) << observations;
        EXPECT_NEAR(r.after.pinhole.fx, 525, 8) << observations;
        EXPECT_LT(r.selection.held_out_px, r.selection.held_out_before_px) << observations;
        const Refinement right = refined(office(), {.observations = observations}).refinement;
        EXPECT_FALSE(right.changed()) << observations << ": " << right.selection.fit.model[f];
    }
}

/// A walk of 20 small frames, and the camera that it is refined from: 5 % off the true 262.5 px.
Capture short_walk(const fs::path& folder, const std::string& scene, const std::string& sensor, int first,
                   const std::string& camera) {
    GenerateOptions options;
    options.scene = scene;
    options.sensor = sensor;
    options.frames = 20;
    options.first = first;
    options.step = 3;
    options.size = "320x240";
    options.truth = false;
    generate(options, folder);
    return open_capture(folder, {.camera = camera, .depth_scale = {}});
}
const char *five_percent_short = "249.375,249.375,159.5,119.5", *five_percent_long = "275.625,275.625,159.5,119.5";

TEST(ShortWalks, exact_depth_alone_tells_the_focal_length) {
    const tests::TemporaryFolder folder;
    for (const char* camera : {five_percent_short, five_percent_long}) {
        const Capture walk = short_walk(folder / camera, "kitchen", "ideal", 30, camera);
        const Refinement r = refined(walk, {.observations = "depth"}).refinement;
        ASSERT_TRUE(r.selection.free[f]) << r.selection.steps.front().why;
        EXPECT_FALSE(r.selection.free[aspect]);
        EXPECT_NEAR(r.after.pinhole.fx, 262.5, 0.01);
        EXPECT_TRUE(verdict_of(r).starts_with("sound")) << verdict_of(r);
    }
}

TEST(ShortWalks, sigmas_of_tracks_hold_the_truth) {
    const tests::TemporaryFolder folder;
    for (const char* scene : {"kitchen", "staircase"})
        for (const char* camera : {five_percent_short, five_percent_long}) {
            const Capture walk = short_walk(folder / (scene + std::string(camera)), scene, "ideal", 0, camera);
            const Refinement r = refined(walk).refinement;
            ASSERT_TRUE(r.selection.free[f]) << scene << ": " << r.selection.steps.front().why;
            EXPECT_FALSE(r.selection.free[aspect]) << scene;
            EXPECT_NEAR(r.after.pinhole.fx, 262.5, 2 * r.selection.fit.sigma(f)) << scene;
            EXPECT_LT(r.selection.fit.sigma(f), 2) << scene;
        }
}

TEST(ShortWalks, a_wrong_camera_that_frames_hardly_determine_is_doubted) {
    const tests::TemporaryFolder folder;
    const Capture walk = short_walk(folder / "walk", "office", "kinect", 0, five_percent_long);
    const Refinement r = refined(walk).refinement;
    EXPECT_TRUE(r.selection.free[f] || r.selection.focal_length_free);
    EXPECT_TRUE(verdict_of(r).starts_with("doubtful")) << verdict_of(r) << r.after.pinhole.fx;
    for (const Unknown lens : {aspect, k1, k2, p1, k3}) // they must not stand in for it
        EXPECT_FALSE(r.selection.free[lens]) << name_of(lens);
}

TEST(Tracks, features_are_where_the_blobs_are_and_each_makes_one_track) {
    std::vector<cv::Mat1b> images;
    std::vector<std::vector<cv::Point2d>> truth;
    for (int frame = 0; frame < 4; ++frame) {
        cv::RNG random(3);
        cv::Mat1f image(240, 320, 60.F);
        std::vector<cv::Point2d>& blobs = truth.emplace_back();
        for (int row = 0; row < 5; ++row)
            for (int column = 0; column < 7; ++column) {
                const cv::Point2d at(30 + 40 * column + random.uniform(-5.0, 5.0) + 2.3 * frame,
                                     28 + 42 * row + random.uniform(-5.0, 5.0) + 1.6 * frame);
                blobs.push_back(at);
                // Unlike neighbours, so that each descriptor is met once.
                for (int part = 0; part < 4; ++part) {
                    const cv::Point2d centre =
                        part == 0 ? at : at + cv::Point2d(random.uniform(-13.0, 13.0), random.uniform(-13.0, 13.0));
                    const double height = part == 0 ? 150 : random.uniform(-40.0, 40.0), width = part == 0 ? 2.5 : 4;
                    for (int v = 0; v < image.rows; ++v)
                        for (int u = 0; u < image.cols; ++u) {
                            const double squared = std::pow(u - centre.x, 2) + std::pow(v - centre.y, 2);
                            if (squared < 25 * width * width)
                                image(v, u) += static_cast<float>(height * std::exp(-squared / (2 * width * width)));
                        }
                }
            }
        cv::Mat1b grey;
        image.convertTo(grey, CV_8U);
        images.push_back(grey);
    }
    const std::vector<Track> tracks = find_tracks(images);
    ASSERT_GT(tracks.size(), 20U);
    std::set<std::pair<double, double>> first_places;
    double sum_u = 0, sum_v = 0;
    int near = 0;
    for (const Track& track : tracks) {
        const Track::Observation& s = track.observations.front();
        EXPECT_TRUE(first_places.insert({s.pixel.x + 1000 * s.frame, s.pixel.y}).second);
        for (const cv::Point2d& blob : truth[static_cast<std::size_t>(s.frame)])
            if (cv::norm(s.pixel - blob) < 1) {
                sum_u += s.pixel.x - blob.x;
                sum_v += s.pixel.y - blob.y;
                ++near;
            }
    }
    ASSERT_GT(near, 10);
    EXPECT_NEAR(sum_u / near, 0, 0.1); // OpenCV's own coordinates are 0.25 px off
    EXPECT_NEAR(sum_v / near, 0, 0.1);
}

TEST(Tracks, depth_at_a_feature_is_that_of_its_own_place) {
    const Pinhole camera{262.5, 262.5, 159.5, 119.5, {320, 240}};
    cv::Mat1f depth_m(240, 320);
    const auto slanted = [&](double u, double v) { // the plane z + 0.5 x + 0.2 y = 2
        const Eigen::Vector3d ray = camera.ray(u, v);
        return 2 / (1 + 0.5 * ray.x() + 0.2 * ray.y());
    };
    for (int v = 0; v < depth_m.rows; ++v)
        for (int u = 0; u < depth_m.cols; ++u)
            depth_m(v, u) = static_cast<float>(slanted(u, v));
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(100.4, 60.3), {200.5, 30.49}, {17.7, 200.2}})
        EXPECT_NEAR(depth_at(depth_m, pixel), slanted(pixel.x(), pixel.y()), 1e-5);
    depth_m(60, 101) = 0;
    EXPECT_EQ(depth_at(depth_m, {100.4, 60.3}), 0);
}

TEST(Recordings, MissingPosesAreEstimated) {
    const Capture capture = open_capture(slow_office_folder());
    const RecordingResult result = refined(capture, {.poses = "ignore"});
    EXPECT_FALSE(result.refinement.changed());
    ASSERT_EQ(result.poses.size(), capture.entries.size());
    const Eigen::Isometry3d start =
        *capture.entries[0].world_from_camera; // estimated poses are relative to the first camera
    for (std::size_t i = 0; i < result.poses.size(); ++i) {
        const Eigen::Isometry3d truth = start.inverse() * *capture.entries[i].world_from_camera;
        const Eigen::Isometry3d found = result.poses[0].second.inverse() * result.poses[i].second;
        EXPECT_LT((found.translation() - truth.translation()).norm(), 0.03)
            << result.poses[i].first; // a Kinect's noise at 2.4 m is 9 mm
    }
}

TEST(Recordings, ACaptureWithoutCameraStartsFromTheFlags) {
    const tests::TemporaryFolder folder;
    fs::copy(slow_office_folder(), folder / "bare", fs::copy_options::recursive);
    const std::string camera = tests::file_bytes(slow_office_folder() / "camera.json");
    // As colour and depth folders, which name no camera.
    for (const char* file : {"camera.json", "depth.txt", "rgb.txt", "groundtruth.txt"})
        fs::remove(folder / (std::string("bare/") + file));
    fs::remove_all(folder / "bare/truth");
    const std::string refine = "refine '" + (folder / "bare").string() + "' --depth-scale tum ";
    const tests::Ran none = tests::run_program(refine);
    EXPECT_EQ(none.exit_code, 3);
    EXPECT_TRUE(says(none.err, "no camera to start from"));
    tests::write_file(folder / "camera.json", camera);
    const std::string in_file = "--camera '" + (folder / "camera.json").string() + "'";
    for (const std::string& flag :
         std::vector<std::string>{"--camera 525,525,319.5,239.5", "--camera primesense", "--fov 62.7", in_file}) {
        const tests::Ran ran = tests::run_program(refine + flag);
        EXPECT_EQ(ran.exit_code, 0) << flag << ran.err;
        EXPECT_TRUE(says(ran.out, "points seen")) << flag;
    }
}

// ---------------------------------------------------------------------------------------------------- time offsets

/// The office with its poses stamped `late_s` after their time.
Capture office_with_late_poses(const tests::TemporaryFolder& folder, double late_s) {
    fs::copy(office_folder(), folder / "late", fs::copy_options::recursive);
    std::istringstream rows(tests::file_bytes(office_folder() / "groundtruth.txt"));
    std::string late;
    for (std::string row; std::getline(rows, row);) {
        const auto space = row.find(' ');
        late += row.starts_with('#') ? row : fmt::format("{:.6f}{}", std::stod(row) + late_s, row.substr(space));
        late += '\n';
    }
    tests::write_file(folder / "late/groundtruth.txt", late);
    return open_capture(folder / "late");
}

TEST(Recordings, ATimeOffsetIsFoundAndTheNextRunAppliesIt) {
    const tests::TemporaryFolder folder;
    const double late_s = 0.015;
    const Capture late = office_with_late_poses(folder, late_s);
    const RecordingResult result = refined(late);
    const Fit& fit = result.refinement.selection.fit;
    std::printf("poses %.1f ms late: found %.2f +- %.2f ms\n", 1000 * late_s, 1000 * fit.model[time_offset],
                1000 * fit.sigma(time_offset));
    ASSERT_TRUE(result.refinement.selection.free[time_offset]);
    EXPECT_NEAR(result.file.pose_time_offset_s, late_s, 3 * fit.sigma(time_offset));
    EXPECT_NEAR(result.file.pose_time_offset_s, late_s, 0.003);
    EXPECT_LT(result.refinement.selection.held_out_px, result.refinement.selection.held_out_before_px);
    CameraFile file = read_camera_file(folder / "late/camera.json");
    file.pose_time_offset_s = result.file.pose_time_offset_s;
    write_camera_file(folder / "late/camera.json", file);
    EXPECT_FALSE(refined(open_capture(folder / "late")).refinement.selection.free[time_offset]);
}

// ---------------------------------------------------------------------------------------------------- depth alone

/// Frames of a room made of infinite walls, seen by `truth`; noise of 2 mm.
std::vector<PlaneFrame> frames_of_walls(const Camera& truth, const std::vector<Eigen::Vector4d>& walls,
                                        const std::vector<Eigen::Isometry3d>& poses, bool posed = true) {
    std::vector<PlaneFrame> frames;
    cv::RNG random(3);
    for (std::size_t i = 0; i < poses.size(); ++i) {
        cv::Mat1f depth(truth.pinhole.size, 0.0F);
        for (int v = 0; v < depth.rows; ++v)
            for (int u = 0; u < depth.cols; ++u) {
                const Eigen::Vector3d ray = poses[i].linear() * ray_of(truth, Eigen::Vector2d(u, v));
                double nearest = 1e9;
                for (const Eigen::Vector4d& wall : walls) {
                    const double z = (wall(3) - wall.head<3>().dot(poses[i].translation())) / wall.head<3>().dot(ray);
                    nearest = z > 0.1 ? std::min(nearest, z) : nearest;
                }
                depth(v, u) = nearest < 8 ? static_cast<float>(nearest + random.gaussian(0.002)) : 0.0F;
            }
        frames.push_back({fmt::format("frame {}", i), depth, posed ? std::optional(poses[i]) : std::nullopt});
    }
    return frames;
}

std::vector<Eigen::Isometry3d> looks_around() {
    std::vector<Eigen::Isometry3d> poses;
    for (int i = 0; i < 6; ++i) {
        Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
        pose.linear() = (Eigen::AngleAxisd(0.15 * (i - 2.5), Eigen::Vector3d::UnitY()) *
                         Eigen::AngleAxisd(0.1 * (i % 3 - 1), Eigen::Vector3d::UnitX()))
                            .toRotationMatrix();
        pose.translation() = Eigen::Vector3d(0.13 * (i - 3), 0.03 * (i % 2), 0.04 * i);
        poses.push_back(pose);
    }
    return poses;
}

const Camera small{{262.5, 262.5, 159.5, 119.5, {320, 240}}, {}, "small"};
const std::vector<Eigen::Vector4d> room = {
    {0, 0, 1, 2.5}, {1, 0, 0, 1.2}, {-1, 0, 0, 1.4}, {0, 1, 0, 1.0}, {0, -1, 0, 1.1}};

Refinement refined(Planes& planes, const Camera& first) {
    RefineOptions options;
    options.selection.least_sigmas = 5;
    Refinement best;
    for (const std::vector<ParameterGroup>& groups : planes.group_orders()) {
        Refinement r = refine(planes, first, groups, options, planes.degeneracy());
        if (best.unit.empty() || r.selection.held_out_px < best.selection.held_out_px)
            best = std::move(r);
    }
    return best;
}

std::string steps_of(const Refinement& r) {
    std::string all;
    for (const Step& step : r.selection.steps)
        all += "\n  " + step.name + (step.freed ? " freed: " : " kept: ") + step.why;
    for (const std::string& note : r.notes)
        all += "\n  " + note;
    return all;
}

TEST(Planes, RecoverFocalLengthAndLensTogether) {
    const Camera truth{small.pinhole, {-0.12, 0, 0, 0, 0}, "truth"};
    Camera first = small;
    first.pinhole.fx = first.pinhole.fy = 275;
    Planes planes(frames_of_walls(truth, room, looks_around()), model_of(first));
    const Refinement r = refined(planes, first);
    const Fit& fit = r.selection.fit;
    std::printf("f %.2f +- %.2f, k1 %.4f +- %.4f\n", fit.model[f], fit.sigma(f), fit.model[k1], fit.sigma(k1));
    ASSERT_TRUE(r.selection.free[f] && r.selection.free[k1]);
    EXPECT_NEAR(fit.model[f], 262.5, 1);
    EXPECT_NEAR(fit.model[k1], -0.12, 0.01);
}

TEST(Planes, AScaleIsNotMistakenForAFocalLengthInABareRoom) {
    // A camera that moves only sideways cannot distinguish a room s times deeper from a focal length s times longer:
    // x z / f and y z / f stay the same, and the slant of no wall is known. A rotation of the camera resolves that.
    const Camera tiny{{131.25, 131.25, 79.5, 59.5, {160, 120}}, {}, "tiny"};
    const auto refined_moving = [&](double angle, const Camera& first, float depths) {
        std::vector<Eigen::Isometry3d> poses(5, Eigen::Isometry3d::Identity());
        for (int i = 0; i < 5; ++i) {
            poses[i].translation() = Eigen::Vector3d(0.15 * (i - 2), 0.1 * (i % 3), 0);
            poses[i].linear() = Eigen::AngleAxisd(angle * (i - 2), Eigen::Vector3d(0.6, 0.8, 0)).toRotationMatrix();
        }
        std::vector<PlaneFrame> frames = frames_of_walls(tiny, room, poses);
        for (PlaneFrame& frame : frames)
            frame.depth_m *= depths;
        Planes planes(frames, model_of(first));
        std::vector<ParameterGroup> groups = planes.group_orders().front();
        std::erase_if(groups,
                      [](const ParameterGroup& group) { return group.name != "f" && group.name != "depth scale"; });
        RefineOptions options;
        options.selection.least_sigmas = 5;
        return refine(planes, first, groups, options, planes.degeneracy());
    };
    Camera wrong = tiny;
    wrong.pinhole.fx = wrong.pinhole.fy = 1.05 * 131.25;
    const Refinement sideways = refined_moving(0, tiny, 1 / 1.05F), turning = refined_moving(0.15, wrong, 1);
    EXPECT_FALSE(sideways.changed()) << steps_of(sideways);
    EXPECT_TRUE(says(steps_of(sideways), "focal length and depth scale cannot be told apart here"))
        << steps_of(sideways);
    EXPECT_FALSE(turning.selection.free[depth_scale]) << steps_of(turning);
    EXPECT_NEAR(turning.selection.fit.model[f], 131.25, 0.5) << steps_of(turning);
}

TEST(Planes, WithoutPosesOnlyLensAndDepthOffsetAreFree) {
    const Camera truth{small.pinhole, {-0.12, 0, 0, 0, 0}, "truth"};
    Planes planes(frames_of_walls(truth, room, looks_around(), false), model_of(small));
    EXPECT_FALSE(planes.linked());
    const Refinement r = refined(planes, small);
    EXPECT_TRUE(r.selection.free[k1]);
    EXPECT_FALSE(r.selection.free[f] || r.selection.free[depth_scale]);
    EXPECT_NEAR(r.selection.fit.model[k1], -0.12, 0.02);
    // With a focal length 5 % wrong every plane stays a plane: nothing can be found, and nothing changes.
    Camera wrong = small;
    wrong.pinhole.fx = wrong.pinhole.fy = 275;
    Planes plain(frames_of_walls(small, room, looks_around(), false), model_of(wrong));
    EXPECT_FALSE(refined(plain, wrong).changed());
}

TEST(Planes, DegenerateScenesAreNamedAndChangeNothing) {
    Camera wrong = small;
    wrong.pinhole.fx = wrong.pinhole.fy = 275;
    const auto said_of = [&](const std::vector<Eigen::Vector4d>& walls, const std::vector<Eigen::Isometry3d>& poses) {
        Planes planes(frames_of_walls(small, walls, poses), model_of(small));
        const Refinement kept = refined(planes, wrong);
        EXPECT_FALSE(kept.changed());
        return planes.degeneracy();
    };
    EXPECT_TRUE(says(said_of({room[0]}, looks_around()), "1 plane in the depth images"));
    EXPECT_TRUE(says(said_of(room, std::vector(4, looks_around()[0])), "the camera hardly moves"));
    // Steps of a stair seen from before it: many planes, one direction.
    std::vector<Eigen::Isometry3d> poses;
    for (int i = 0; i < 5; ++i)
        poses.emplace_back(Eigen::Translation3d(0.05 * i, 0, 0));
    std::vector<PlaneFrame> stairs;
    for (const Eigen::Isometry3d& pose : poses) {
        cv::Mat1f depth(small.pinhole.size);
        for (int row = 0; row < depth.rows; ++row) {
            const int step = row / 48;
            depth.row(row).setTo(3.0F - 0.3F * static_cast<float>(step));
        }
        stairs.push_back({"stairs", depth, pose});
    }
    EXPECT_TRUE(says(Planes(stairs, model_of(small)).degeneracy(), "all planes face one way"));
    std::vector<PlaneFrame> rough = stairs;
    cv::RNG random(1);
    for (PlaneFrame& frame : rough)
        for (float& z : frame.depth_m)
            z = static_cast<float>(random.uniform(1.0, 3.0));
    EXPECT_TRUE(
        says(tests::refusal([&] { (void)Planes(rough, model_of(small)); }), "nothing in the depth images is plane"));
}

// ---------------------------------------------------------------------------------------------------- secondary camera

/// Office frames whose colour comes from a second camera: 40 mm away, rotated by a degree, of another focal length.
std::vector<SequenceFrame> frames_of_secondary(const Camera& depth_camera, const ColourCamera& colour,
                                               double start_s = 0, int seed = 1, int count = 10) {
    static const scene::World world(scene::scene_named("office"));
    std::vector<SequenceFrame> frames;
    for (int i = 0; i < count; ++i) {
        const Eigen::Isometry3d pose = scene::world_from_camera(world.scene().walk, start_s + 0.4 * i);
        const scene::Geometry exact = scene::render_geometry(world, depth_camera.pinhole, pose);
        SequenceFrame frame{.name = fmt::format("frame {}", i), .grey = {}, .depth_m = {}};
        frame.depth_m = sensor_named("kinect").record({world, depth_camera.pinhole, pose, exact, seed, i});
        cv::cvtColor(scene::render_colour(world, colour.camera.pinhole, pose * colour.colour_from_depth.inverse()),
                     frame.grey, cv::COLOR_BGR2GRAY);
        frame.world_from_camera = pose;
        frames.push_back(std::move(frame));
    }
    return frames;
}

/// Distance between the projections of recorded depth by a model and by the truth: pixels, root mean square.
double warp_error_px(const Camera& depth_camera, const cv::Mat1f& depth_m, const Model& model,
                     const ColourCamera& truth) {
    double squares = 0, count = 0;
    for (int v = 0; v < depth_m.rows; v += 8)
        for (int u = 0; u < depth_m.cols; u += 8) {
            if (!(depth_m(v, u) > 0))
                continue;
            const Eigen::Vector3d in_depth = depth_m(v, u) * ray_of(depth_camera, Eigen::Vector2d(u, v));
            const Eigen::Vector3d wanted = truth.colour_from_depth * in_depth,
                                  found = pose_from_parameters(model.values.data() + rotation_x) * in_depth;
            const Model right = model_of(truth.camera);
            Eigen::Vector2d a, b;
            pixel_of(right.lens, right.values.data(), wanted.data(), a.data());
            pixel_of(model.lens, model.values.data(), found.data(), b.data());
            squares += (a - b).squaredNorm();
            ++count;
        }
    return std::sqrt(squares / count);
}

TEST(SecondaryCamera, AgreementIsAboveChance) {
    const Camera depth_camera{{585, 585, 320, 240, {640, 480}}, {}, "depth"};
    ColourCamera truth{{{530, 530, 319.5, 239.5, {640, 480}}, {}, "truth"}, Eigen::Isometry3d::Identity()};
    truth.colour_from_depth.translation() = Eigen::Vector3d(-0.04, 0.003, -0.002);
    const std::vector<SequenceFrame> frames = frames_of_secondary(depth_camera, truth, 0, 1, 3);
    Model right = model_of(truth.camera);
    to_pose_parameters(truth.colour_from_depth, right.values.data() + rotation_x);
    const auto sigmas = [&](double off_px) {
        Model off = right;
        off[cx] += off_px; // both axes: a translation along a straight edge is invisible
        off[cy] += off_px;
        return outline_agreement(frames, depth_camera, off, expected_gap_px).sigmas();
    };
    std::printf("sigmas above chance: %.1f, 15 px off %.1f and %.1f\n", sigmas(0), sigmas(15), sigmas(-15));
    EXPECT_GT(sigmas(0), 5);
    EXPECT_LT(sigmas(15), 3);
    EXPECT_LT(sigmas(-15), 3);
}

TEST(SecondaryCamera, ColourIsRegisteredWithDepth) {
    const Camera depth_camera{{585, 585, 320, 240, {640, 480}}, {}, "depth"};
    ColourCamera truth{{{530, 530, 319.5, 239.5, {640, 480}}, {}, "truth"}, Eigen::Isometry3d::Identity()};
    truth.colour_from_depth.linear() = Eigen::AngleAxisd(0.02, Eigen::Vector3d(2, -1, 2) / 3).toRotationMatrix();
    truth.colour_from_depth.translation() = Eigen::Vector3d(-0.04, 0.003, -0.002);
    const Camera guess{{505, 505, 319.5, 239.5, {640, 480}}, {}, "guess"};
    const std::vector<SequenceFrame> frames = frames_of_secondary(depth_camera, truth);
    std::vector<double> off_px;
    for (const bool outlines : {false, true}) {
        SequenceOptions how;
        how.registered = how.refine_poses = false;
        how.outlines = outlines;
        Sequence sequence(frames, depth_camera, model_of(guess), how);
        std::vector<ParameterGroup> groups = camera_groups(LensModel::brown_conrady);
        groups.insert(groups.begin(), extrinsics_group());
        RefineOptions options;
        options.selection.guessed = true;
        options.selection.folds = 3;
        options.selection.least_sigmas = 5;
        const Refinement r =
            refine(sequence, guess, groups, options, sequence.degeneracy(sequence.start(model_of(guess))));
        const Fit& fit = r.selection.fit;
        const auto error_px = [&](const Model& model) {
            return warp_error_px(depth_camera, frames[3].depth_m, model, truth);
        };
        std::printf(
            "%s outlines: %zu points, %zu of outlines; f %.1f +- %.1f (530), translation %.1f %.1f %.1f +- %.1f mm "
            "(-40 3 -2), off "
            "%.2f px, %.2f before; held out %.2f -> %.2f\n",
            outlines ? "with" : "without", sequence.points(), sequence.outline_points(), fit.model[f], fit.sigma(f),
            1000 * fit.model[translation_x], 1000 * fit.model[translation_y], 1000 * fit.model[translation_z],
            1000 * fit.sigma(translation_x), error_px(fit.model), error_px(model_of(guess)),
            r.selection.held_out_before_px, r.selection.held_out_px);
        ASSERT_TRUE(r.selection.free[f] && r.selection.free[rotation_x]);
        EXPECT_NEAR(fit.model[f], 530, 8) << steps_of(r);
        EXPECT_LT(r.selection.held_out_px, 0.5 * r.selection.held_out_before_px);
        off_px.push_back(error_px(fit.model));
    }
    EXPECT_LT(off_px[1], 0.2 * warp_error_px(depth_camera, frames[3].depth_m, model_of(guess), truth));
    EXPECT_LT(off_px[1], 0.5 * off_px[0]); // points alone hardly distinguish a translation from a rotation
}

/// Errors in sigmas of one number over several trials.
struct Trials {
    std::vector<double> sigmas_off;
    [[nodiscard]] double within_two() const {
        const auto inside =
            std::count_if(sigmas_off.begin(), sigmas_off.end(), [](double z) { return std::abs(z) < 2; });
        return static_cast<double>(inside) / static_cast<double>(sigmas_off.size());
    }
    [[nodiscard]] double rms() const {
        double squares = 0;
        for (const double z : sigmas_off)
            squares += z * z;
        return std::sqrt(squares / static_cast<double>(sigmas_off.size()));
    }
};

/// Each trial has its own part of the walk, noise and colour camera. A test runs 2 of them; SCANSHADE_TRIALS and
/// SCANSHADE_FIRST_TRIAL choose others.
TEST(SecondaryCamera, SigmasAreHonest) {
    const auto number_from = [](const char* name, int otherwise) {
        const char* text = std::getenv(name);
        return text ? std::atoi(text) : otherwise;
    };
    const int trials = number_from("SCANSHADE_TRIALS", 2), first_trial = number_from("SCANSHADE_FIRST_TRIAL", 2);
    const Camera depth_camera{{585, 585, 320, 240, {640, 480}}, {}, "depth"};
    const Camera guess{{525, 525, 319.5, 239.5, {640, 480}}, {}, "guess"};
    const std::vector<Unknown> numbers = {
        f, rotation_x, rotation_y, rotation_z, translation_x, translation_y, translation_z};
    std::map<Unknown, Trials> by_number;
    Trials all;
    for (int trial = first_trial; trial < first_trial + trials; ++trial) {
        cv::RNG random(static_cast<std::uint64_t>(trial) + 1);
        const auto three = [&](double sigma) {
            return Eigen::Vector3d(random.gaussian(sigma), random.gaussian(sigma), random.gaussian(sigma));
        };
        const double f_px = 530 + random.uniform(-15.0, 15.0);
        ColourCamera truth{{{f_px, f_px, 319.5, 239.5, {640, 480}}, {}, "truth"}, Eigen::Isometry3d::Identity()};
        truth.colour_from_depth.linear() = Eigen::AngleAxisd(0.02, three(1).normalized()).toRotationMatrix();
        truth.colour_from_depth.translation() = Eigen::Vector3d(-0.04, 0, 0) + three(0.005);
        Model right = model_of(truth.camera);
        to_pose_parameters(truth.colour_from_depth, right.values.data() + rotation_x);
        constexpr double walk_s = 16, golden = 0.618;
        const double start_s = walk_s * std::fmod(golden * trial, 1.0);
        SequenceOptions how;
        how.registered = how.refine_poses = false;
        try {
            const Sequence sequence(frames_of_secondary(depth_camera, truth, start_s, trial + 1), depth_camera,
                                    model_of(guess), how);
            Free free{};
            for (const Unknown number : numbers)
                free[number] = true;
            const Fit fit = sequence.fit(sequence.start(model_of(guess)), free, Views(sequence.views(), true), true);
            ASSERT_GT(fit.covariance.size(), 0);
            std::printf("trial %d: %zu points, %zu of outlines, ", trial, sequence.points(), sequence.outline_points());
            for (const Unknown number : numbers) {
                const double off = fit.model[number] - right[number];
                by_number[number].sigmas_off.push_back(off / fit.sigma(number));
                all.sigmas_off.push_back(off / fit.sigma(number));
                std::printf("%s %.4f +- %.4f%s", std::string(name_of(number)).c_str(), off, fit.sigma(number),
                            number == translation_z ? "\n" : ", ");
            }
        } catch (const Error& failure) { // a wall without texture
            std::printf("trial %d: %s\n", trial, failure.what());
        }
    }
    for (const auto& [number, of_number] : by_number)
        std::printf("%s: within 2 sigma %.0f %%, rms %.2f sigma\n", std::string(name_of(number)).c_str(),
                    100 * of_number.within_two(), of_number.rms());
    ASSERT_GE(all.sigmas_off.size(), numbers.size() * static_cast<std::size_t>(trials) / 2);
    std::printf("all: within 2 sigma %.1f %%, rms %.2f sigma\n", 100 * all.within_two(), all.rms());
    EXPECT_GE(all.within_two(), trials < 20 ? 0.75 : 0.93); // few trials are correlated
    EXPECT_LT(all.rms(), 3);
    EXPECT_GT(all.rms(), 1.0 / 3);
}

// ---------------------------------------------------------------------------------------------------- derivatives

/// Ceres's Jets against central differences, all blocks of a residual.
template <class Residual, int residuals, int... sizes>
void expect_right_derivatives(const Residual& residual, std::vector<std::vector<double>> at) {
    const ceres::AutoDiffCostFunction<Residual, residuals, sizes...> automatic(new Residual(residual));
    const ceres::NumericDiffCostFunction<Residual, ceres::CENTRAL, residuals, sizes...> numeric(new Residual(residual));
    const std::vector<int> widths = {sizes...};
    std::vector<const double*> parameters;
    std::vector<std::vector<double>> by_automatic, by_numeric;
    std::vector<double*> to_automatic, to_numeric;
    for (std::size_t i = 0; i < at.size(); ++i) {
        parameters.push_back(at[i].data());
        by_automatic.emplace_back(residuals * widths[i]);
        by_numeric.emplace_back(residuals * widths[i]);
    }
    for (std::size_t i = 0; i < at.size(); ++i) {
        to_automatic.push_back(by_automatic[i].data());
        to_numeric.push_back(by_numeric[i].data());
    }
    double values[residuals];
    ASSERT_TRUE(automatic.Evaluate(parameters.data(), values, to_automatic.data()));
    ASSERT_TRUE(numeric.Evaluate(parameters.data(), values, to_numeric.data()));
    for (std::size_t block = 0; block < at.size(); ++block)
        for (std::size_t i = 0; i < by_automatic[block].size(); ++i)
            EXPECT_NEAR(by_automatic[block][i], by_numeric[block][i],
                        2e-5 * std::max(1.0, std::abs(by_automatic[block][i])))
                << "block " << block << ", entry " << i;
}

TEST(Derivatives, OfEveryResidualOfRecordingsAgreeWithNumericOnes) {
    const Motion motion{{0.3, -0.2, 0.1}, {0.2, 0.1, -0.3}};
    const std::vector<double> depth = {1.02, -0.01, 0.003}, extrinsics = {0.02, -0.03, 0.01, 0.03, 0.002, -0.004},
                              clock = {0.01}, pose = {0.3, -0.2, 0.1, 0.2, -0.1, 0.3}, point = {0.3, -0.2, 1.9};
    for (const LensModel lens : {LensModel::brown_conrady, LensModel::kannala_brandt}) {
        const std::vector<double> camera = {530, 0.99, 322, 238, -0.1, 0.03, 0.002, -0.001, 0.01, -0.01, 0.02, 0.003};
        expect_right_derivatives<ObservationResidual, 2, camera_unknowns, 1, 6, 3>(
            {lens, {300, 200}, motion, 0.004, 1.5}, {camera, clock, pose, point});
        expect_right_derivatives<SecondaryObservationResidual, 2, camera_unknowns, extrinsic_unknowns, 1, 6, 3>(
            {lens, {300, 200}, motion, 0.004, 1.5}, {camera, extrinsics, clock, pose, point});
        expect_right_derivatives<FixedPoseObservationResidual, 2, camera_unknowns, extrinsic_unknowns, 1, 3>(
            {lens, {300, 200}, motion, 0.004, 1.5, pose_from_parameters(pose.data())},
            {camera, extrinsics, clock, point});
        // Numeric differences see the lens's Newton iteration only to its tolerance of 1e-10.
        expect_right_derivatives<OutlineResidual, 1, camera_unknowns, extrinsic_unknowns, 1, 1>(
            {lens, {0.3, -0.2, 1.9}, {0.003, -0.001, 0}, {400, 180}, {0.6, 0.8}, motion, 0.004, 1.5},
            {camera, extrinsics, clock, {0.7}});
        expect_right_derivatives<PlaneResidual, 1, camera_unknowns, depth_unknowns, 6, 3>(
            {lens, {420, 130}, 1.8, {0.2, -0.1, 0.3}, 10}, {camera, depth, pose, {0.2, 0.1, 0.5}});
    }
    expect_right_derivatives<DepthResidual, 1, depth_unknowns, 1, 6, 3>({1.8, motion, 100},
                                                                        {depth, clock, pose, point});
    expect_right_derivatives<SurfaceResidual, 1, 6, 3>({{0.1, 0.2, 2}, {0, 0.6, -0.8}, 100}, {pose, point});
    expect_right_derivatives<PosePriorResidual, 6, 6>(
        {Eigen::Quaterniond(0.9, 0.1, -0.3, 0.2).normalized(), {1, 2, 3}, 10, 20}, {pose});
}

} // namespace
} // namespace scanshade
