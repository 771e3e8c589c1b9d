// Recordings and glTF files as other people's readers see them: the packages of Foxglove's programs, and Khronos'
// validator. Skipped where node or the packages of `tests/run` are absent.
#include "io/clouds/glb.h"
#include "tests/support/files.h"
#include "tests/support/points.h"
#include "tests/support/small_capture.h"
#include "tests/support/splat_glb.h"

#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using tests::run_program;
using tests::TemporaryFolder;

class ReadersTest : public testing::Test {
  protected:
    void SetUp() override {
        for (const char* package :
             {"@mcap/core", "fzstd", "@foxglove/rosmsg", "@foxglove/rosmsg2-serialization", "gltf-validator"})
            if (!fs::exists(modules() / package))
                GTEST_SKIP() << package << " is not in " << modules().string() << "; tests/run installs it";
        if (std::system("node --version >/dev/null 2>&1") != 0)
            GTEST_SKIP() << "node is not there; tests/run installs it";
    }

    static fs::path modules() { return fs::path(SCANSHADE_PROGRAM).parent_path() / "readers/node_modules"; }

    /// What a script of this folder prints.
    [[nodiscard]] json read_by(const std::string& script, const std::string& arguments) const {
        const fs::path result = folder / "result.json", said = folder / "said";
        const std::string command = fmt::format("node '{}/tests/readers/{}' '{}' {} >'{}' 2>'{}'", SCANSHADE_SOURCE,
                                                script, modules().string(), arguments, result.string(), said.string());
        if (std::system(command.c_str()) != 0)
            throw std::runtime_error(tests::read_bytes(said));
        return json::parse(tests::read_bytes(result));
    }
    [[nodiscard]] json recording_of(const std::string& arguments) const {
        const auto ran = run_program(fmt::format("run {} -o {}", arguments, (folder / "out").string()));
        if (ran.exit_code != 0)
            throw std::runtime_error(ran.err);
        return read_by("mcap.js", (folder / "out").string());
    }
    [[nodiscard]] json report_of(const fs::path& file) const {
        return read_by("glb.js", fmt::format("'{}'", file.string())).at(0);
    }

    TemporaryFolder folder;
};

// ---------------------------------------------------------------------------------------------------- MCAP

TEST_F(ReadersTest, a_recording_has_the_pixels_and_points_of_the_files_beside_it) {
    const fs::path capture = folder / "office";
    ASSERT_EQ(run_program(fmt::format("generate office -o {} --frames 3 --size 160x120", capture.string())).exit_code,
              0);
    const json found = recording_of(capture.string() + " --write ao,confidence,shaded,cloud,mcap");
    EXPECT_EQ(found["problems"], json::array());
    EXPECT_EQ(found["profile"], "ros2");
    EXPECT_EQ(found["compared_files"], 9);
    EXPECT_EQ(found["coloured_points"], true);
    EXPECT_GT(found["compared_points"], 3 * 160 * 120 / 2);
    EXPECT_EQ(found["metadata"], 3);
    for (const char* topic : {"frame", "camera_info", "depth", "colour/compressed", "ao/compressed",
                              "confidence/compressed", "shaded/compressed", "points"})
        EXPECT_EQ(found["topics"]["/scanshade/" + std::string(topic)]["messages"], 3) << topic;
    EXPECT_EQ(found["topics"]["/tf"]["messages"], 3);
    EXPECT_FALSE(found["topics"].contains("/tf_static"));
    EXPECT_EQ(found["frame_ids"]["/tf"], json({"world>camera_optical"}));
    EXPECT_EQ(found["frame_ids"]["/scanshade/points"], "camera_optical");
    EXPECT_EQ(found["depth"]["encoding"], "32FC1") << "the capture's depth has fifths of millimetres";
    EXPECT_EQ(found["camera"]["k"][0], 131.25);
    EXPECT_EQ(found["topics"]["/scanshade/ao/compressed"]["format"], "mono16; png compressed mono16");
    EXPECT_EQ(found["frames"][1]["index"], 1);
    EXPECT_LT(found["frames"][0]["time_ns"], found["frames"][1]["time_ns"]);
}

TEST_F(ReadersTest, frames_without_stamps_or_poses_are_a_thirtieth_apart_and_upright) {
    tests::write_capture(folder / "capture", 3);
    const json found = recording_of((folder / "capture").string() + " --write mcap --format png8");
    EXPECT_EQ(found["problems"], json::array());
    EXPECT_EQ(found["frames"][0]["time_ns"], 33333333);
    EXPECT_EQ(found["frames"][2]["time_ns"], 100000000);
    EXPECT_EQ(found["frame_ids"]["/tf_static"], json({"camera>camera_optical"}));
    EXPECT_FALSE(found["topics"].contains("/tf"));
    EXPECT_EQ(found["depth"]["encoding"], "16UC1") << "the capture's depth is whole millimetres";
    EXPECT_EQ(found["topics"]["/scanshade/ao/compressed"]["format"], "mono8; png compressed mono8");
    EXPECT_FALSE(fs::exists(folder / "out/ao"));
}

TEST_F(ReadersTest, a_cloud_is_a_recording_of_its_points) {
    const tests::Points points = tests::corner(5000);
    write_new_ply(folder / "corner.ply", points, {}, {});
    const json found = recording_of((folder / "corner.ply").string() + " --write cloud,mcap --cloud.outside inward");
    EXPECT_EQ(found["problems"], json::array());
    EXPECT_EQ(found["compared_points"], 5000);
    EXPECT_EQ(found["frame_ids"]["/scanshade/points"], "scanner");
    EXPECT_FALSE(found["topics"].contains("/scanshade/ao/compressed"));
}

// ---------------------------------------------------------------------------------------------------- glTF

void expect_clean(const json& report) {
    EXPECT_EQ(report["issues"]["numErrors"], 0) << report["issues"].dump(1);
    EXPECT_EQ(report["issues"]["numWarnings"], 0) << report["issues"].dump(1);
    EXPECT_EQ(report["issues"]["numHints"], 0) << report["issues"].dump(1);
    EXPECT_EQ(report["issues"]["numInfos"], 0) << report["issues"].dump(1);
}

TEST_F(ReadersTest, the_validator_has_nothing_to_say_of_frames) {
    tests::write_capture(folder / "capture", 1);
    ASSERT_EQ(
        run_program(fmt::format("run {} -o {} --write glb", (folder / "capture").string(), (folder / "out").string()))
            .exit_code,
        0);
    const json report = report_of(folder / "out/clouds/000.glb");
    expect_clean(report);
    EXPECT_EQ(report["info"]["totalVertexCount"], 64 * 48 - cv::countNonZero(tests::corner_depth(0) == 0));
    const json& primitive = report["json"]["meshes"][0]["primitives"][0];
    EXPECT_EQ(primitive["mode"], 0);
    for (const char* attribute : {"POSITION", "COLOR_0", "_AMBIENT_OCCLUSION", "_AO_CONFIDENCE"})
        EXPECT_TRUE(primitive["attributes"].contains(attribute)) << attribute;
    EXPECT_EQ(report["json"]["nodes"][0]["rotation"], json({1, 0, 0, 0})) << "y down becomes y up";
}

TEST_F(ReadersTest, the_validator_has_nothing_to_say_of_clouds_meshes_and_nothing_at_all) {
    const float nan = std::nanf("");
    std::vector<Eigen::Vector3d> points{{5e6, 0, 0}, {5e6 + 1, 0, 0}, {5e6, 1, 0.5}, {nan, nan, nan}};
    const std::vector<Eigen::Vector3d> normals(4, Eigen::Vector3d(0, 0, 2));
    const std::vector<cv::Vec3b> colours(4, cv::Vec3b(0, 128, 255));
    const std::vector<float> values{0.25F, 0.5F, nan, 1};
    const std::vector<std::array<int, 3>> triangles{{0, 1, 2}, {1, 2, 3}, {0, 1, -1}};
    GlbScene scene{.name = "a \"name\" \xff",
                   .points = points,
                   .triangles = triangles,
                   .normals = normals,
                   .colours = colours,
                   .fields = {{"_AMBIENT_OCCLUSION", values}},
                   .up = UpAxis::z};
    write_glb(folder / "mesh.glb", scene);
    scene.triangles = {};
    write_glb(folder / "cloud.glb", scene);
    scene.normals = {};
    scene.up = UpAxis::unknown;
    write_glb(folder / "plain.glb", scene);
    write_glb(folder / "empty.glb", {.name = "nothing"});
    for (const char* file : {"mesh.glb", "cloud.glb", "plain.glb", "empty.glb"}) {
        SCOPED_TRACE(file);
        expect_clean(report_of(folder / file));
    }
    const json mesh = report_of(folder / "mesh.glb");
    EXPECT_EQ(mesh["info"]["totalTriangleCount"], 1);
    EXPECT_EQ(mesh["json"]["nodes"][0]["translation"][0], 5000001) << "whole metres amid the points";
}

/// An extension that the validator does not know is information.
TEST_F(ReadersTest, the_validator_finds_no_fault_with_tiles) {
    const tests::Points points = tests::corner(60000);
    write_new_ply(folder / "corner.ply", points, {}, {});
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --write tiles3d --radius 0.2 --cloud.outside inward",
                                      (folder / "corner.ply").string(), (folder / "out").string()))
                  .exit_code,
              0);
    int tiles = 0;
    for (const auto& entry : fs::directory_iterator(folder / "out/tiles/corner"))
        if (entry.path().extension() == ".glb") {
            const json report = report_of(entry.path());
            EXPECT_EQ(report["issues"]["numErrors"], 0) << report["issues"].dump(1);
            EXPECT_EQ(report["issues"]["numWarnings"], 0) << report["issues"].dump(1);
            EXPECT_EQ(report["issues"]["numInfos"], 1) << report["issues"].dump(1);
            EXPECT_EQ(report["issues"]["messages"][0]["pointer"], "/extensionsUsed/0");
            EXPECT_EQ(report["json"]["extensionsUsed"][0], "EXT_structural_metadata");
            ++tiles;
        }
    EXPECT_GT(tiles, 4);
}

/// The validator knows neither the extension nor names of attributes with a colon; the input has as many of these.
TEST_F(ReadersTest, the_validator_finds_no_more_in_shaded_splats_than_in_theirs) {
    const fs::path file = tests::write_file(folder / "a.glb", tests::SplatGlb().bytes());
    const auto messages = [&](const fs::path& of) {
        std::vector<std::string> all;
        for (const json& each : report_of(of)["issues"]["messages"])
            all.push_back(fmt::format("{} {}", each["code"].get<std::string>(), each["pointer"].get<std::string>()));
        return all;
    };
    const std::vector<std::string> before = messages(file);
    for (const std::string& each : before)
        EXPECT_TRUE(each.starts_with("UNSUPPORTED_EXTENSION /extensionsUsed/0") ||
                    (each.starts_with("MESH_PRIMITIVE_INVALID_ATTRIBUTE") &&
                     each.find("KHR_gaussian_splatting:") != std::string::npos))
            << each;
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    const std::vector<float> values(cloud.points.size(), 0.5F);
    write_cloud(folder / "b.glb", cloud, {{"ambient_occlusion", values}});
    write_shaded_splats(folder / "c.glb", cloud, values, 1);
    EXPECT_EQ(messages(folder / "b.glb"), before);
    EXPECT_EQ(messages(folder / "c.glb"), before);
}

TEST_F(ReadersTest, a_mesh_is_triangles_and_the_cloud_of_a_recording_is_points) {
    tests::write_file(folder / "roof.ply",
                      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float "
                      "y\nproperty float z\nelement face 2\nproperty list uchar int "
                      "vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 1\n1 1 1\n3 0 1 2\n3 1 3 2\n");
    (void)run_program( // doubtful: so small
        fmt::format("run {} -o {} --write glb --radius 1", (folder / "roof.ply").string(), (folder / "out").string()));
    const json mesh = report_of(folder / "out/clouds/roof.glb");
    expect_clean(mesh);
    EXPECT_EQ(mesh["info"]["totalTriangleCount"], 2);

    ASSERT_EQ(run_program(fmt::format("generate office -o {} --frames 2 --size 160x120", (folder / "office").string()))
                  .exit_code,
              0);
    ASSERT_EQ(run_program(fmt::format("run {} -o {} --cloud {}", (folder / "office").string(),
                                      (folder / "all").string(), (folder / "all.glb").string()))
                  .exit_code,
              0);
    const json cloud = report_of(folder / "all.glb");
    expect_clean(cloud);
    EXPECT_TRUE(cloud["json"]["meshes"][0]["primitives"][0]["attributes"].contains("_AO_VIEWS"));
}

} // namespace
} // namespace scanshade
