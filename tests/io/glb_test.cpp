// Binary glTF as it is written: positions, colours, values, and what is left out.
#include "io/clouds/glb.h"
#include "projection/base/error.h"
#include "projection/srgb.h"
#include "tests/support/files.h"
#include "tests/support/glb_file.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using nlohmann::json;
using tests::Gltf, tests::gltf_in, tests::TemporaryFolder;

const float nan_value = std::nanf("");

TEST(GlbTest, points_without_a_value_are_left_out_and_counted) {
    const TemporaryFolder folder;
    const std::vector<Eigen::Vector3d> points{{1, 2, 3}, {std::nan(""), 0, 0}, {4, 5, 6}, {7, 8, 9}};
    const std::vector<float> open{0.5F, 1, nan_value, 0.25F};
    const GlbWritten written =
        write_glb(folder / "a.glb", {.name = "a", .points = points, .fields = {{"_AMBIENT_OCCLUSION", open}}});
    EXPECT_EQ(written.points, 2u);
    EXPECT_EQ(written.left_out, 2u);
    const Gltf back = gltf_in(folder / "a.glb");
    EXPECT_EQ(back.attribute<float>("POSITION"), (std::vector<float>{1, 2, 3, 7, 8, 9}));
    EXPECT_EQ(back.attribute<float>("_AMBIENT_OCCLUSION"), (std::vector<float>{0.5F, 0.25F}));
    EXPECT_EQ(back.text["accessors"][0]["min"], json({1, 2, 3}));
    EXPECT_EQ(back.text["accessors"][0]["max"], json({7, 8, 9}));
    EXPECT_FALSE(back.text["nodes"][0].contains("rotation"));
    EXPECT_EQ(describe(written, UpAxis::unknown, "a.glb").size(), 2u);
}

// glTF's vertex colours are linear light, images store sRGB.
TEST(GlbTest, colours_are_linear_and_come_back_from_sixteen_bits) {
    const TemporaryFolder folder;
    std::vector<Eigen::Vector3d> points(256, Eigen::Vector3d::Ones());
    std::vector<cv::Vec3b> colours;
    for (int i = 0; i < 256; ++i)
        colours.emplace_back(static_cast<uchar>(i), uchar(0), static_cast<uchar>(255 - i));
    write_glb(folder / "a.glb", {.name = "a", .points = points, .colours = colours});
    const Gltf back = gltf_in(folder / "a.glb");
    const auto rgba = back.attribute<std::uint16_t>("COLOR_0");
    ASSERT_EQ(rgba.size(), 1024u);
    for (std::size_t i = 0; i < 256; ++i) {
        const auto stored = [&](std::size_t channel) {
            return std::lround(255 * srgb_from_linear(rgba[4 * i + channel] / 65535.0));
        };
        EXPECT_EQ(stored(0), 255 - static_cast<long>(i)) << "red comes first";
        EXPECT_EQ(stored(2), static_cast<long>(i));
        EXPECT_EQ(rgba[4 * i + 3], 65535);
    }
}

TEST(GlbTest, far_points_keep_their_places_by_the_translation) {
    const TemporaryFolder folder;
    const std::vector<Eigen::Vector3d> points{{691000.125, 5334000.25, 512.5}, {691010.375, 5334020.75, 520}};
    write_glb(folder / "a.glb", {.name = "a", .points = points, .up = UpAxis::z});
    const Gltf back = gltf_in(folder / "a.glb");
    const json& node = back.text["nodes"][0];
    const auto q = node["rotation"].get<std::vector<double>>(), t = node["translation"].get<std::vector<double>>();
    const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
    const auto stored = back.attribute<float>("POSITION");
    for (std::size_t i = 0; i < 2; ++i) {
        const Eigen::Vector3d there = turn * Eigen::Vector3d(stored[3 * i], stored[3 * i + 1], stored[3 * i + 2]) +
                                      Eigen::Vector3d(t[0], t[1], t[2]);
        // z up becomes y up: (x, z, -y).
        EXPECT_NEAR(there.x(), points[i].x(), 1e-6);
        EXPECT_NEAR(there.y(), points[i].z(), 1e-6);
        EXPECT_NEAR(there.z(), -points[i].y(), 1e-6);
    }
}

TEST(GlbTest, a_mesh_keeps_its_vertices_and_loses_broken_faces_only) {
    const TemporaryFolder folder;
    const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {std::nan(""), 0, 0}, {1, 0, 0}, {0, 1, 0}};
    const std::vector<float> open{0.5F, 1, nan_value, 0.25F};
    const std::vector<std::array<int, 3>> triangles{{0, 2, 3}, {0, 1, 2}, {0, 2, 9}, {-1, 0, 2}};
    const GlbWritten written =
        write_glb(folder / "a.glb",
                  {.name = "a", .points = points, .triangles = triangles, .fields = {{"_AMBIENT_OCCLUSION", open}}});
    EXPECT_EQ(written.triangles, 1u);
    EXPECT_EQ(written.triangles_left_out, 3u);
    EXPECT_EQ(written.unknown, 1u);
    const Gltf back = gltf_in(folder / "a.glb");
    const json& primitive = back.text["meshes"][0]["primitives"][0];
    EXPECT_EQ(primitive["mode"], 4);
    EXPECT_EQ(back.numbers<std::uint32_t>(primitive["indices"].get<std::size_t>()),
              (std::vector<std::uint32_t>{0, 1, 2}));
    EXPECT_EQ(back.attribute<float>("_AMBIENT_OCCLUSION"), (std::vector<float>{0.5F, -1, 0.25F}));
}

TEST(GlbTest, normals_are_unit_or_absent) {
    const TemporaryFolder folder;
    const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {1, 0, 0}};
    std::vector<Eigen::Vector3d> normals{{0, 0, 1.009}, {0, 0.995, 0}};
    EXPECT_TRUE(write_glb(folder / "a.glb", {.name = "a", .points = points, .normals = normals}).has_normals);
    EXPECT_EQ(gltf_in(folder / "a.glb").attribute<float>("NORMAL"), (std::vector<float>{0, 0, 1, 0, 1, 0}));
    normals[1] = Eigen::Vector3d::Zero();
    EXPECT_FALSE(write_glb(folder / "b.glb", {.name = "a", .points = points, .normals = normals}).has_normals);
}

TEST(GlbTest, nothing_is_a_file_without_a_mesh) {
    const TemporaryFolder folder;
    write_glb(folder / "a.glb", {.name = "nothing"});
    const Gltf back = gltf_in(folder / "a.glb");
    EXPECT_FALSE(back.text.contains("meshes"));
    EXPECT_EQ(back.text["asset"]["version"], "2.0");
}

TEST(GlbTest, lists_of_other_lengths_are_refused) {
    const TemporaryFolder folder;
    const std::vector<Eigen::Vector3d> points{{0, 0, 0}, {1, 0, 0}};
    const std::vector<float> one{1};
    EXPECT_THROW(write_glb(folder / "a.glb", {.name = "a", .points = points, .fields = {{"_AMBIENT_OCCLUSION", one}}}),
                 Error);
    EXPECT_FALSE(std::filesystem::exists(folder / "a.glb"));
}

} // namespace
} // namespace scanshade
