// Gaussian splats in binary glTF: what is read through nodes, what is written, and what is refused.
#include "io/clouds/cloud_file.h"
#include "io/clouds/splats.h"
#include "projection/srgb.h"
#include "tests/support/glb_file.h"
#include "tests/support/splat_glb.h"

#include <cmath>
#include <limits>

namespace scanshade {
namespace {

using nlohmann::json;
using namespace tests;
using Eigen::Vector3d, Eigen::Vector3f;

Cloud read(const TemporaryFolder& folder, const SplatGlb& file, std::vector<std::string>& warnings) {
    return read_cloud(write_file(folder / "a.glb", file.bytes()), warnings);
}

TEST(SplatGlb, is_read_through_its_nodes) {
    for (const bool logarithms : {false, true}) {
        const TemporaryFolder folder;
        std::vector<std::string> warnings;
        const Cloud cloud = read(folder, {.logarithms = logarithms}, warnings);
        EXPECT_EQ(warnings.size(), logarithms ? 1U : 0U) << joined(warnings);
        EXPECT_EQ(joined(warnings).find("SCALE has numbers below 0: taken as logarithms of sigmas") !=
                      std::string::npos,
                  logarithms);
        ASSERT_EQ(cloud.points.size(), 4U);
        EXPECT_EQ(cloud.points[0], Vector3d(1, 2, 3));
        EXPECT_LT((cloud.points[3] - Vector3d(10 - 3, -4, 6)).norm(), 1e-6) << "half a turn about z, twice as large";
        const auto splats = splats_of(cloud);
        EXPECT_EQ(splats[0].opacity, 1);
        EXPECT_NEAR(splats[1].opacity, 0.2, 1e-6);
        for (const std::size_t i : {0U, 1U, 2U, 3U}) {
            const float size = i < 2 ? 1 : 2;
            EXPECT_LT((splats[i].sigma - size * Vector3f(0.5F, 0.25F, 0.01F)).norm(), 1e-5);
            const Vector3f shortest = splats[i].rotation * Vector3f::UnitZ();
            EXPECT_NEAR(std::abs(i % 2 == 0 ? shortest.z() : shortest.y()), 1, 1e-5) << i;
        }
        EXPECT_EQ(cloud.colours[0][2], cv::saturate_cast<uchar>(255 * (0.5 + colour_of_degree_0)));
        EXPECT_TRUE(takes_fields(cloud));
    }
}

/// Sigmas along the axes of a node that stretches are those of what it shows.
TEST(SplatGlb, is_stretched_by_its_node) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const auto stretch = [](json& gltf) { gltf["nodes"][1]["scale"] = {1, 8, -1}; };
    const Cloud cloud = read(folder, {.change = stretch}, warnings);
    const Splat& flat = splats_of(cloud)[2];
    EXPECT_LT((flat.sigma - Vector3f(0.01F, 0.5F, 2)).norm(), 1e-5) << flat.sigma.transpose();
    EXPECT_NEAR(std::abs((flat.rotation * Vector3f::UnitX()).z()), 1, 1e-5);
    EXPECT_NEAR(std::abs((flat.rotation * Vector3f::UnitZ()).y()), 1, 1e-5);
    EXPECT_LT((splats_of(cloud)[3].sigma - Vector3f(0.08F, 0.25F, 0.5F)).norm(), 1e-5) << "a quarter about x before";
}

TEST(SplatGlb, gets_attributes_and_keeps_the_rest) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const SplatGlb file;
    const Cloud cloud = read(folder, file, warnings);
    const std::vector<float> values{0.25F, 0.5F, std::numeric_limits<float>::quiet_NaN(), 1};
    write_cloud(folder / "b.glb", cloud, {{"ambient_occlusion", values}});
    const Gltf before = gltf_in(folder / "a.glb"), after = gltf_in(folder / "b.glb");
    EXPECT_EQ(after.buffer.substr(0, before.buffer.size()), before.buffer);
    json rest = after.text;
    for (const std::size_t mesh : {0U, 1U}) {
        json& attributes = rest["meshes"][mesh]["primitives"][0]["attributes"];
        const auto stored = after.numbers<float>(attributes["_AMBIENT_OCCLUSION"].get<std::size_t>());
        EXPECT_EQ(stored, mesh == 0 ? (std::vector<float>{0.25F, 0.5F}) : (std::vector<float>{-1, 1}));
        attributes.erase("_AMBIENT_OCCLUSION");
    }
    for (const char* table : {"accessors", "bufferViews"})
        rest[table].erase(rest[table].end() - 2, rest[table].end());
    rest["buffers"] = before.text["buffers"];
    EXPECT_EQ(rest, before.text);
    // Again: the new values take the place of those.
    const Cloud again = read_cloud(folder / "b.glb", warnings);
    write_cloud(folder / "c.glb", again, {{"ambient_occlusion", std::vector<float>(4, 0.75F)}});
    const Gltf twice = gltf_in(folder / "c.glb");
    EXPECT_EQ(twice.attribute<float>("_AMBIENT_OCCLUSION"), std::vector<float>(2, 0.75F));
    EXPECT_EQ(twice.text["accessors"].size(), after.text["accessors"].size());
}

TEST(SplatGlb, is_shaded_in_all_its_coefficients) {
    for (const bool linear : {false, true}) {
        const TemporaryFolder folder;
        std::vector<std::string> warnings;
        const auto change = [&](json& gltf) {
            if (linear)
                gltf["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["colorSpace"] =
                    "lin_rec709_display";
        };
        const Cloud cloud = read(folder, {.change = change}, warnings);
        write_shaded_splats(folder / "b.glb", cloud,
                            std::vector<float>{0.5F, std::numeric_limits<float>::quiet_NaN(), 1, 1}, 1);
        const Gltf before = gltf_in(folder / "a.glb"), after = gltf_in(folder / "b.glb");
        EXPECT_EQ(after.text, before.text);
        const auto old = before.attribute<float>(splat_prefix + "SH_DEGREE_0_COEF_0"),
                   dc = after.attribute<float>(splat_prefix + "SH_DEGREE_0_COEF_0"),
                   rest = after.attribute<float>(splat_prefix + "SH_DEGREE_1_COEF_2");
        const auto fallback = after.attribute<std::uint8_t>("COLOR_0");
        for (const std::size_t k : {0U, 1U, 2U}) {
            const double colour = 0.5 + colour_of_degree_0 * static_cast<double>(old[k]);
            const double shaded = linear ? colour / 2 : srgb_from_linear(linear_from_srgb(colour) / 2);
            EXPECT_NEAR(0.5 + colour_of_degree_0 * static_cast<double>(dc[k]), shaded, 1e-6);
            EXPECT_NEAR(static_cast<double>(rest[k]), 0.1 * (static_cast<double>(k) + 1) * shaded / colour, 1e-6);
            EXPECT_NEAR(fallback[k], 128 * shaded / colour, 0.51);
            EXPECT_EQ(dc[3 + k], 0.5F) << "unknown: as it was";
        }
        EXPECT_EQ(fallback[3], 255);
        std::string restored = after.buffer;
        const std::size_t begin = before.buffer.size() / 2;
        EXPECT_EQ(restored.substr(begin), before.buffer.substr(begin)) << "light that nothing takes";
    }
}

struct Refused {
    const char* says;
    std::function<void(json&)> change;
};
void PrintTo(const Refused& row, std::ostream* to) { *to << row.says; }
class RefusedSplatGlb : public testing::TestWithParam<Refused> {};

TEST_P(RefusedSplatGlb, names_what_is_wrong) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const std::string said = refusal([&] { (void)read(folder, {.change = GetParam().change}, warnings); });
    EXPECT_TRUE(says(said, GetParam().says)) << said;
    EXPECT_TRUE(says(said, "a.glb")) << said;
}

json& extension(json& gltf) { return gltf["meshes"][1]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]; }
json& attributes(json& gltf) { return gltf["meshes"][1]["primitives"][0]["attributes"]; }

INSTANTIATE_TEST_SUITE_P(
    Of, RefusedSplatGlb,
    testing::Values(
        Refused{"node 1: primitive 0: splats of the kernel \"pyramid\" are not read",
                [](json& gltf) { extension(gltf)["kernel"] = "pyramid"; }},
        Refused{"packed by \"KHR_gaussian_splatting_compression_spz_2\" are not read",
                [](json& gltf) {
                    extension(gltf)["extensions"]["KHR_gaussian_splatting_compression_spz_2"] = json::object();
                }},
        Refused{"the file requires \"KHR_gaussian_splatting_compression_spz_2\"",
                [](json& gltf) { gltf["extensionsRequired"] = {"KHR_gaussian_splatting_compression_spz_2"}; }},
        Refused{"the colour space \"lin_p3\" are not read",
                [](json& gltf) { extension(gltf)["colorSpace"] = "lin_p3"; }},
        Refused{"mesh 1: primitive 0: KHR_gaussian_splatting:SCALE: is missing",
                [](json& gltf) { attributes(gltf).erase(splat_prefix + "SCALE"); }},
        Refused{"KHR_gaussian_splatting:OPACITY: 1 element for 2 splats",
                [](json& gltf) {
                    gltf["accessors"][attributes(gltf)[splat_prefix + "OPACITY"].get<std::size_t>()]["count"] = 1;
                }},
        Refused{"KHR_gaussian_splatting:ROTATION: elements of 3 numbers, expected 4",
                [](json& gltf) { attributes(gltf)[splat_prefix + "ROTATION"] = attributes(gltf)["POSITION"]; }},
        Refused{"mesh 0 of splats is shown by several nodes", [](json& gltf) { gltf["nodes"][1]["mesh"] = 0; }},
        Refused{"splats have the mode 0", [](json& gltf) { gltf["meshes"][1]["primitives"][0]["mode"] = 4; }}));

} // namespace
} // namespace scanshade
