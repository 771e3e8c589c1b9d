// Clouds merged from depth frames: found frames are computed as images, and every point gets the mean of both ways.
#include "ao/cloud/cloud_ao.h"
#include "ao/merged_cloud.h"
#include "apps/scenes/generate.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/sensor.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "projection/sensor/noise.h"
#include "tests/support/watched.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <map>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double radius_m = 0.5;
const Pinhole camera{175, 175, 106.5, 79.8, {214, 160}};

struct Merged {
    std::vector<Vector3d> points;
    std::vector<float> truth;
    std::vector<DepthImage> recorded;
    std::vector<FoundFrame> frames;
};

/// So many frames of a scene's walk in world coordinates, as single-precision files have them, with true visibility.
/// Depth is recorded in whole numbers of a unit, or as it is (0).
Merged merged(const char* name, const char* sensor, int frames, double units_per_metre = 0) {
    const scene::World world(scene::scene_named(name));
    Merged all;
    for (int frame = 0; frame < frames; ++frame) {
        const Isometry3d pose = scene::world_from_camera(world.scene().walk, 2 + 0.5 * frame);
        const Sight sight{world, camera, pose, render_geometry(world, camera, pose), 1, frame};
        cv::Mat1f z = sensor_named(sensor).record(sight);
        for (float& depth : z)
            if (units_per_metre > 0)
                depth = static_cast<float>(std::round(units_per_metre * static_cast<double>(depth)) / units_per_metre);
        all.recorded.push_back({camera, z, {}});
        const std::size_t first = all.points.size();
        const cv::Mat1f truth = scene::true_visibility(world, camera, pose, {radius_m, 64, 1, false}).visibility[0];
        for (int v = 0; v < z.rows; ++v)
            for (int u = 0; u < z.cols; ++u)
                if (z(v, u) > 0) {
                    const Vector3d point = pose * camera.point(u, v, static_cast<double>(z(v, u)));
                    all.points.push_back(point.cast<float>().cast<double>());
                    all.truth.push_back(truth(v, u));
                }
        all.frames.push_back({camera, pose, first, all.points.size()});
    }
    return all;
}

/// The means of points within cubes, as a joined cloud of a recording has them: a cube belongs to the first frame that
/// saw it.
Merged joined(const Merged& cloud, double cube) {
    Merged all;
    std::map<std::array<int, 3>, std::size_t> cubes;
    std::vector<double> counts, truths;
    for (const FoundFrame& frame : cloud.frames) {
        const std::size_t first = all.points.size();
        for (std::size_t i = frame.first; i < frame.last; ++i) {
            const Eigen::Array3i at = (cloud.points[i] / cube).array().floor().cast<int>();
            const auto [known, is_new] = cubes.try_emplace({at.x(), at.y(), at.z()}, all.points.size());
            if (is_new) {
                all.points.emplace_back(Vector3d::Zero());
                counts.push_back(0);
                truths.push_back(0);
            }
            all.points[known->second] += cloud.points[i];
            truths[known->second] += static_cast<double>(cloud.truth[i]);
            ++counts[known->second];
        }
        all.frames.push_back({frame.camera, frame.world_from_camera, first, all.points.size()});
    }
    for (std::size_t i = 0; i < all.points.size(); ++i) {
        all.points[i] /= counts[i];
        all.truth.push_back(static_cast<float>(truths[i] / counts[i]));
    }
    return all;
}

double rmse(const std::vector<float>& found, const std::vector<float>& truth) {
    double sum = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < found.size(); ++i)
        if (!std::isnan(found[i]) && !std::isnan(truth[i])) {
            sum += std::pow(static_cast<double>(found[i]) - static_cast<double>(truth[i]), 2);
            ++count;
        }
    return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(count, 1)));
}

bool any_note(const PointVisibility& found, const std::string& words) {
    return std::ranges::any_of(found.notes,
                               [&](const std::string& note) { return note.find(words) != std::string::npos; });
}

MergedImages on_device() {
    return {[]() -> gpu::Device& { return tests::watched_device(); }};
}

PointVisibility computed(const std::vector<Vector3d>& points, const CloudAoOptions& options = {.radius = radius_m},
                         const MergedImages& images = on_device()) {
    return MergedCloudAo(options, nullptr, images).compute({points});
}

TEST(MergedCloud, noisy_frames_err_less_than_by_rays_and_say_how_much) {
    for (const auto& [scene, sensor] : {std::pair("kitchen", "kinect"), std::pair("office", "tof")}) {
        const Merged cloud = merged(scene, sensor, 6);
        const PointVisibility together = computed(cloud.points),
                              rays = CloudAo({.radius = radius_m}).compute({cloud.points});
        EXPECT_TRUE(any_note(together, "6 depth frames were found"));
        EXPECT_TRUE(any_note(together, "computed as images, too"));
        const double error = rmse(together.visibility, cloud.truth), by_rays = rmse(rays.visibility, cloud.truth);
        std::printf("%s: %.3f, expected %.3f; by rays %.3f\n", sensor, error, *together.expected_error, by_rays);
        EXPECT_LT(error, 0.15) << sensor;
        EXPECT_LT(error, 0.95 * by_rays) << sensor;
        EXPECT_GT(*together.expected_error, 0.75 * error) << sensor;
        EXPECT_LT(*together.expected_error, 1.33 * error) << sensor;
    }
}

TEST(MergedCloud, depth_in_whole_units_has_the_noise_of_its_recording) {
    for (const double units : {1000, 5000}) {
        const Merged cloud = merged("kitchen", "kinect", 3, units);
        const std::string noise = describe(measure_noise(cloud.recorded)), steps = noise.substr(noise.find("steps"));
        EXPECT_NE(steps.find("z^2"), std::string::npos) << noise;
        EXPECT_TRUE(any_note(computed(cloud.points), steps)) << noise;
    }
}

TEST(MergedCloud, recorded_sides_are_not_asked_where_cameras_are_known) {
    const Merged cloud = merged("office", "ideal", 4);
    std::vector<Vector3d> wrong(cloud.points.size()), none;
    const PointVisibility right = computed(cloud.points);
    for (std::size_t i = 0; i < wrong.size(); ++i) {
        wrong[i] = right.normals[i].cast<double>();
        if (hash(static_cast<std::uint32_t>(i)) % 2 == 0)
            wrong[i] = -wrong[i];
    }
    const PointVisibility turned =
        MergedCloudAo({.radius = radius_m}, nullptr, on_device()).compute({cloud.points, wrong});
    EXPECT_LT(rmse(turned.visibility, right.visibility), 0.02);
}

TEST(MergedCloud, frames_that_the_file_names_need_no_order) {
    const Merged cloud = merged("office", "kinect", 4);
    Merged part = cloud; // shuffled within each frame
    for (const FoundFrame& frame : cloud.frames)
        for (std::size_t i = frame.last - 1; i > frame.first; --i) {
            const std::size_t k = frame.first + hash(static_cast<std::uint32_t>(i)) % (i - frame.first + 1);
            std::swap(part.points[i], part.points[k]);
            std::swap(part.truth[i], part.truth[k]);
        }
    const PointVisibility named = MergedCloudAo({.radius = radius_m}, nullptr, on_device())
                                      .compute({.points = part.points, .frames = part.frames});
    const PointVisibility unnamed = computed(part.points);
    EXPECT_FALSE(any_note(unnamed, "depth frames were found"));
    EXPECT_TRUE(any_note(named, "4 depth frames are named by the file: 100.0 % of these are pixels of 214x160 images"));
    EXPECT_TRUE(any_note(named, "computed as images, too"));
    const double error = rmse(named.visibility, part.truth), unknown = rmse(unnamed.visibility, part.truth);
    std::printf("named: %.3f, expected %.3f; unknown: %.3f\n", error, *named.expected_error, unknown);
    EXPECT_LT(error, 0.13);
    EXPECT_LT(error, 0.95 * unknown);
}

TEST(MergedCloud, points_that_several_frames_share_are_seen_by_their_cameras) {
    const Merged cloud = joined(merged("office", "kinect", 6), 0.03);
    const PointVisibility named = MergedCloudAo({.radius = radius_m}, nullptr, on_device())
                                      .compute({.points = cloud.points, .frames = cloud.frames}),
                          unknown = computed(cloud.points);
    EXPECT_TRUE(any_note(named, "6 depth frames are named by the file, which merged their points"));
    std::size_t away = 0; // of edges, which are smoothed
    for (const FoundFrame& frame : cloud.frames)
        for (std::size_t i = frame.first; i < frame.last; ++i)
            away += named.normals[i].cast<double>().dot(frame.world_from_camera.translation() - cloud.points[i]) < 0;
    EXPECT_LT(static_cast<double>(away), 0.01 * static_cast<double>(cloud.points.size()));
    const double error = rmse(named.visibility, cloud.truth), by_rays = rmse(unknown.visibility, cloud.truth);
    std::printf("joined: %.3f, expected %.3f; unknown: %.3f\n", error, *named.expected_error, by_rays);
    EXPECT_LT(error, by_rays);
    EXPECT_GT(*named.expected_error, 0.7 * error);
    EXPECT_LT(*named.expected_error, 1.4 * error);
}

TEST(MergedCloud, without_a_device_cameras_tell_sides) {
    const Merged cloud = merged("office", "ideal", 3);
    const PointVisibility found =
        computed(cloud.points, {.radius = radius_m}, {[]() -> gpu::Device& { throw Error("no Vulkan device"); }});
    EXPECT_TRUE(any_note(found, "3 depth frames were found"));
    EXPECT_TRUE(any_note(found, "not computed as images: no Vulkan device"));
    EXPECT_TRUE(any_note(found, "turned to the position that each point was seen from"));
    EXPECT_LT(rmse(found.visibility, cloud.truth), 0.12);
}

TEST(MergedCloud, other_clouds_and_wishes_are_rays_as_ever) {
    const Merged cloud = merged("office", "kinect", 2);
    std::vector<Vector3d> shuffled = cloud.points;
    for (std::size_t i = shuffled.size() - 1; i > 0; --i)
        std::swap(shuffled[i], shuffled[hash(static_cast<std::uint32_t>(i)) % (i + 1)]);
    const auto expect_rays = [](const std::vector<Vector3d>& points, const CloudAoOptions& options) {
        const PointVisibility found = computed(points, options);
        EXPECT_FALSE(any_note(found, "depth frames were found"));
        const std::vector<float> rays = CloudAo(options).compute({points}).visibility;
        ASSERT_EQ(found.visibility.size(), rays.size());
        EXPECT_EQ(rmse(found.visibility, rays), 0);
    };
    expect_rays(shuffled, {.radius = radius_m});
    expect_rays(cloud.points, {.radius = radius_m, .outside = "0,0,1"});
    expect_rays(cloud.points, {.sky = true});
}

TEST(MergedCloud, images_that_are_mostly_holes_tell_sides_and_no_more) {
    const Merged cloud = merged("office", "kinect", 2);
    std::vector<Vector3d> part;
    for (std::size_t i = 0; i < cloud.points.size(); ++i)
        if (hash(static_cast<std::uint32_t>(i)) < 0.3 * 0x1p32)
            part.push_back(cloud.points[i]);
    const PointVisibility found = computed(part);
    EXPECT_TRUE(any_note(found, "2 depth frames were found"));
    EXPECT_TRUE(any_note(found, "of their pixels hold points"));
    EXPECT_TRUE(any_note(found, "turned to the position that each point was seen from"));
}

TEST(MergedCloud, millimetres_are_seen_as_metres) {
    const Merged cloud = merged("office", "tof", 3);
    std::vector<Vector3d> in_mm = cloud.points;
    for (Vector3d& point : in_mm)
        point *= 1000;
    const PointVisibility metres = computed(cloud.points), millimetres = computed(in_mm, {.radius = 1000 * radius_m});
    EXPECT_TRUE(any_note(millimetres, "computed as images, too"));
    EXPECT_NEAR(rmse(millimetres.visibility, cloud.truth), rmse(metres.visibility, cloud.truth), 0.01);
}

} // namespace
} // namespace scanshade
