// Poses that depths contradict are told of before a run: another convention, another unit, another recording.
#include "apps/doubts/pose_check.h"
#include "io/images/image_file.h"
#include "tests/support/files.h"

#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr int frames = 6;

/// Where the camera was: it walks through a room and turns.
Isometry3d world_from_camera(int frame) {
    return Eigen::Translation3d(1 + 0.12 * frame, -0.5 - 0.06 * frame, 2 + 0.08 * frame) *
           Eigen::AngleAxisd(0.6 + 0.03 * frame, Vector3d(0.2, 1, 0.1).normalized());
}

/// The inside of a room of 6 x 4 x 8 m with a box in it.
cv::Mat1f seen_from(const Isometry3d& pose, const Pinhole& camera) {
    const Eigen::AlignedBox3d room(Vector3d(-2, -2.5, 0), Vector3d(4, 1.5, 8)),
        box(Vector3d(2, 0.2, 4), Vector3d(3, 1.5, 5));
    cv::Mat1f z_m(camera.size);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u) {
            const Vector3d along = pose.linear() * camera.ray(u, v);
            const auto crossed = [&](const Eigen::AlignedBox3d& solid) {
                const Eigen::Array3d to_min = (solid.min() - pose.translation()).array() / along.array(),
                                     to_max = (solid.max() - pose.translation()).array() / along.array();
                return std::pair(to_min.min(to_max).maxCoeff(), to_min.max(to_max).minCoeff());
            };
            const auto [enter, leave] = crossed(box);
            z_m(v, u) = static_cast<float>(enter > 0 && enter < leave ? enter : crossed(room).second);
        }
    return z_m;
}

/// What is told of a TUM recording whose poses are written by `written`.
template <class Written>
PoseCheck check_of(const Written& written) {
    const tests::TemporaryFolder folder;
    const Pinhole camera{130, 130, 79.5, 59.5, {160, 120}};
    std::filesystem::create_directories(folder / "depth");
    std::ofstream list(folder / "depth.txt"), poses(folder / "groundtruth.txt");
    for (int i = 0; i < frames; ++i) {
        write_depth_png(folder / fmt::format("depth/{}.png", i), seen_from(world_from_camera(i), camera), 5000);
        list << fmt::format("{}.0 depth/{}.png\n", i, i);
        const Isometry3d pose = written(world_from_camera(i));
        const Eigen::Quaterniond q(pose.linear());
        const Vector3d t = pose.translation();
        poses << fmt::format("{}.0 {} {} {} {} {} {} {}\n", i, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    }
    std::ofstream(folder / "camera.json")
        << R"({"fx": 130, "fy": 130, "cx": 79.5, "cy": 59.5, "width": 160, "height": 120})";
    list.close();
    poses.close();
    std::vector<std::size_t> all(frames);
    for (std::size_t i = 0; i < all.size(); ++i)
        all[i] = i;
    return check_poses(open_capture(folder / "", {}), all);
}

TEST(pose_check, right_poses_are_passed) {
    EXPECT_EQ(check_of([](const Isometry3d& pose) { return pose; }).warning, "");
}

TEST(pose_check, another_convention_is_named) {
    const Isometry3d turned(Eigen::AngleAxisd(std::acos(-1.0), Vector3d::UnitX()));
    EXPECT_NE(check_of([](const Isometry3d& pose) {
                  return pose.inverse();
              }).warning.find("camera from world, their inverse"),
              std::string::npos);
    EXPECT_NE(check_of([&](const Isometry3d& pose) { return pose * turned; }).warning.find("y up and z backward"),
              std::string::npos);
}

TEST(pose_check, another_unit_is_named) {
    const auto by = [](double factor) {
        return check_of([=](Isometry3d pose) {
            pose.translation() *= factor;
            return pose;
        });
    };
    const PoseCheck millimetres = by(1000), five = by(5), right = by(1);
    EXPECT_NE(millimetres.warning.find("multiplied by 1000:"), std::string::npos) << millimetres.warning;
    EXPECT_FALSE(millimetres.doubts_depths); // depths of kilometres are no likelier than such poses
    EXPECT_NE(five.warning.find("multiplied by "), std::string::npos) << five.warning;
    EXPECT_TRUE(five.doubts_depths);
    EXPECT_FALSE(right.doubts_depths);
}

TEST(pose_check, poses_mirrored_in_the_world_do_not_pass) {
    const std::string told = check_of([](const Isometry3d& pose) {
                                 const Eigen::Matrix3d mirror = Vector3d(1, 1, -1).asDiagonal();
                                 Isometry3d mirrored = Isometry3d::Identity();
                                 mirrored.linear() = mirror * pose.linear() * mirror;
                                 mirrored.translation() = mirror * pose.translation();
                                 return mirrored;
                             }).warning;
    EXPECT_FALSE(told.empty()); // where the camera hardly turns about other axes than y, y up explains them as well
}

} // namespace
} // namespace scanshade
