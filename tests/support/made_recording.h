// Recordings made file by file, with one or two frames of 8x6 pixels.
#pragma once

#include "projection/frame.h"
#include "tests/support/files.h"
#include "tests/support/small_capture.h"

#include <filesystem>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace scanshade::tests {

/// A recording of one or two frames: 8x6 pixels at 2 m, pixel (1, 1) at 3 m, pixel (0, 0) a hole.
class Made : public testing::Test {
  protected:
    void depth(const std::string& name, double units_per_metre = 1000) {
        cv::Mat1w image(6, 8, static_cast<ushort>(2 * units_per_metre));
        image(0, 0) = 0;
        image(1, 1) = static_cast<ushort>(3 * units_per_metre);
        picture(name, image);
    }
    void colour(const std::string& name, cv::Size size) { picture(name, cv::Mat3b(size, {9, 99, 199})); }
    /// Low at (2, 2), high elsewhere.
    void confidence(const std::string& name) {
        cv::Mat1b image(6, 8, uchar(2));
        image(2, 2) = 0;
        image(3, 3) = 1;
        picture(name, image);
    }
    void picture(const std::string& name, const cv::Mat& image) {
        std::filesystem::create_directories((folder / name).parent_path());
        ASSERT_TRUE(cv::imwrite((folder / name).string(), image));
    }
    void text(const std::filesystem::path& name, const std::string& bytes) {
        std::filesystem::create_directories((folder / name).parent_path());
        write_file(folder / name, bytes);
    }
    /// A camera at (1, 2, 3), turned by a quarter about z: its x is the world's y.
    static constexpr const char* pose_rows = "0 -1 0 1\n1 0 0 2\n0 0 1 3\n0 0 0 1\n";
    static void expect_pose(const Frame& frame) {
        ASSERT_TRUE(frame.world_from_camera);
        EXPECT_LT((*frame.world_from_camera * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-6);
        EXPECT_LT((*frame.world_from_camera * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(1, 2, 4)).norm(), 1e-6);
    }
    static void expect_depth(const Frame& frame) {
        EXPECT_EQ(frame.depth_m(0, 0), 0);
        EXPECT_NEAR(frame.depth_m(1, 1), 3, 1e-4);
        EXPECT_NEAR(frame.depth_m(5, 7), 2, 1e-4);
    }
    static void expect_camera(const Frame& frame, double fx, double fy, double cx, double cy) {
        const Pinhole& k = frame.camera.pinhole;
        EXPECT_EQ(k.size, cv::Size(8, 6));
        EXPECT_NEAR(k.fx, fx, 1e-6);
        EXPECT_NEAR(k.fy, fy, 1e-6);
        EXPECT_NEAR(k.cx, cx, 1e-6);
        EXPECT_NEAR(k.cy, cy, 1e-6);
    }
    tests::TemporaryFolder folder;
};

inline std::string floats(const std::vector<float>& values) {
    return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)};
}

} // namespace scanshade::tests
