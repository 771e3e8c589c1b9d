// Frames of a recording together: what other views add, what averaging takes away, and that nothing is ever worse than
// a frame by itself.
#include "ao/gpu/device.h"
#include "ao/sequence/sequence_ao.h"
#include "ao/surfel/surfel.h"
#include "apps/scenes/generate.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "apps/walk/batch.h"
#include "apps/walk/sequence_order.h"
#include "io/clouds/cloud_file.h"
#include "tests/support/small_capture.h"
#include "tests/support/watched.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double radius_m = 0.5;

gpu::Device& device() { return tests::watched_device(); }

Pinhole small_camera() { return {262.5, 262.5, 159.5, 119.5, {320, 240}}; }

struct Recorded {
    DepthImage depth;
    cv::Mat1f exact_m;
    Isometry3d pose;
};

const scene::World& world_of(const char* name) {
    static std::map<std::string, scene::World> worlds;
    return worlds.try_emplace(name, scene::scene_named(name)).first->second;
}

/// Frames `step_s` apart on the scene's walk, the middle one at `seconds`.
std::vector<Recorded> walk(const char* name, const char* sensor, double seconds, double step_s, int frames) {
    std::vector<Recorded> all;
    const int middle = frames / 2;
    for (int i = 0; i < frames; ++i) {
        const scene::World& world = world_of(name);
        const Isometry3d pose = scene::world_from_camera(world.scene().walk, seconds + (i - middle) * step_s);
        const Sight sight{world, small_camera(), pose, render_geometry(world, small_camera(), pose), 1, i};
        all.push_back({{small_camera(), sensor_named(sensor).record(sight), {}}, sight.exact.z_m, pose});
    }
    return all;
}

cv::Mat1f truth_of(const char* name, const Recorded& frame) {
    return scene::true_visibility(world_of(name), small_camera(), frame.pose, {radius_m, 128, 1, false}).visibility[0];
}

/// Root mean square difference where both are known.
double rms(const cv::Mat1f& a, const cv::Mat1f& b) {
    double sum = 0;
    int count = 0;
    for (int i = 0; i < static_cast<int>(a.total()); ++i)
        if (!std::isnan(a(i)) && !std::isnan(b(i))) {
            sum += (a(i) - b(i)) * (a(i) - b(i));
            ++count;
        }
    return std::sqrt(sum / count);
}

bool same_bytes(const cv::Mat1f& a, const cv::Mat1f& b) {
    return a.size() == b.size() && std::memcmp(a.data, b.data, a.total() * 4) == 0;
}

SurfelOptions with(Quality quality) {
    SurfelOptions options;
    options.quality = quality;
    return options;
}

SequenceAoOptions only(int fuse, int layers, int average, int reach = 12) {
    SequenceAoOptions options;
    options.fuse = fuse;
    options.layers = layers;
    options.average = average;
    options.reach = reach;
    return options;
}

const DepthNoise kinect{0.0015, 0.0018, 3};

SequenceAoResult together(const std::vector<Recorded>& frames, const SequenceAoOptions& options, std::size_t place,
                          const DepthNoise& noise = {}, Quality level = Quality::high) {
    Surfel surfel(device(), with(level));
    SequenceAo sequence(device(), surfel, radius_m, noise, {}, options);
    for (std::size_t i = 0; i < frames.size(); ++i)
        sequence.add(i, frames[i].depth, frames[i].pose);
    return sequence.compute(place);
}

TEST(Sequence, a_frame_without_pose_is_what_it_is_by_itself) {
    const auto frames = walk("clutter", "ideal", 3, 0.2, 3);
    Surfel surfel(device(), with(Quality::high));
    SequenceAo sequence(device(), surfel, radius_m, {}, {}, {});
    for (std::size_t i = 0; i < 3; ++i)
        sequence.add(i, frames[i].depth, i == 1 ? std::nullopt : std::optional(frames[i].pose));
    const SequenceAoResult result = sequence.compute(1);
    EXPECT_TRUE(result.neighbours.empty() && result.averaged.empty());
    // The pattern of samples goes with the frame's place.
    View view{frames[1].depth};
    view.instant = 1;
    EXPECT_TRUE(same_bytes(result.ao.visibility, surfel.compute(view).visibility));
}

TEST(Sequence, few_others_are_expected_to_bring_less_than_a_dozen) {
    EXPECT_EQ(share_of_gain(0), 0);
    EXPECT_NEAR(share_of_gain(2), 0.58, 0.01);
    EXPECT_EQ(share_of_gain(12), 1);
    EXPECT_EQ(share_of_gain(30), 1);
    SequenceAoResult result;
    result.fused = {4, 6};
    result.neighbours = {1, 6};
    result.averaged = {4, 5, 6};
    EXPECT_EQ(result.others(), 4U) << "each counts once";
}

TEST(Sequence, other_views_see_what_hides_from_one) {
    double before = 0, after = 0;
    for (const char* name : {"office", "clutter", "columns"}) {
        const auto frames = walk(name, "ideal", 5.5, 0.6, 9);
        const cv::Mat1f truth = truth_of(name, frames[4]);
        const double one = rms(together(frames, alone(), 4).ao.visibility, truth);
        const SequenceAoResult seen = together(frames, only(0, 6, 0, 4), 4);
        const double seven = rms(seen.ao.visibility, truth);
        EXPECT_EQ(seen.neighbours.size(), 6U);
        EXPECT_LT(seven, 0.97 * one) << name;
        std::printf("%-8s one view %.4f, seven %.4f\n", name, one, seven);
        before += one * one;
        after += seven * seven;
    }
    EXPECT_LT(std::sqrt(after), 0.92 * std::sqrt(before));
}

TEST(Sequence, noisy_depth_is_averaged_before_its_planes_are_fitted) {
    for (const char* name : {"office", "clutter"}) {
        const auto frames = walk(name, "kinect", 5.5, 0.1, 9);
        const cv::Mat1f truth = truth_of(name, frames[4]);
        const double one = rms(together(frames, alone(), 4, kinect).ao.visibility, truth);
        const SequenceAoResult fused = together(frames, only(8, 0, 0), 4, kinect);
        EXPECT_EQ(fused.fused.size(), 8U);
        const double nine = rms(fused.ao.visibility, truth);
        EXPECT_LT(nine, 0.98 * one) << name; // one frame is 0.0015 better since its slopes are fitted, nine 0.0007
        std::printf("%-8s Kinect, one frame %.4f, nine %.4f\n", name, one, nine);
    }
}

TEST(Sequence, holes_that_other_frames_saw_into_occlude_but_have_no_value) {
    auto frames = walk("clutter", "ideal", 5.5, 0.1, 9);
    const DepthNoise noise{0.0005, 0.0002};
    const auto seen = [&] { return together(frames, only(8, 0, 0), 4, noise); };
    const cv::Mat1f whole = seen().ao.visibility;
    // Only this frame misses what is nearest to the middle of the image: without it, all around would be too open.
    cv::Mat1f& z_m = frames[4].depth.z_m;
    z_m = z_m.clone();
    const cv::Rect hole(z_m.cols / 2 - 40, z_m.rows / 2 - 30, 80, 60);
    z_m(hole).setTo(0);
    const SequenceAoResult filled = seen();
    const double with = rms(filled.ao.visibility, whole),
                 without = rms(together(frames, alone(), 4, noise).ao.visibility, whole);
    std::printf("a hole changes its surroundings by %.4f filled, %.4f not filled\n", with, without);
    EXPECT_LT(with, 0.25 * without);
    for (int v = hole.y; v < hole.br().y; ++v)
        for (int u = hole.x; u < hole.br().x; ++u) {
            ASSERT_TRUE(std::isnan(filled.ao.visibility(v, u))) << u << ", " << v;
            ASSERT_EQ(filled.depth.z_m(v, u), 0) << u << ", " << v;
        }
}

TEST(Sequence, a_frame_whose_pose_is_wrong_is_left_out) {
    auto frames = walk("office", "ideal", 5.5, 0.3, 3);
    const cv::Mat1f by_itself =
        together({frames[0], frames[1]}, only(0, 2, 2, 1), 1).ao.visibility; // without the last one
    frames[2].pose = frames[2].pose * Eigen::Translation3d(0.4, 0, 0) * Eigen::AngleAxisd(0.2, Vector3d::UnitY());
    const SequenceAoResult result = together(frames, only(0, 2, 2, 1), 1);
    ASSERT_EQ(result.left_out.size(), 1U);
    EXPECT_EQ(result.left_out[0].index, 2U);
    EXPECT_EQ(result.neighbours, std::vector<std::size_t>{0});
    EXPECT_TRUE(same_bytes(result.ao.visibility, by_itself));
}

TEST(Sequence, poses_off_by_a_centimetre_and_half_a_degree_cost_little) {
    auto frames = walk("office", "ideal", 5.5, 0.3, 9);
    const cv::Mat1f truth = truth_of("office", frames[4]);
    const double one = rms(together(frames, alone(), 4).ao.visibility, truth);
    const double exact = rms(together(frames, only(0, 6, 4, 4), 4).ao.visibility, truth);
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const double sign = i % 2 == 0 ? 1 : -1;
        const Vector3d axis = Vector3d(sign, static_cast<double>(i % 3) - 1, 0.5).normalized();
        frames[i].pose = frames[i].pose * Eigen::Translation3d(0.01 * sign, -0.01, 0.01 * sign) *
                         Eigen::AngleAxisd(0.5 * std::numbers::pi / 180, axis);
    }
    const double off = rms(together(frames, only(0, 6, 4, 4), 4).ao.visibility, truth);
    std::printf("one view %.4f, exact poses %.4f, poses with errors %.4f\n", one, exact, off);
    EXPECT_LT(off, one);
    EXPECT_LT(off, exact + 0.01);
}

TEST(Sequence, averaging_a_static_camera_leaves_the_mean_of_all_patterns) {
    const std::vector<Recorded> frames(31, walk("office", "ideal", 5.5, 0.1, 1)[0]);
    Surfel surfel(device(), with(Quality::low));
    cv::Mat1d sum(240, 320, 0.0);
    std::vector<cv::Mat1f> each;
    for (int i = 0; i < 31; ++i) {
        View view{frames[0].depth};
        view.instant = i;
        each.push_back(surfel.compute(view).visibility);
        cv::Mat1d wide;
        each.back().convertTo(wide, CV_64F);
        sum += wide;
    }
    cv::Mat1f mean;
    cv::Mat(sum / 31).convertTo(mean, CV_32F);
    SequenceAo sequence(device(), surfel, radius_m, {}, {}, only(0, 0, 30));
    for (std::size_t i = 0; i < frames.size(); ++i)
        sequence.add(i, frames[i].depth, frames[i].pose);
    const SequenceAoResult result = sequence.compute(15);
    EXPECT_LT(rms(result.ao.visibility, mean), 1e-4);
    const Intermediate averaged_frames = sequence.intermediates().at(0);
    EXPECT_NEAR(reinterpret_cast<const float*>(averaged_frames.data.data())[120 * 320 + 160], 31, 0.1);
    // Noise falls as the root of the number of frames: between means of 15 and 15 others.
    cv::Mat1f first(240, 320, 0.0F), second(240, 320, 0.0F);
    for (int i = 0; i < 15; ++i) {
        first += each[static_cast<std::size_t>(i)] / 15;
        second += each[static_cast<std::size_t>(i) + 15] / 15;
    }
    const double noise_of_one = rms(each[0], each[16]), noise_of_15 = rms(first, second);
    std::printf("between two frames %.5f, between means of 15 %.5f\n", noise_of_one, noise_of_15);
    EXPECT_LT(noise_of_15, 1.3 * noise_of_one / std::sqrt(15.0));

    const cv::Mat1f truth = truth_of("office", frames[0]);
    const double of_64 = rms(together(frames, alone(), 15, {}, Quality::highest).ao.visibility, truth),
                 averaged = rms(result.ao.visibility, truth);
    std::printf("error: 30 frames of 8 reads %.4f, one of 64 %.4f\n", averaged, of_64);
    EXPECT_LT(averaged, of_64 + 0.007);
}

/// Mean over points of the deviation in time of what frames say of them; seen in every frame, told by exact depth.
double flicker(const std::vector<Recorded>& frames, const std::vector<cv::Mat1f>& visibility, std::size_t first,
               std::size_t last) {
    const std::size_t middle = (first + last) / 2;
    const Pinhole camera = small_camera();
    double sum = 0;
    int points = 0;
    for (int v = 4; v < 240; v += 4)
        for (int u = 4; u < 320; u += 4) {
            const double z = frames[middle].exact_m(v, u);
            const Vector3d point = frames[middle].pose * camera.point(u, v, z);
            double m = 0, m2 = 0;
            bool always = z > 0;
            for (std::size_t i = first; always && i <= last; ++i) {
                const Vector3d there = frames[i].pose.inverse() * point;
                const int x = cvRound(camera.fx * there.x() / there.z() + camera.cx),
                          y = cvRound(camera.fy * there.y() / there.z() + camera.cy);
                always = x >= 0 && y >= 0 && x < 320 && y < 240 &&
                         std::abs(frames[i].exact_m(y, x) - there.z()) < 0.01 * z && !std::isnan(visibility[i](y, x));
                if (!always)
                    break;
                m += visibility[i](y, x);
                m2 += visibility[i](y, x) * visibility[i](y, x);
            }
            if (!always)
                continue;
            const auto n = static_cast<double>(last - first + 1);
            sum += std::sqrt(std::max(m2 / n - m * m / n / n, 0.0));
            ++points;
        }
    return sum / points;
}

TEST(Sequence, static_points_flicker_far_less) {
    const auto frames = walk("office", "kinect", 5.5, 1.0 / 30, 25);
    const auto all = [&](const SequenceAoOptions& options) {
        Surfel surfel(device(), with(Quality::high));
        SequenceAo sequence(device(), surfel, radius_m, kinect, {}, options);
        for (std::size_t i = 0; i < frames.size(); ++i)
            sequence.add(i, frames[i].depth, frames[i].pose);
        std::vector<cv::Mat1f> visibility(frames.size());
        for (std::size_t i = 8; i <= 16; ++i)
            visibility[i] = sequence.compute(i).ao.visibility;
        return visibility;
    };
    const double before = flicker(frames, all(alone()), 8, 16), after = flicker(frames, all(only(12, 0, 12)), 8, 16);
    std::printf("flicker of static points: %.4f frame by frame, %.4f together\n", before, after);
    // Frames by themselves flickered by 0.0182 until their fit took waves for noise: a third of that is the bound.
    EXPECT_LT(after, 0.0182 / 3);
    EXPECT_LT(after, before / 2.5);
}

/// Runs some frames of a recording as `run --sequence on --cloud` does.
std::vector<FrameRow> run_together(const Capture& capture, const std::vector<std::size_t>& frames,
                                   const std::filesystem::path& out, RecordingCloud* cloud = nullptr) {
    Surfel surfel(device(), with(Quality::low));
    SequenceAo sequence(device(), surfel, radius_m, kinect, {}, only(2, 2, 2, 2));
    BatchOptions options;
    options.frames = frames;
    options.outputs.folder = out;
    options.radius_m = radius_m;
    options.noise = kinect;
    options.sequence = &sequence;
    options.cloud = cloud;
    FrameAo door(surfel);
    MethodPool pool(door);
    return run_batch(capture, pool, options);
}

TEST(Sequence, a_block_of_frames_writes_the_same_bytes_and_a_bad_frame_fails_alone) {
    const tests::TemporaryFolder folder;
    GenerateOptions made{.frames = 9, .size = "160x120"};
    made.truth = false;
    generate(made, folder / "capture");
    std::vector<std::filesystem::path> depths;
    for (const auto& file : std::filesystem::directory_iterator(folder / "capture" / "depth"))
        depths.push_back(file);
    std::ranges::sort(depths);
    std::filesystem::resize_file(depths[6], 100);
    const Capture capture = open_capture(folder / "capture");
    RecordingCloud cloud(0);
    const auto rows = run_together(capture, {0, 1, 2, 3, 4, 5, 6, 7, 8}, folder / "whole", &cloud);
    ASSERT_EQ(rows.size(), 9U);
    for (const FrameRow& row : rows)
        EXPECT_EQ(row.status, row.index == 6 ? FrameStatus::failed : FrameStatus::ok) << row.index << row.why;
    EXPECT_FALSE(rows[4].notes.empty());
    (void)run_together(capture, {3, 4}, folder / "block");
    for (const std::size_t index : {3U, 4U})
        for (const auto& file : rows[index].files)
            EXPECT_EQ(tests::read_bytes(folder / "whole" / file), tests::read_bytes(folder / "block" / file)) << file;

    cloud.write(folder / "all.ply");
    std::vector<std::string> warnings;
    const Cloud all = read_cloud(folder / "all.ply", warnings);
    EXPECT_EQ(all.points.size(), cloud.points());
    EXPECT_LT(all.points.size(), 8U * 160 * 120 * 2 / 3) << "hardly anything was merged";
    EXPECT_FALSE(all.colours.empty());
    // What was merged lies where the scene is: an office of a few metres.
    for (const Vector3d& point : all.points)
        ASSERT_LT(point.norm(), 10);
}

TEST(Sequence, what_was_removed_is_gone_beyond_the_window) {
    scene::Scene with{.name = "with", .summary = ""}, without{.name = "without", .summary = ""};
    const scene::Plane wall{{0, 3, 0}, {0, -1, 0}}, floor{{0, 0, -1}, {0, 0, 1}};
    without.bodies = {{wall, {}}, {floor, {}}};
    with.bodies = without.bodies;
    with.bodies.push_back({scene::Box{{0, 2.6, -0.5}, {0.3, 0.3, 0.5}}, {}});
    const scene::World full(with), empty(without);
    std::vector<Recorded> frames, never;
    for (int i = 0; i < 20; ++i) {
        const Isometry3d pose = scene::looking_at({0.01 * i, 0, 0}, {0, 3, -0.3});
        const auto record = [&](const scene::World& world) {
            const auto geometry = render_geometry(world, small_camera(), pose);
            return Recorded{{small_camera(), geometry.z_m, {}}, geometry.z_m, pose};
        };
        frames.push_back(record(i < 8 ? full : empty));
        never.push_back(record(empty));
    }
    const SequenceAoOptions options = only(0, 0, 8);
    const cv::Mat1f later = together(frames, options, 12).ao.visibility,
                    clean = together(never, options, 12).ao.visibility;
    EXPECT_TRUE(same_bytes(later, clean));
    // Where the box stood, the frame after has only its own side of time: no ghost of the box itself.
    const cv::Mat1f after = together(frames, options, 8).ao.visibility, own = together(never, alone(), 8).ao.visibility;
    double ghost = 0;
    int uncovered = 0;
    for (int i = 0; i < 320 * 240; ++i)
        if (frames[7].exact_m(i) < frames[8].exact_m(i) - 0.1) {
            ghost += std::abs(after(i) - own(i));
            ++uncovered;
        }
    ASSERT_GT(uncovered, 1000);
    EXPECT_LT(ghost / uncovered, 0.02);
}

TEST(Sequence, a_thin_board_has_two_sides) {
    // A board of 5 mm, with fins behind it: its back is dark between them, its front is open. Both lie within the
    // tolerance of what counts as the same surface, so that normals alone tell them apart.
    scene::Scene scene{.name = "board", .summary = ""};
    scene.bodies = {{scene::Plane{{0, 0, -1}, {0, 0, 1}}, {}}, {scene::Box{{0, 0, -0.6}, {0.3, 0.0025, 0.4}}, {}}};
    for (const double x : {-0.24, -0.12, 0.0, 0.12, 0.24})
        scene.bodies.push_back({scene::Box{{x, 0.06, -0.6}, {0.005, 0.06, 0.4}}, {}});
    const scene::World world(scene);
    std::vector<Recorded> frames;
    for (const double y : {-1.6, 1.6}) {
        const Isometry3d pose = scene::looking_at({0, y, 0.6}, {0, 0, -0.7});
        const auto geometry = render_geometry(world, small_camera(), pose);
        frames.push_back({{small_camera(), geometry.z_m, {}}, geometry.z_m, pose});
    }
    const cv::Mat1f own = together(frames, alone(), 0).ao.visibility;
    const SequenceAoResult both = together(frames, only(0, 0, 2), 0);
    ASSERT_EQ(both.averaged.size(), 1U) << "the floor fits";
    double apart = 0;
    int front = 0;
    for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u) {
            const Vector3d point = frames[0].pose * small_camera().point(u, v, frames[0].exact_m(v, u));
            if (frames[0].exact_m(v, u) > 0 && std::abs(point.y() + 0.0025) < 1e-3 && point.z() > -0.9) {
                apart += std::abs(both.ao.visibility(v, u) - own(v, u));
                ++front;
            }
        }
    ASSERT_GT(front, 3000);
    EXPECT_LT(apart / front, 0.005); // 0.11 were the back averaged with it
}

TEST(Sequence, what_an_outage_keeps_away_is_waited_for_by_its_neighbours) {
    Surfel surfel(device(), {});
    SequenceAo sequence(device(), surfel, radius_m, {}, {}, only(0, 0, 1));
    ASSERT_EQ(sequence.reach(), 1U);
    SequenceBuffer buffer(&sequence);
    std::vector<CaptureEntry> entries(5);
    std::vector<FrameRow> rows(5);
    const auto pass = [&](std::size_t i) { (void)buffer.pass(std::make_shared<Work>(Work{entries[i], rows[i]})); };
    for (std::size_t i = 0; i < rows.size(); ++i) {
        rows[i].index = i;
        if (i == 1) {
            rows[i].fault = Fault::outage;
            rows[i].why = "the share is gone";
        } else if (i == 4) { // a damaged file stays away for good
            rows[i].fault = Fault::input;
            rows[i].why = "cut off";
        }
        pass(i);
    }
    while (buffer.pass({}))
        ;
    for (const std::size_t i : {0, 1, 2}) {
        EXPECT_EQ(rows[i].fault, Fault::outage) << i;
        EXPECT_NE(rows[i].why.find("the share is gone"), std::string::npos) << rows[i].why;
    }
    EXPECT_EQ(rows[3].why, "");
    EXPECT_EQ(rows[4].fault, Fault::input);
}

} // namespace
} // namespace scanshade
