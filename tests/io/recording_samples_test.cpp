// Samples of recordings with known truth, from the folder SCANSHADE_RECORDINGS where it is given, NAME.truth.json
// beside each.
#include "io/captures/capture.h"
#include "tests/support/files.h"

#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using tests::warned;

class Samples : public testing::TestWithParam<const char*> {};

void expect_camera(const Frame& frame, const Json& truth, double tolerance) {
    const Pinhole& k = frame.camera.pinhole;
    EXPECT_EQ(k.size, cv::Size(truth["size"][0], truth["size"][1]));
    const double found[] = {k.fx, k.fy, k.cx, k.cy};
    for (std::size_t i = 0; i < 4; ++i)
        EXPECT_NEAR(found[i], truth["K"][i].get<double>(), tolerance) << "fx fy cx cy"[3 * i] << i;
}

void expect_pose(const Frame& frame, const Json& truth, double tolerance) {
    ASSERT_EQ(frame.world_from_camera.has_value(), !truth.is_null());
    for (int row = 0; !truth.is_null() && row < 3; ++row)
        for (int column = 0; column < 4; ++column)
            EXPECT_NEAR(frame.world_from_camera->matrix()(row, column),
                        truth[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)].get<double>(),
                        tolerance);
}

void expect_depth(const Frame& frame, const Json& truth, bool confidence, double tolerance) {
    int holes = cv::countNonZero(frame.depth_m == 0);
    const auto hole = [&](const Json& pixel) { EXPECT_EQ(frame.depth_m(pixel[1].get<int>(), pixel[0].get<int>()), 0); };
    if (!confidence) {
        EXPECT_EQ(holes, truth["holes"].get<int>());
        std::ranges::for_each(truth["hole_pixels"], hole);
    } else {
        EXPECT_GE(holes, truth["holes"].get<int>());
    }
    for (const Json& probe : truth["probes"]) {
        const float z = frame.depth_m(probe["v"].get<int>(), probe["u"].get<int>());
        if (z > 0 || !confidence) {
            EXPECT_NEAR(static_cast<double>(z), probe["z_m"].get<double>(), tolerance) << probe.dump();
        }
    }
}

void expect_cloud(const Frame& frame, const Json& truth, const Json& tolerance) {
    ASSERT_TRUE(frame.cloud);
    EXPECT_EQ(frame.cloud->points.size(), truth["points"].get<std::size_t>());
    expect_pose(frame, truth["world_from_sensor"], tolerance["pose"]);
    const auto point = [](const Json& three) { return Eigen::Vector3d(three[0], three[1], three[2]); };
    for (const Json& probe : truth["probes"]) {
        const Eigen::Vector3d found = frame.cloud->points.at(probe["index"].get<std::size_t>());
        EXPECT_LT((found - point(probe["sensor"])).norm(), 1e-6) << probe.dump();
        EXPECT_LT((*frame.world_from_camera * found - point(probe["world"])).norm(), tolerance["point"].get<double>())
            << probe.dump();
    }
}

TEST_P(Samples, are_read_as_their_truth_says) {
    const char* const folder = std::getenv("SCANSHADE_RECORDINGS");
    if (!folder || !fs::exists(fs::path(folder) / (std::string(GetParam()) + ".truth.json")))
        GTEST_SKIP() << "no sample of " << GetParam() << " in SCANSHADE_RECORDINGS";
    std::ifstream stream(fs::path(folder) / (std::string(GetParam()) + ".truth.json"));
    const Json truth = Json::parse(stream);
    const Capture capture = open_capture(fs::path(folder) / truth["open"].get<std::string>());
    const Json& frames = truth["frames"];
    ASSERT_EQ(capture.entries.size(), frames.size());
    const Json& tolerance = truth["tolerance"];
    for (std::size_t i = 0; i < frames.size(); ++i) {
        SCOPED_TRACE(fmt::format("{} frame {}", capture.kind, capture.entries[i].name));
        Frame frame = capture.load(i);
        if (capture.unit.arbitrary()) { // the truth is in the recording's units
            frame.depth_m *= capture.unit.units_per_length;
            if (frame.world_from_camera)
                frame.world_from_camera->translation() *= capture.unit.units_per_length;
        }
        if (truth["kind"] == "clouds") {
            EXPECT_EQ(frame.name, frames[i]["name"].get<std::string>());
            expect_cloud(frame, frames[i], tolerance);
            ASSERT_TRUE(capture.entries[i].stamp_s);
            EXPECT_NEAR(*capture.entries[i].stamp_s, frames[i]["stamp_s"].get<double>(), 1e-4);
            continue;
        }
        expect_camera(frame, frames[i], tolerance["k_px"]);
        expect_pose(frame, frames[i]["world_from_camera"], tolerance["pose"]);
        expect_depth(frame, frames[i], !truth["confidence"].is_null(), tolerance["depth_m"]);
        if (const Json& stamp = frames[i]["stamp_s"]; !stamp.is_null()) {
            ASSERT_TRUE(capture.entries[i].stamp_s);
            EXPECT_NEAR(*capture.entries[i].stamp_s, stamp.get<double>(), 1e-4);
        }
        if (const Json& registered = truth["registered"]; registered.is_boolean()) {
            EXPECT_EQ(frame.registration == Registration::yes, registered.get<bool>());
        }
        if (!capture.entries[i].colour.empty() && (frame.registration == Registration::yes || frame.colour_camera)) {
            EXPECT_FALSE(frame.colour.empty());
        }
        if (const Json& lens = truth["distortion"]; lens.is_object()) {
            const Distortion& d = frame.camera.distortion;
            EXPECT_NEAR(d.k1, lens["k1"].get<double>(), 1e-9);
            EXPECT_NEAR(d.p2, lens["p2"].get<double>(), 1e-9);
            for (const auto& [key, found] : {std::pair{"p1", d.p1}, {"k3", d.k3}, {"k4", d.k4}, {"k6", d.k6}})
                if (lens.contains(key)) {
                    EXPECT_NEAR(found, lens[key].get<double>(), 1e-9) << key;
                }
        }
        if (const Json& colour = truth["colour_camera"]; colour.is_object()) {
            ASSERT_TRUE(frame.colour_camera);
            const Pinhole& k = frame.colour_camera->camera.pinhole;
            EXPECT_NEAR(k.fx, colour["K"][0].get<double>(), 0.01);
            EXPECT_NEAR(k.cy, colour["K"][3].get<double>(), 0.01);
            EXPECT_EQ(k.size, cv::Size(colour["size"][0], colour["size"][1]));
        }
        if (testing::Test::HasFailure())
            break;
    }
    if (const Json& sure = truth["confidence"]; sure.is_object()) {
        EXPECT_EQ(cv::countNonZero(capture.load(0).depth_m == 0),
                  frames[0]["holes_without_lowest_confidence"].get<int>());
    }
}

INSTANTIATE_TEST_SUITE_P(of, Samples,
                         testing::Values("scannet-export", "nerfstudio", "nerfstudio-perframe", "instant-ngp", "stray",
                                         "polycam", "arkitscenes", "bop", "replica", "icl-nuim", "scannetpp-iphone",
                                         "nyu-raw", "npy-folder", "scannet-sens", "ros1-bag", "ros1-bag-bz2",
                                         "ros1-bag-lz4", "ros2-db3", "mcap", "mcap-lz4", "mcap-zstd", "realsense-bag",
                                         "realsense-db3", "kitti-odometry", "nuscenes", "npz", "scannetpp-raw",
                                         "scannetpp-raw-lz4", "record3d", "azure-mkv", "colmap-dense",
                                         "colmap-dense-text", "hypersim"),
                         [](const auto& layout) {
                             std::string name = layout.param;
                             std::ranges::replace(name, '-', '_');
                             return name;
                         });

std::optional<Json> truth_of(const std::string& layout) {
    const char* const folder = std::getenv("SCANSHADE_RECORDINGS");
    if (!folder || !fs::exists(fs::path(folder) / (layout + ".truth.json")))
        return std::nullopt;
    std::ifstream stream(fs::path(folder) / (layout + ".truth.json"));
    return Json::parse(stream);
}

TEST(SampleFolders, sun_rgbd_is_a_capture_for_each_image) {
    const std::optional<Json> truth = truth_of("sunrgbd");
    if (!truth)
        GTEST_SKIP() << "no sample of sunrgbd in SCANSHADE_RECORDINGS";
    const fs::path folder = std::getenv("SCANSHADE_RECORDINGS");
    EXPECT_EQ(captures_below(folder / (*truth)["open"].get<std::string>()).size(), (*truth)["frames"].size());
    for (const Json& each : (*truth)["frames"]) {
        const Capture capture = open_capture(folder / each["open"].get<std::string>());
        EXPECT_EQ(capture.kind, "SUN RGB-D");
        ASSERT_EQ(capture.entries.size(), 1U);
        const Frame frame = capture.load(0);
        expect_camera(frame, each, (*truth)["tolerance"]["k_px"]);
        expect_depth(frame, each, false, (*truth)["tolerance"]["depth_m"]);
        EXPECT_EQ(frame.registration, Registration::yes);
        EXPECT_FALSE(frame.colour.empty());
    }
}

TEST(SampleFolders, a_generic_folder_names_what_it_did_not_use) {
    const std::optional<Json> truth = truth_of("generic-unused");
    if (!truth)
        GTEST_SKIP() << "no sample of generic-unused in SCANSHADE_RECORDINGS";
    const Capture capture =
        open_capture(fs::path(std::getenv("SCANSHADE_RECORDINGS")) / (*truth)["open"].get<std::string>());
    EXPECT_TRUE(warned(capture.warnings, "not used, though their names speak of poses or cameras: calibration.npz, "
                                         "camera_poses.csv, pose."));
    ASSERT_EQ(capture.entries.size(), (*truth)["frames"].size());
    for (std::size_t i = 0; i < capture.entries.size(); ++i) {
        const Frame frame = capture.load(i);
        expect_depth(frame, (*truth)["frames"][i], false, (*truth)["tolerance"]["depth_m"]);
        EXPECT_FALSE(frame.world_from_camera);
    }
}

} // namespace
} // namespace scanshade
