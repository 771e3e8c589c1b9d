// Poses that are all the same are none: recorders write them where nobody tracks the camera.
#include "io/captures/capture.h"
#include "tests/support/made_recording.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;

struct Poses {
    const char* name;
    std::vector<const char*> matrices; ///< a frame each
    bool used = false;
};
void PrintTo(const Poses& row, std::ostream* to) { *to << row.name; }

constexpr const char* identity = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
constexpr const char* apart = "[[1,0,0,2],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
constexpr const char* lost = "[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,0]]";

class EqualPoses : public Made, public testing::WithParamInterface<Poses> {
  protected:
    Capture opened(const CaptureOptions& options = {}) {
        std::string frames;
        for (std::size_t i = 0; i < GetParam().matrices.size(); ++i) {
            depth(fmt::format("{}.png", i));
            frames += fmt::format(R"({}{{"file_path": "{}.png", "depth_file_path": "{}.png", "transform_matrix": {}}})",
                                  i > 0 ? "," : "", i, i, GetParam().matrices[i]);
        }
        text("transforms.json", R"({"fl_x": 10, "cx": 4, "cy": 3, "w": 8, "h": 6, "frames": [)" + frames + "]}");
        return open_capture(folder.path(), options);
    }
};

TEST_P(EqualPoses, are_left_out_with_a_warning) {
    const Capture capture = opened();
    std::size_t posed = 0;
    for (const CaptureEntry& entry : capture.entries)
        posed += entry.world_from_camera.has_value();
    EXPECT_EQ(posed > 0, GetParam().used);
    EXPECT_EQ(joined(capture.warnings).find("poses are equal") == std::string::npos, GetParam().used)
        << joined(capture.warnings);
}

TEST_P(EqualPoses, are_used_where_the_user_gives_them) {
    text("given.txt", "0 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1\n2 1 2 3 0 0 0 1\n3 1 2 3 0 0 0 1\n");
    CaptureOptions options;
    options.poses = folder / "given.txt";
    EXPECT_TRUE(opened(options).entries[0].world_from_camera);
}

INSTANTIATE_TEST_SUITE_P(Of, EqualPoses,
                         testing::Values(Poses{"identity", {identity, identity, identity}},
                                         Poses{"one_place", {apart, apart, apart}},
                                         Poses{"with_a_lost_one", {apart, lost, apart, apart}},
                                         Poses{"two_places", {identity, apart, identity}, true},
                                         Poses{"two_frames", {apart, apart}, true}, Poses{"one_frame", {apart}, true}),
                         [](const auto& info) { return std::string(info.param.name); });

} // namespace
} // namespace scanshade
