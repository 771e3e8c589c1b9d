// Meshes in OBJ and glTF: what is read, what is refused, and what links to textures change.
#include "io/clouds/cloud_file.h"
#include "io/clouds/mesh_textures.h"
#include "projection/base/error.h"
#include "tests/support/files.h"
#include "tests/support/says.h"

#include <cstring>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using namespace tests;
using Json = nlohmann::ordered_json;

struct Read {
    Cloud cloud;
    std::vector<std::array<int, 3>> triangles;
    std::vector<std::string> warnings;
};

Read read(const std::filesystem::path& file, const std::string& bytes) {
    Read found;
    found.cloud = read_cloud(write_file(file, bytes), found.warnings);
    found.triangles = triangles_of(found.cloud);
    return found;
}

constexpr const char* quad = "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0\\\n 0 0 1\nv 0 1 0\n"
                             "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 0.25\nvn 0 0 -1\nusemtl a b\n";

TEST(Obj, polygons_are_fanned_and_indices_may_count_back) {
    const TemporaryFolder folder;
    for (const char* face : {"f 1/1/1 2/2/1 3/3/1 4/4/1\n", "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1 # the same\r\n"}) {
        const auto file = folder / "a.obj";
        const Read found = read(file, std::string(quad) + face);
        EXPECT_EQ(found.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}, {0, 2, 3}})) << face;
        ASSERT_EQ(found.cloud.points.size(), 4u);
        EXPECT_EQ(found.cloud.points[2], Eigen::Vector3d(1, 1, 0)) << "a line goes on behind a backslash";
        EXPECT_EQ(found.cloud.colours[2], cv::Vec3b(255, 0, 0)) << "BGR";
        const TexturedMesh mesh = textured_mesh(found.cloud, file);
        EXPECT_EQ(mesh.materials[0].name, "a b");
        EXPECT_EQ(mesh.sets[0][1][2], Eigen::Vector2f(0, 0.75F)) << "v points up in OBJ";
        EXPECT_EQ(mesh.reversed, (std::vector<bool>{true, true})) << "its normals face down";
    }
}

TEST(Obj, is_written_as_a_ply_of_the_same_mesh) {
    const TemporaryFolder folder;
    const Read found = read(folder / "a.obj", std::string(quad) + "f 1 2 3 4\n");
    EXPECT_EQ(written_name("a", *found.cloud.records), "a.ply");
    const std::vector<float> values{0.1F, 0.2F, 0.3F, 0.4F};
    write_cloud(folder / "b.ply", found.cloud, {{"ambient_occlusion", values}});
    std::vector<std::string> warnings;
    const Cloud again = read_cloud(folder / "b.ply", warnings);
    EXPECT_EQ(triangles_of(again), found.triangles);
    EXPECT_EQ(again.points, found.cloud.points);
    EXPECT_EQ(again.colours, found.cloud.colours);
    EXPECT_EQ(recorded_field(again, "ambient_occlusion", "b"), values);
}

struct Refused {
    const char *name, *bytes, *says;
};
void PrintTo(const Refused& row, std::ostream* to) { *to << row.says; }
class RefusedMeshes : public testing::TestWithParam<Refused> {};

TEST_P(RefusedMeshes, are_named_with_the_place) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const auto file = write_file(folder / GetParam().name, GetParam().bytes);
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(file, warnings); }), GetParam().says));
}

INSTANTIATE_TEST_SUITE_P(
    Of, RefusedMeshes,
    testing::Values(
        Refused{"a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/2 3/1\n",
                "a.obj line 5: vt 2, the file has 1 texture coordinates"},
        Refused{"a.obj", "f 1 2 3\nv 0 0 0\n", "a.obj line 1: vertex 3, the file has 1 vertices"},
        Refused{"a.obj", "v 0 0 0\nf -2 1 1\n", "line 2: vertex -2, the file has 1 vertices so far"},
        Refused{"a.obj", "v 0 0\n", "line 1: v with 2 numbers, expected at least 3"},
        Refused{"a.obj", "v 0 0 x\n", "line 1: \"x\" is not a number"},
        Refused{"a.obj", "v 0 0 0\nf 1 1\n", "line 2: a face of 2 corners, expected 3 or more"},
        Refused{"a.obj", "v 0 0 0\nf 1 /1 0\n", "line 2: a corner of a face names no vertex"},
        Refused{"a.glb", "glTF\2", "byte 4: the file ends in its header"},
        Refused{"a.gltf", "{}", "JSON without \"asset\""},
        Refused{"a.gltf", "{\"asset\": {\"version\": \"1.0\"}}", "glTF of version \"1.0\", expected 2.0"},
        Refused{"a.gltf", R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 8, "uri": "../a.bin"}]})",
                "buffer 0: \"../a.bin\" is no file in the folder of the glTF"},
        Refused{"a.gltf", R"({"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]})",
                "the file requires \"KHR_draco_mesh_compression\", which is not read"},
        Refused{"a.gltf", R"({"asset": {"version": "2.0"}, "nodes": [{"children": [1]}, {"children": [1]}]})",
                "node 1: met twice"},
        Refused{"a.gltf",
                R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes":
                   {"POSITION": 0}}]}], "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3",
                   "count": 9}], "bufferViews": [{"buffer": 0, "byteLength": 12}],
                   "buffers": [{"byteLength": 12, "uri": "data:;base64,AAAAAAAAAAAAAAAA"}]})",
                "node 0: primitive 0: accessor 0: 9 elements from byte 0 on do not fit into a buffer view of 12 bytes"},
        Refused{"a.gltf",
                R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes":
                   {"POSITION": 0}, "indices": 1}]}], "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3",
                   "count": 1}, {"bufferView": 0, "componentType": 5120, "type": "SCALAR", "count": 3}],
                   "bufferViews": [{"buffer": 0, "byteLength": 12}],
                   "buffers": [{"byteLength": 12, "uri": "data:;base64,/////wAAAAAAAAAA"}]})",
                "node 0: primitive 0: its indices are no whole numbers without a sign"},
        Refused{"a.gltf",
                R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"mode": 0,
                   "attributes": {}, "extensions": {"KHR_gaussian_splatting": {"kernel": "ellipse"}}}]}]})",
                "Gaussian splats (KHR_gaussian_splatting, kernel \"ellipse\") are read from .glb, PLY, .splat and "
                ".spz, not"}));

/// A GLB of one triangle in two places; one node mirrors it.
std::string triangle_glb(bool occlusion) {
    const std::vector<float> numbers{0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 1}; // positions, then coordinates
    Json json{{"asset", {{"version", "2.0"}}},
              {"extras", {{"keep", 0.1}}},
              {"scenes", {{{"nodes", {0, 1}}}}},
              {"nodes", {{{"mesh", 0}, {"translation", {5, 0, 0}}}, {{"mesh", 0}, {"scale", {-1, 1, 1}}}}},
              {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}}}}}}},
              {"accessors",
               {{{"bufferView", 0}, {"componentType", 5126}, {"type", "VEC3"}, {"count", 3}},
                {{"bufferView", 0}, {"byteOffset", 36}, {"componentType", 5126}, {"type", "VEC2"}, {"count", 3}}}},
              {"bufferViews", {{{"buffer", 0}, {"byteLength", 60}}}},
              {"buffers", {{{"byteLength", 60}}}}};
    if (occlusion) {
        json["materials"] = {{{"name", "m"}, {"occlusionTexture", {{"index", 0}}}}};
        json["meshes"][0]["primitives"][0]["material"] = 0;
    }
    std::string text = json.dump(), bin(60, '\0'), bytes = "glTF";
    std::memcpy(bin.data(), numbers.data(), bin.size());
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const auto word = [&](std::size_t value) {
        const auto small = static_cast<std::uint32_t>(value);
        bytes.append(reinterpret_cast<const char*>(&small), 4);
    };
    word(2), word(28 + text.size() + bin.size()), word(text.size());
    bytes += "JSON" + text;
    word(bin.size());
    return bytes + std::string("BIN\0", 4) + bin;
}

Json json_of(const std::string& glb) {
    std::uint32_t length = 0;
    std::memcpy(&length, glb.data() + 12, 4);
    return Json::parse(glb.substr(20, length));
}

TEST(Gltf, nodes_place_their_meshes_and_mirrors_keep_the_front) {
    const TemporaryFolder folder;
    const Read found = read(folder / "a.glb", triangle_glb(false));
    ASSERT_EQ(found.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}, {3, 5, 4}}));
    EXPECT_EQ(found.cloud.points[1], Eigen::Vector3d(7, 0, 0));
    EXPECT_EQ(found.cloud.points[4], Eigen::Vector3d(-2, 0, 0));
    const TexturedMesh mesh = textured_mesh(found.cloud, "a.glb");
    EXPECT_EQ(mesh.sets[0][0][1], Eigen::Vector2f(1, 0));
    EXPECT_EQ(mesh.sets[0][1][2], Eigen::Vector2f(1, 0)) << "corners and coordinates change together";
}

TEST(Gltf, gets_an_occlusion_texture_and_keeps_the_rest) {
    const TemporaryFolder folder;
    const std::string before = triangle_glb(false);
    const Read found = read(folder / "a.glb", before);
    const TexturedMesh mesh = textured_mesh(found.cloud, "a.glb");
    const std::vector<OcclusionLink> links{{0, 0, "a.ao.png", "an image"}};
    const LinkedFiles made = linked_mesh(found.cloud, folder / "a.glb", "a", mesh, links, false);
    const std::string& after = made.files.front().bytes;
    Json json = json_of(after);
    const Json texture = json["materials"][0]["occlusionTexture"];
    EXPECT_EQ(texture, (Json{{"index", 0}, {"texCoord", 0}, {"strength", 1}}));
    EXPECT_EQ(json["meshes"][0]["primitives"][0]["material"], 0) << "a primitive without a material gets one";
    const Json view = json["bufferViews"][json["images"][0]["bufferView"].get<std::size_t>()];
    const std::string bin = after.substr(28 + after.find("BIN") - 24);
    EXPECT_NE(after.find(before.substr(before.find("BIN") + 4)), std::string::npos) << "old bytes are there";
    EXPECT_NE(after.find("an image"), std::string::npos);
    EXPECT_EQ(view["byteOffset"], 60);
    for (const char* added : {"materials", "images", "textures"})
        json.erase(added);
    json["bufferViews"].erase(1);
    json["buffers"][0]["byteLength"] = 60;
    json["meshes"][0]["primitives"][0].erase("material");
    EXPECT_EQ(json, json_of(before));
    std::vector<std::string> warnings;
    EXPECT_EQ(read_cloud(write_file(folder / "b.glb", after), warnings).points, found.cloud.points);
}

TEST(Gltf, keeps_an_occlusion_texture_unless_asked) {
    const TemporaryFolder folder;
    const Read found = read(folder / "a.glb", triangle_glb(true));
    const TexturedMesh mesh = textured_mesh(found.cloud, "a.glb");
    const std::vector<OcclusionLink> links{{0, 0, "a.ao.png", "an image"}};
    EXPECT_TRUE(says(refusal([&] { (void)linked_mesh(found.cloud, "a.glb", "a", mesh, links, false); }),
                     "material \"m\" has an occlusionTexture already; --overwrite-occlusion replaces it"));
    EXPECT_EQ(linked_mesh(found.cloud, "a.glb", "a", mesh, links, true).files.size(), 1u);
}

TEST(Obj, materials_get_map_ka_behind_ka_or_at_their_end) {
    const TemporaryFolder folder;
    const std::string obj = "mtllib other.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
                            "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1/1 2/2 3/3\nusemtl c\nf 1/1 2/2 3/3\nusemtl d\n"
                            "f 1/1 2/2 3/3\n";
    write_file(folder / "other.mtl", "newmtl a\nKa 0 0 0\nmap_Kd -s 1 1 1 wood grain.png\n\nnewmtl b\nKd 1 1 1\n\n"
                                     "newmtl c\nKa 1 1 1\nmap_Ka old.png\n");
    const Read found = read(folder / "m.obj", obj);
    const TexturedMesh mesh = textured_mesh(found.cloud, folder / "m.obj");
    std::vector<OcclusionLink> links;
    for (std::size_t i = 0; i < 4; ++i)
        links.push_back({i, 0, mesh.materials[i].name + ".png", ""});
    const LinkedFiles made = linked_mesh(found.cloud, folder / "m.obj", "m", mesh, links, false);
    ASSERT_EQ(made.files.size(), 2u);
    EXPECT_EQ(made.files[0].bytes, "mtllib m.mtl" + obj.substr(obj.find('\n')));
    EXPECT_EQ(made.files[1].name, "m.mtl");
    EXPECT_EQ(made.files[1].bytes,
              "newmtl a\nKa 0 0 0\nmap_Ka a.png\nmap_Kd -s 1 1 1 wood grain.png\n\nnewmtl b\nKd 1 1 1\nmap_Ka b.png\n\n"
              "newmtl c\nKa 1 1 1\nmap_Ka old.png\n");
    EXPECT_EQ(made.copies, (std::vector<std::filesystem::path>{"wood grain.png", "old.png"}));
    ASSERT_EQ(made.notes.size(), 3u);
    EXPECT_TRUE(says(made.notes[0], "material \"a\": Ka is 0 0 0"));
    EXPECT_TRUE(says(made.notes[1], "material \"c\" has a map_Ka, which is kept: c.png is not linked"));
    EXPECT_TRUE(says(made.notes[2], "no MTL has the material \"d\": d.png is not linked"));
}

TEST(Ply, coordinates_are_of_vertices_or_of_corners) {
    const TemporaryFolder folder;
    const std::string head = "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 3\nproperty float x\n"
                             "property float y\nproperty float z\n";
    const std::string list = "element face 1\nproperty list uchar int vertex_indices\n";
    const Read corners =
        read(folder / "a.ply", head + list +
                                   "property list uchar float texcoord\nproperty int texnumber\nend_header\n"
                                   "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 0.25 7\n");
    const Read vertices = read(folder / "b.ply", head + "property float s\nproperty float t\n" + list +
                                                     "end_header\n0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 0.25\n3 0 1 2\n");
    for (const Read* each : {&corners, &vertices}) {
        const TexturedMesh mesh = textured_mesh(each->cloud, "a.ply");
        EXPECT_EQ(mesh.sets[0][0], (TextureCorners{Eigen::Vector2f(0, 1), {1, 1}, {0, 0.75F}}));
        EXPECT_EQ(mesh.materials[0].name, each == &corners ? "7" : "0");
    }
    const LinkedFiles made = linked_mesh(corners.cloud, "a.ply", "a", textured_mesh(corners.cloud, "a.ply"), {}, false);
    EXPECT_EQ(made.files[0].bytes, file_bytes(folder / "a.ply"));
    EXPECT_EQ(made.copies, (std::vector<std::filesystem::path>{"a.png"}));
}

} // namespace
} // namespace scanshade
