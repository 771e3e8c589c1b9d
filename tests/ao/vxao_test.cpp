// What voxels add to the laws of all methods: other views' surfaces occlude, the same ones twice make no difference,
// and little memory costs detail instead of the frame.
#include "ao/base/method.h"
#include "ao/gpu/device.h"
#include "ao/sequence/pack.h"
#include "ao/vxao/vxao.h"
#include "projection/base/error.h"
#include "tests/support/says.h"
#include "tests/support/scenes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;

class Voxels : public testing::Test {
  protected:
    static VxaoOptions raw() {
        VxaoOptions options;
        options.screen.curve = 0;
        options.quality = Quality::low;
        return options;
    }
    cv::Mat1f visibility(const DepthImage& depth, const VxaoOptions& options,
                         std::span<const Neighbour> neighbours = {}) {
        View view{depth};
        view.neighbours = neighbours;
        return Vxao(device, options).compute(view).visibility;
    }
    void TearDown() override {
        for (const std::string& message : device.validation_messages())
            ADD_FAILURE() << message;
    }
    gpu::Device device;
};

double mean_difference(const cv::Mat1f& a, const cv::Mat1f& b) {
    cv::Mat1f apart;
    cv::absdiff(a, b, apart);
    cv::patchNaNs(apart);
    return cv::sum(apart)[0] / cv::countNonZero(a >= 0);
}

TEST_F(Voxels, a_second_look_from_the_same_place_changes_nothing) {
    const DepthImage depth = ball_on_floor(test_camera());
    PackSurfaces pack(device);
    const PackedSurfaces same = pack.compute({depth});
    const std::vector<Neighbour> twice(2, Neighbour{&same, Eigen::Isometry3d::Identity()});
    EXPECT_LT(mean_difference(visibility(depth, raw()), visibility(depth, raw(), twice)), 0.003);
}

TEST_F(Voxels, a_wall_that_only_another_view_saw_occludes) {
    // A floor 1 m away, seen from above; the other view, 0.6 m to the right and turned by 90 degrees, saw a wall that
    // stands on it.
    const Pinhole camera = test_camera({320, 240});
    const DepthImage floor = tilted_plane(camera, 0, 1.0), wall = tilted_plane(camera, 0, 0.6);
    PackSurfaces pack(device);
    const PackedSurfaces seen = pack.compute({wall});
    Eigen::Isometry3d here_from_there = Eigen::Isometry3d::Identity();
    here_from_there.linear() = Eigen::AngleAxisd(CV_PI / 2, Eigen::Vector3d::UnitY()).toRotationMatrix();
    here_from_there.translation() = Eigen::Vector3d(-0.6, 0, 0.75); // the wall is then at x = 0
    const std::vector<Neighbour> others{{&seen, here_from_there}};
    const cv::Mat1f alone = visibility(floor, raw()), together = visibility(floor, raw(), others);
    const int middle = static_cast<int>(std::lround(camera.cx)), row = static_cast<int>(std::lround(camera.cy));
    const auto column_at = [&](double metres) { return middle + static_cast<int>(std::lround(metres * camera.fx)); };
    EXPECT_GT(alone(row, column_at(0.1)), 0.98);
    EXPECT_LT(together(row, column_at(0.1)), 0.85);
    EXPECT_LT(together(row, column_at(0.1)), together(row, column_at(0.25)));
    double darkest = 1; // nothing gets lighter
    for (int x = 0; x < alone.cols; ++x)
        darkest = std::min<double>(darkest, alone(row, x) - together(row, x));
    EXPECT_GT(darkest, -0.01);
}

TEST_F(Voxels, the_order_of_views_makes_no_difference) {
    const DepthImage depth = ball_on_floor(test_camera()), other = wall_corner(test_camera());
    PackSurfaces pack(device);
    const PackedSurfaces one = pack.compute({other}), two = pack.compute({depth});
    Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
    moved.translation() = Eigen::Vector3d(0.1, 0.05, 0);
    const Neighbour a{&one, Eigen::Isometry3d::Identity()}, b{&two, moved};
    const std::vector<Neighbour> ab{a, b}, ba{b, a};
    const cv::Mat1f first = visibility(depth, raw(), ab), second = visibility(depth, raw(), ba);
    EXPECT_EQ(0, std::memcmp(first.data, second.data, first.total() * 4));
}

TEST_F(Voxels, little_memory_costs_detail_and_no_frame) {
    const DepthImage depth = ball_on_floor(test_camera());
    VxaoOptions little = raw(), much = raw();
    little.quality = much.quality = Quality::high;
    little.memory_mib = 1;
    const cv::Mat1f coarse = visibility(depth, little), fine = visibility(depth, much);
    EXPECT_TRUE(cv::checkRange(coarse, true, nullptr, 0.0, 1.0 + 1e-6));
    const double apart = mean_difference(coarse, fine);
    EXPECT_GT(apart, 0);
    EXPECT_LT(apart, 0.1);
}

/// One level fewer is a warning; voxels larger than those of any quality are a reason to doubt; all is well unsaid.
TEST_F(Voxels, a_level_without_room_is_said) {
    const DepthImage depth = ball_on_floor(test_camera({640, 480}));
    VxaoOptions options = raw();
    options.quality = Quality::high;
    std::size_t warned = 0, doubted = 0, silent = 0;
    for (const int mib : {1, 2, 3, 4, 8, 256}) {
        options.memory_mib = mib;
        Vxao method(device, options);
        const cv::Mat1f values = method.compute({depth}).visibility;
        const MethodRemarks& remarks = method.remarks();
        SCOPED_TRACE(mib);
        warned += remarks.warnings.size();
        doubted += doubts_in(remarks.findings).size();
        silent += remarks.warnings.empty() && doubts_in(remarks.findings).empty();
        EXPECT_LE(remarks.warnings.size() + doubts_in(remarks.findings).size(), 1U);
        for (const std::string& sentence : remarks.warnings)
            EXPECT_TRUE(says(sentence, fmt::format("{} MiB are there", mib - 1)) ||
                        says(sentence, fmt::format("{} MiB are there", mib)))
                << sentence;
        if (mib == 1) {
            EXPECT_EQ(doubts_in(remarks.findings).size(), 1U) << "115 bricks";
        }
        if (mib == 256) {
            EXPECT_LT(mean_difference(values, visibility(depth, options)), 1e-6);
            EXPECT_TRUE(remarks.warnings.empty() && doubts_in(remarks.findings).empty());
        }
    }
    EXPECT_GE(warned, 1U);
    EXPECT_GE(doubted, 1U);
    EXPECT_GE(silent, 1U);
}

/// The sentence's guess is good enough to follow: with as much memory as it names, nothing is left out.
TEST_F(Voxels, the_memory_that_is_named_is_enough) {
    const DepthImage depth = ball_on_floor(test_camera({640, 480}));
    VxaoOptions options = raw();
    options.quality = Quality::high;
    options.memory_mib = 2;
    Vxao little(device, options);
    (void)little.compute({depth});
    std::vector<std::string> said = little.remarks().warnings;
    std::ranges::copy(doubts_in(little.remarks().findings), std::back_inserter(said));
    ASSERT_EQ(said.size(), 1U);
    double needed_mib = 0;
    ASSERT_EQ(std::sscanf(said[0].substr(said[0].find("some ")).c_str(), "some %lf MiB", &needed_mib), 1) << said[0];
    options.memory_mib = static_cast<int>(1.1 * needed_mib) + 1;
    Vxao enough(device, options);
    (void)enough.compute({depth});
    EXPECT_TRUE(enough.remarks().warnings.empty() && doubts_in(enough.remarks().findings).empty()) << said[0];
}

TEST_F(Voxels, a_voxel_out_of_range_is_refused) {
    VxaoOptions options = raw();
    options.voxel_m = 0.3;
    EXPECT_THROW(Vxao(device, options), Misuse);
    options.voxel_m = 0.001;
    EXPECT_THROW(Vxao(device, options), Misuse);
}

} // namespace
} // namespace scanshade
