// cameras.json beside Gaussian splats: where it is looked for, what it says, and what is not believed.
#include "io/clouds/splat_cameras.h"
#include "tests/support/files.h"

namespace scanshade {
namespace {

using namespace tests;
namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr const char* one =
    R"({"id": 0, "img_name": "a", "width": 640, "height": 480, "position": [1, 2, 3],
        "rotation": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]], "fy": 520, "fx": 525})";

TEST(SplatCameras, are_found_up_to_three_folders_above) {
    const TemporaryFolder folder;
    write_file(folder / "m/cameras.json", std::string("[") + one + "," + one + "]");
    std::vector<std::string> warnings;
    EXPECT_EQ(splat_cameras(folder / "m/a/b/c/d/point_cloud.ply", warnings).size(), 0U);
    for (const char* file : {"m/point_cloud.ply", "m/point_cloud/iteration_7/point_cloud.ply", "m/a/b/c/x.ply"}) {
        const std::vector<FoundFrame> cameras = splat_cameras(folder / file, warnings);
        ASSERT_EQ(cameras.size(), 2U) << file;
        EXPECT_EQ(cameras[1].world_from_camera * Vector3d(0, 0, 2), Vector3d(3, 2, 3)) << "it looks along x";
        EXPECT_EQ(cameras[1].world_from_camera * Vector3d(0, 2, 0), Vector3d(1, 2, 1)) << "its y is down";
        EXPECT_EQ(cameras[0].camera, (Pinhole{525, 520, 319.5, 239.5, {640, 480}}));
    }
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
}

TEST(SplatCameras, that_make_no_sense_are_not_believed) {
    const TemporaryFolder folder;
    const auto with = [](std::string text, const std::string& old, const std::string& by) {
        return "[" + std::string(one) + "," + text.replace(text.find(old), old.size(), by) + "]";
    };
    for (const auto& [bytes, says] : std::vector<std::pair<std::string, const char*>>{
             {"{}", "no list of cameras"},
             {"[1", "JSON"},
             {"[1]", "camera 0"},
             {with(one, "\"fx\": 525", "\"fx\": -1"), "camera 1: 640x480 pixels with focal lengths of -1"},
             {with(one, "\"fx\"", "\"f\""), "camera 1: \"fx\" is missing"},
             {with(one, "640", "\"wide\""), "\"width\" is \"wide\", expected a number"},
             {with(one, "[0, 0, 1]", "[0, 0, 2]"), "camera 1: \"rotation\" is no rotation"},
             {with(one, "[0, 0, 1]", "[0, 0]"), "cameras.json"},
             {with(one, "[1, 2, 3]", "[1, 2]"), "\"position\" three numbers"}}) {
        write_file(folder / "cameras.json", bytes);
        std::vector<std::string> warnings;
        EXPECT_TRUE(splat_cameras(folder / "a.ply", warnings).empty()) << bytes;
        EXPECT_TRUE(warned(warnings, says)) << bytes;
        EXPECT_TRUE(warned(warnings, "its cameras do not decide the sides of splats")) << bytes;
    }
}

} // namespace
} // namespace scanshade
