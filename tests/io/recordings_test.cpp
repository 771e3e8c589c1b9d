// Recordings as datasets and phones leave them. Samples with known truth are read from the folder SCANSHADE_RECORDINGS
// where it is given: NAME.truth.json beside each.
#include "io/captures/capture.h"

#include <cstdlib>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

namespace scanshade {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

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
        if (z > 0 || !confidence)
            EXPECT_NEAR(static_cast<double>(z), probe["z_m"].get<double>(), tolerance) << probe.dump();
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
        const Frame frame = capture.load(i);
        expect_camera(frame, frames[i], tolerance["k_px"]);
        expect_pose(frame, frames[i]["world_from_camera"], tolerance["pose"]);
        expect_depth(frame, frames[i], !truth["confidence"].is_null(), tolerance["depth_m"]);
        if (const Json& stamp = frames[i]["stamp_s"]; !stamp.is_null()) {
            ASSERT_TRUE(capture.entries[i].stamp_s);
            EXPECT_NEAR(*capture.entries[i].stamp_s, stamp.get<double>(), 1e-4);
        }
        EXPECT_EQ(frame.registration == Registration::yes, truth["registered"].get<bool>());
        if (!capture.entries[i].colour.empty())
            EXPECT_FALSE(frame.colour.empty());
        if (const Json& lens = truth["distortion"]; lens.is_object()) {
            EXPECT_NEAR(frame.camera.distortion.k1, lens["k1"].get<double>(), 1e-9);
            EXPECT_NEAR(frame.camera.distortion.p2, lens["p2"].get<double>(), 1e-9);
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
    if (const Json& sure = truth["confidence"]; sure.is_object())
        EXPECT_EQ(cv::countNonZero(capture.load(0).depth_m == 0),
                  frames[0]["holes_without_lowest_confidence"].get<int>());
}

INSTANTIATE_TEST_SUITE_P(of, Samples,
                         testing::Values("scannet-export", "nerfstudio", "nerfstudio-perframe", "instant-ngp", "stray",
                                         "polycam", "arkitscenes", "bop", "replica", "icl-nuim"),
                         [](const auto& layout) {
                             std::string name = layout.param;
                             std::ranges::replace(name, '-', '_');
                             return name;
                         });

} // namespace
} // namespace scanshade
