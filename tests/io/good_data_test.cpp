// The good captures, images and clouds of the shared data folder, where it is at hand, hold what its README says.
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "tests/support/data.h"
#include "tests/support/files.h"

#include <filesystem>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

struct Good {
    const char* path;
    const char* kind;
    std::size_t frames;
    double fx; ///< 0 = the capture has no camera
    double least_holes, most_holes, nearest_m,
        farthest_m; ///< over all frames, a little wider than the README's roundings
    bool poses;
    Registration registration;
};
std::ostream& operator<<(std::ostream& out, const Good& c) { return out << c.path; }

class GoodCapture : public ::testing::TestWithParam<Good> {};

TEST_P(GoodCapture, holds_what_its_readme_says) {
    const Good& good = GetParam();
    const fs::path path = data_folder() / good.path;
    NEEDS(path);
    const Capture capture = open_capture(path);
    EXPECT_EQ(capture.kind, good.kind);
    ASSERT_EQ(capture.entries.size(), good.frames);
    EXPECT_EQ(capture.registration, good.registration);
    EXPECT_EQ(capture.camera ? capture.camera->pinhole.fx : 0, good.fx);
    for (std::size_t i = 0; i < good.frames; ++i) {
        const Frame frame = capture.load(i);
        EXPECT_EQ(frame.depth_m.size(), cv::Size(640, 480));
        EXPECT_EQ(frame.colour.size(), cv::Size(640, 480));
        EXPECT_EQ(frame.world_from_camera.has_value(), good.poses);
        EXPECT_TRUE(frame.warnings.empty()) << joined(frame.warnings);
        EXPECT_TRUE(doubts_in(frame.findings).empty()) << joined(doubts_in(frame.findings));
        const double holes = 1 - cv::countNonZero(frame.depth_m) / (640.0 * 480.0);
        double nearest = 0, farthest = 0;
        cv::minMaxLoc(frame.depth_m, &nearest, &farthest, nullptr, nullptr, frame.depth_m > 0);
        EXPECT_GE(holes, good.least_holes) << frame.name;
        EXPECT_LE(holes, good.most_holes) << frame.name;
        EXPECT_GE(nearest, good.nearest_m) << frame.name;
        EXPECT_LE(farthest, good.farthest_m) << frame.name;
    }
}
INSTANTIATE_TEST_SUITE_P(readme, GoodCapture,
                         ::testing::Values(Good{"rgbd_7scenes", "7-Scenes / BundleFusion", 40, 585, 0.0775, 0.1075,
                                                0.9649, 3.1151, true, Registration::no},
                                           Good{"rgbd_7scenes_sentinel", "7-Scenes / BundleFusion", 3, 585, 0.123,
                                                0.165, 0.9, 4.5, true, Registration::no},
                                           Good{"rgbd_redwood", "Redwood / Open3D", 5, 525, 0.1235, 0.1305, 0.9549,
                                                2.7021, true, Registration::unknown},
                                           Good{"rgbd_tum_fr1_desk", "TUM RGB-D", 6, 517.3, 0.1685, 0.1835, 0.735,
                                                2.1151, true, Registration::yes},
                                           Good{"rgbd_tum_converted", "TUM RGB-D", 20, 525, 0.078, 0.108, 0.9649,
                                                3.1151, true, Registration::unknown},
                                           Good{"rgbd_realsense", "colour and depth folders", 5, 617.25, 0.0044, 0.0651,
                                                0.2799, 3.1851, false, Registration::unknown},
                                           Good{"rgbd_kinect_pgm", "colour and depth folders", 2, 0, 0.3065, 0.3195,
                                                0.945, 9.8251, true, Registration::unknown}));

TEST(good_data, single_depth_images_need_their_encoding_and_doubt_the_wrong_one) {
    const fs::path folder = data_folder() / "single_frames";
    NEEDS(folder);
    struct Row {
        const char *file, *scale;
        double nearest_m, farthest_m, holes;
    };
    for (const Row& row :
         {Row{"NYU_depth.pgm", "nyu", 1.385, 6.75, 0.072}, Row{"SUN_depth.png", "sun", 1.0569, 9.8701, 0.182},
          Row{"TUM_depth.png", "tum", 1.46, 9.335, 0.192}}) {
        CaptureOptions options;
        options.depth_scale = row.scale;
        const Frame right = open_capture(folder / row.file, options).load(0);
        EXPECT_TRUE(right.warnings.empty()) << joined(right.warnings);
        EXPECT_TRUE(doubts_in(right.findings).empty()) << joined(doubts_in(right.findings));
        double nearest = 0, farthest = 0;
        cv::minMaxLoc(right.depth_m, &nearest, &farthest, nullptr, nullptr, right.depth_m > 0);
        EXPECT_GE(nearest, row.nearest_m) << row.file;
        EXPECT_LE(farthest, row.farthest_m) << row.file;
        EXPECT_NEAR(1 - cv::countNonZero(right.depth_m) / 307200.0, row.holes, 0.001) << row.file;
        EXPECT_TRUE(warned(doubts_in(open_capture(folder / row.file).load(0).findings), "--depth-scale")) << row.file;
    }
}

TEST(good_data, organised_clouds_keep_invalid_points_and_their_colours) {
    const fs::path folder = data_folder() / "organised";
    NEEDS(folder);
    const std::pair<const char*, double> invalid_share[] = {
        {"learn0", 0.407},  {"learn9", 0.321},  {"learn20", 0.368},     {"learn27", 0.347},
        {"learn40", 0.439}, {"office1", 0.172}, {"capture0001", 0.187}, {"frame_20121214T142255.814212", 0.116}};
    for (const auto& [name, share] : invalid_share) {
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(folder / (std::string(name) + ".pcd"), warnings);
        EXPECT_TRUE(warnings.empty()) << joined(warnings);
        EXPECT_EQ(cloud.grid, cv::Size(640, 480));
        const auto invalid =
            std::count_if(cloud.points.begin(), cloud.points.end(), [](const auto& p) { return p.hasNaN(); });
        EXPECT_NEAR(static_cast<double>(invalid) / 307200, share, 0.0006) << name;
        EXPECT_EQ(cloud.colours.empty(), std::string(name) == "capture0001");
    }
}

TEST(good_data, clouds_survive_a_field_more_with_every_bit) {
    const fs::path data = data_folder();
    NEEDS(data / "unorganised");
    const TemporaryFolder folder;
    for (const char* name :
         {"unorganised/frag_115.ply", "unorganised/fragment.pcd", "unorganised/bun0.pcd", "unorganised/milk_color.pcd",
          "organised/learn0.pcd", "terrain_utm/samp11-utm.pcd", "broken/ply/list_in_vertex.ply"}) {
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(data / name, warnings);
        write_cloud(folder / "same", cloud, {});
        EXPECT_TRUE(file_bytes(folder / "same") == file_bytes(data / name)) << name;
        const std::vector<float> values(cloud.points.size(), 0.5F);
        write_cloud(folder / "more", cloud, {{"ambient_occlusion", values}});
        const Cloud more = read_cloud(folder / "more", warnings);
        EXPECT_EQ(more.points.size(), cloud.points.size()) << name;
        EXPECT_EQ(more.colours, cloud.colours) << name;
    }
}

TEST(good_data, lists_whose_images_are_all_missing_are_reported_as_such) {
    const fs::path path = data_folder() / "tum_lists_fr1_xyz";
    NEEDS(path);
    const Capture capture = open_capture(path);
    EXPECT_EQ(capture.entries.size(), 798);
    EXPECT_TRUE(warned(capture.warnings, "none of its 798 images is there"));
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(0); }), "depth.txt line 4"));
}

} // namespace
} // namespace scanshade
