// --write texture from the command line: images and links of each format, tiles, overlap, and what has no coordinates.
#include "io/images/image_file.h"
#include "tests/support/files.h"
#include "tests/support/says.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;
namespace fs = std::filesystem;

/// Two unit squares of a corner, floor and wall, with a chart each: its corner in the image and the length of its
/// sides.
std::string corner(double u_of_wall, double side, bool two_materials) {
    std::string text = "mtllib corner.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 1 0 1\nv 0 0 1\n";
    for (const double u : {0.0, u_of_wall})
        for (const auto& [s, t] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}})
            text += fmt::format("vt {} {}\n", u + side * s, side * t);
    text += "usemtl floor\nf 1/1 2/2 3/3 4/4\n";
    return text + (two_materials ? "usemtl wall\n" : "") + "f 2/5 1/6 6/7 5/8\n";
}

struct Written {
    Ran ran;
    fs::path meshes;
    [[nodiscard]] std::string text(const char* name) const { return file_bytes(meshes / name); }
    /// Rows of an image count from the top, coordinates from below.
    [[nodiscard]] double at(const std::string& name, double u, double v) const {
        const cv::Mat stored = read_stored_depth(meshes / name);
        cv::Mat1d values;
        stored.convertTo(values, CV_64F, stored.depth() == CV_16U ? 1.0 / 65535 : 1);
        return values(static_cast<int>((1 - v) * values.rows), static_cast<int>(u * values.cols));
    }
};

Written run_texture(const TemporaryFolder& folder, const std::string& name, const std::string& bytes,
                    const std::string& more = "", const std::string& write = "texture") {
    const fs::path file = write_file(folder / name, bytes), out = folder / "out";
    const Ran ran = run_program(fmt::format("run {} -o {} --overwrite --radius 1.5 --write {} --texture-size 128 {}",
                                            file.string(), out.string(), write, more));
    return {ran, out / "meshes"};
}

/// A floor of length 1 before a wall as high sees V = (1 + d / sqrt(d^2 + 1)) / 2 of an endless one, and more since it
/// ends: no less than that, and nearly all at its far edge's middle.
void expect_corner(const Written& run, const std::string& image, double u, double v) {
    EXPECT_NEAR(run.at(image, u, v), 0.55, 0.1) << image << ": near the wall";
    EXPECT_GT(run.at(image, u, v + 0.36), run.at(image, u, v) + 0.2) << image << ": visibility grows away from it";
}

TEST(MeshTextures, of_one_material_are_linked_by_its_mtl) {
    const TemporaryFolder folder;
    write_file(folder / "corner.mtl", "newmtl floor\nKa 1 1 1\nmap_Kd base.png\n");
    write_file(folder / "base.png", "a picture");
    const Written run = run_texture(folder, "corner.obj", corner(0.5, 0.4, false));
    ASSERT_EQ(run.ran.exit_code, 0) << run.ran.err;
    expect_corner(run, "corner.ao.png", 0.2, 0.02);
    EXPECT_EQ(run.at("corner.ao.png", 0.2, 0.8), 1) << "nothing is there";
    EXPECT_LT(run.at("corner.ao.png", 0.2, 0.403), 1) << "the margin";
    EXPECT_EQ(run.text("corner.obj"), file_bytes(folder / "corner.obj"));
    EXPECT_EQ(run.text("corner.mtl"), "newmtl floor\nKa 1 1 1\nmap_Ka corner.ao.png\nmap_Kd base.png\n");
    EXPECT_EQ(run.text("base.png"), "a picture") << "what the mesh needs is beside it";
}

TEST(MeshTextures, have_a_name_for_each_material_and_tile) {
    const TemporaryFolder folder;
    write_file(folder / "corner.mtl", "newmtl floor\n\nnewmtl wall\n");
    const Written materials = run_texture(folder, "corner.obj", corner(0.5, 0.4, true), "--format exr");
    ASSERT_EQ(materials.ran.exit_code, 0) << materials.ran.err;
    expect_corner(materials, "corner.floor.ao.exr", 0.2, 0.02);
    EXPECT_EQ(materials.text("corner.mtl"),
              "newmtl floor\nmap_Ka corner.floor.ao.exr\n\nnewmtl wall\nmap_Ka corner.wall.ao.exr\n");
    const Written tiles = run_texture(folder, "corner.obj", corner(1.5, 0.4, false));
    ASSERT_EQ(tiles.ran.exit_code, 0) << tiles.ran.err;
    expect_corner(tiles, "corner.floor.1001.ao.png", 0.2, 0.02);
    expect_corner(tiles, "corner.floor.1002.ao.png", 0.7, 0.02);
    EXPECT_TRUE(says(tiles.text("corner.mtl"), "map_Ka corner.floor.<UDIM>.ao.png\n"));
}

TEST(MeshTextures, doubt_overlap_and_refuse_meshes_without_coordinates) {
    const TemporaryFolder folder;
    const Written overlap = run_texture(folder, "corner.obj", corner(0.2, 0.4, false), "--strict");
    EXPECT_EQ(overlap.ran.exit_code, 2);
    EXPECT_TRUE(says(overlap.ran.err, "% of the texture is used by more than one part of the surface "
                                      "(overlapping texture coordinates); values there are means"));
    const std::string bare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\nf 1 2 3\nf 1 3 4\n";
    const Written none = run_texture(folder, "bare.obj", bare);
    EXPECT_EQ(none.ran.exit_code, 3);
    EXPECT_TRUE(says(none.ran.err, "the mesh has no texture coordinates, so no texture"));
    const Written vertices = run_texture(folder, "bare.obj", bare, "", "texture,cloud");
    EXPECT_EQ(vertices.ran.exit_code, 0) << "its vertices have values";
    EXPECT_TRUE(says(vertices.ran.err, "the mesh has no texture coordinates, so no texture"));
    EXPECT_TRUE(fs::exists(folder / "out/clouds/bare.ply"));
}

} // namespace
} // namespace scanshade
