// One cloud of several sweeps, each in its scanner's frame.
#include "apps/results/recording_cloud.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/recorded_frames.h"
#include "projection/base/error.h"
#include "tests/support/files.h"

#include <cmath>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;

Eigen::Isometry3d moved(const Vector3d& by) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = by;
    return pose;
}

TEST(RecordingCloud, sweeps_of_one_place_become_one_point) {
    // Both see the point (1000.005, 0, 0) from different places; only the first sees the other point's surface.
    const std::vector<Vector3d> first{{1.005, 0, 0}, {5, 0, 0}, Vector3d::Constant(NAN)}, second{{-1.995, 0, 0}};
    const std::vector<float> of_first{0.4F, NAN, 0.1F}, of_second{0.8F};
    RecordingCloud cloud(0);
    cloud.add(CloudSweep{first, {}, of_first, {}, moved({999, 0, 0}), 0.1});
    cloud.add(CloudSweep{second, {}, of_second, {}, moved({1002, 0, 0}), 0.7});
    EXPECT_EQ(cloud.points(), 1U);
    EXPECT_EQ(cloud.resolution_m(), 0.1) << "of the first";
    const tests::TemporaryFolder folder;
    cloud.write(folder / "all.ply");
    std::vector<std::string> warnings;
    const Cloud read = read_cloud(folder / "all.ply", warnings);
    ASSERT_EQ(read.points.size(), 1U);
    EXPECT_NEAR(read.points[0].x(), 1000.005, 1e-4);
    EXPECT_NEAR(recorded_field(read, "ambient_occlusion", folder / "all.ply")[0], 0.6, 1e-6) << "equally sure";
    EXPECT_EQ(recorded_field(read, "ao_views", folder / "all.ply")[0], 2);
}

TEST(RecordingCloud, a_sweep_without_known_spacing_needs_a_resolution) {
    const std::vector<Vector3d> points{{1, 0, 0}};
    const std::vector<float> values{0.5F};
    const CloudSweep sweep{points, {}, values, {}, moved({0, 0, 0}), 0};
    EXPECT_THROW(RecordingCloud(0).add(sweep), Error);
    EXPECT_NO_THROW(RecordingCloud(0.01).add(sweep));
}

TEST(RecordingCloud, frames_are_kept_as_comments) {
    const Pinhole camera{50.1, 50.2, 19.7, 14.3, {40, 30}};
    const DepthImage wall{camera, cv::Mat1f(camera.size, 2.0F), {}};
    const cv::Mat1f half(camera.size, 0.5F);
    Eigen::Isometry3d turned = moved({0.3, 0.1, 0});
    turned.linear() = Eigen::AngleAxisd(0.3, Vector3d::UnitY()).toRotationMatrix();
    const std::vector<Eigen::Isometry3d> poses{moved({0, 0, 0}), moved({0, 0, 0}), turned};
    RecordingCloud cloud(0.02);
    for (const Eigen::Isometry3d& pose : poses)
        cloud.add({wall, half, half, {}, {}, pose});
    const tests::TemporaryFolder folder;
    cloud.write(folder / "all.ply");
    std::vector<std::string> warnings;
    const Cloud read = read_cloud(folder / "all.ply", warnings);
    const std::vector<FoundFrame> frames = recorded_frames(read, warnings);
    EXPECT_TRUE(warnings.empty()) << warnings.front();
    ASSERT_EQ(frames.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(frames[i].camera, camera);
        EXPECT_EQ(frames[i].world_from_camera.matrix(), poses[i].matrix());
    }
    EXPECT_EQ(frames[1].first, 1200U) << "pixels are 4 cm wide";
    EXPECT_EQ(frames[1].last, 1200U) << "a frame that adds no points";
    EXPECT_EQ(frames[2].last, cloud.points());
    const std::vector<Vector3d> one{{1, 0, 0}};
    const std::vector<float> value{0.5F};
    cloud.add(CloudSweep{one, {}, value, {}, moved({0, 0, 0}), 0.1});
    cloud.write(folder / "all.ply");
    EXPECT_TRUE(recorded_frames(read_cloud(folder / "all.ply", warnings), warnings).empty()) << "a sweep has no camera";
    EXPECT_TRUE(warnings.empty());
}

} // namespace
} // namespace scanshade
