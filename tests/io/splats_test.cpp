// Gaussian splats in PLY files: their shapes are read, haze is left out, colours are theirs and can be shaded.
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/splats.h"
#include "tests/support/files.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::joined;
using tests::refusal;
using tests::says;
using tests::TemporaryFolder;
using tests::write_file;

double logit(double opacity) { return std::log(opacity / (1 - opacity)); }

/// Twenty splats on a line, the k-th of opacity 0.99 but where `opacity` has another one for it. Red falls from 1 by
/// 0.05 a splat, green is a half, blue 0.
struct Splats {
    const char* name;
    std::vector<std::string> properties;
    std::vector<double> opacities = {}; ///< of the first ones
    std::string type = "float";
    std::string format = "ascii";
};

std::string ply_of(const Splats& splats) {
    std::string text = fmt::format("ply\nformat {} 1.0\nelement vertex 20\n", splats.format);
    for (const std::string& property : splats.properties)
        text += fmt::format("property {} {}\n", splats.type, property);
    text += "end_header\n";
    CloudRecords encoding;
    encoding.encoding = splats.format == "ascii"                  ? CloudRecords::Encoding::ascii
                        : splats.format == "binary_little_endian" ? CloudRecords::Encoding::binary
                                                                  : CloudRecords::Encoding::big_endian;
    for (std::size_t k = 0; k < 20; ++k) {
        for (const std::string& property : splats.properties) {
            constexpr double c0 = 0.28209479177387814;
            const double value = property == "x" ? static_cast<double>(k)
                                 : property == "opacity"
                                     ? logit(k < splats.opacities.size() ? splats.opacities[k] : 0.99)
                                 : property == "f_dc_0" ? (0.5 - 0.05 * static_cast<double>(k)) / c0
                                 : property == "f_dc_2" ? -0.5 / c0
                                 : property == "rot_0"  ? 1
                                                        : 0;
            text += encoded(encoding, splats.type == "double" ? Scalar::float64 : Scalar::float32, value);
            text += encoding.text() ? " " : "";
        }
        text += encoding.text() ? "\n" : "";
    }
    return text;
}

const std::vector<std::string> of_3dgs{"x",       "y",      "z",      "nx",      "ny",      "nz",
                                       "f_dc_0",  "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
                                       "scale_2", "rot_0",  "rot_1",  "rot_2",   "rot_3"};
const std::vector<std::string> of_2dgs{"x",       "y",       "z",     "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                                       "scale_0", "scale_1", "rot_0", "rot_1",  "rot_2",  "rot_3"};
const std::vector<std::string> in_another_order{"rot_3",   "rot_2",   "rot_1",   "rot_0",  "scale_2",
                                                "scale_1", "scale_0", "opacity", "f_dc_2", "f_dc_1",
                                                "f_dc_0",  "segment", "z",       "y",      "x"};

void PrintTo(const Splats& row, std::ostream* to) { *to << row.name; }

class SplatFiles : public testing::TestWithParam<Splats> {};

TEST_P(SplatFiles, are_read_and_their_haze_is_left_out) {
    Splats splats = GetParam();
    splats.opacities = {0.002, 0.3, 0.99, std::numeric_limits<double>::quiet_NaN()};
    const TemporaryFolder folder;
    const fs::path file = write_file(folder / "c.ply", ply_of(splats));
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    ASSERT_EQ(cloud.points.size(), 20U);
    for (std::size_t k = 0; k < 20; ++k) {
        EXPECT_EQ(cloud.points[k].allFinite(), k != 0 && k != 3) << k;
        EXPECT_NEAR(cloud.colours[k][2], 255 * (1 - 0.05 * static_cast<double>(k)), 0.51) << k;
        EXPECT_NEAR(cloud.colours[k][1], 127.5, 0.51);
        EXPECT_EQ(cloud.colours[k][0], 0);
    }
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
    ASSERT_EQ(splats_of(cloud).size(), 20U);
    EXPECT_NEAR(splats_of(cloud)[1].opacity, 0.3, 1e-6);
    EXPECT_EQ(splats_of(cloud)[3].opacity, 0);
    const bool flat = std::ranges::find(splats.properties, "scale_2") == splats.properties.end();
    EXPECT_EQ(splats_of(cloud)[2].sigma, Eigen::Vector3f(1, 1, flat ? 0 : 1));
    EXPECT_EQ(points_with_haze(cloud)[0], Eigen::Vector3d::Zero());
    EXPECT_TRUE(says(describe(*cloud.records), "20 Gaussian splats"));
    EXPECT_TRUE(recorded_normals(cloud).empty()) << "zeros are no normals";
}

INSTANTIATE_TEST_SUITE_P(Of, SplatFiles,
                         testing::Values(Splats{"text", of_3dgs}, Splats{"flat", of_2dgs},
                                         Splats{"order", in_another_order}, Splats{"doubles", of_3dgs, {}, "double"},
                                         Splats{"binary", of_3dgs, {}, "float", "binary_little_endian"},
                                         Splats{"big_endian", of_2dgs, {}, "float", "binary_big_endian"}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(Splats, are_written_back_with_a_field_more_and_no_other_change) {
    const TemporaryFolder folder;
    const fs::path file = write_file(folder / "c.ply", ply_of({"", of_3dgs, {0.002}, "float", "binary_little_endian"}));
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    const std::vector<float> values(20, 0.5F);
    write_cloud(folder / "out.ply", cloud, {{"ambient_occlusion", values}});
    const Cloud again = read_cloud(folder / "out.ply", warnings);
    ASSERT_EQ(again.records->fields.size(), of_3dgs.size() + 1);
    for (std::size_t k = 0; k < 20; ++k)
        EXPECT_TRUE(again.records->record(k).starts_with(cloud.records->record(k))) << k;
}

TEST(Splats, are_points_where_a_field_is_missing) {
    const TemporaryFolder folder;
    for (const char* missing : {"opacity", "rot_3", "scale_0", "f_dc_1"}) {
        std::vector<std::string> properties = of_3dgs;
        std::erase(properties, missing);
        const fs::path file = write_file(folder / "c.ply", ply_of({"", properties, {0.002}}));
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(file, warnings);
        EXPECT_TRUE(cloud.points[0].allFinite()) << missing;
        EXPECT_TRUE(warnings.empty()) << missing << joined(warnings);
    }
}

/// One splat of three coefficients a channel, with a turned quaternion that is not of length 1.
std::string one_splat(const std::vector<double>& colour, bool every_rest = true) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex 1\n";
    std::string values;
    const auto put = [&](const std::string& name, double value) {
        text += "property double " + name + "\n";
        values += fmt::format("{:.17g} ", value);
    };
    for (const char* name : {"x", "y", "z", "opacity"})
        put(name, 1);
    for (int k = 0; k < 3; ++k)
        put(fmt::format("f_dc_{}", k), (colour[static_cast<std::size_t>(k)] - 0.5) / 0.28209479177387814);
    for (int k = 0; k < 9; ++k)
        put(k == 8 && !every_rest ? "other" : fmt::format("f_rest_{}", k), 0.1 * (k + 1));
    for (int k = 0; k < 3; ++k)
        put(fmt::format("scale_{}", k), std::log(k + 1.0));
    for (const auto& [name, value] : {std::pair("rot_0", 2.0), {"rot_1", 0.0}, {"rot_2", 0.0}, {"rot_3", -2.0}})
        put(name, value);
    return text + "end_header\n" + values + "\n";
}

TEST(Splats, have_the_shapes_that_the_file_says) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(write_file(folder / "c.ply", one_splat({1, 1, 1})), warnings);
    const Splat& splat = splats_of(cloud).front();
    EXPECT_LT((splat.sigma - Eigen::Vector3f(1, 2, 3)).norm(), 1e-5);
    EXPECT_NEAR(splat.opacity, 1 / (1 + std::exp(-1)), 1e-6);
    EXPECT_LT((splat.rotation * Eigen::Vector3f::UnitX() + Eigen::Vector3f::UnitY()).norm(), 1e-6) << "w x y z";
}

TEST(Splats, with_a_gap_in_their_coefficients_are_refused) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const fs::path file = write_file(folder / "c.ply", one_splat({1, 1, 1}, false));
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(file, warnings); }),
                     "c.ply: property f_rest_8 is missing: 9, 24 or 45 are expected"));
}

double linear(double colour) { return colour <= 0.04045 ? colour / 12.92 : std::pow((colour + 0.055) / 1.055, 2.4); }

/// All coefficients of a channel shrink as the displayed colour does, which is that of linear light.
TEST(Splats, are_shaded_as_they_are_displayed) {
    constexpr double visibility = 0.4, strength = 0.5, light = 1 - strength + strength * visibility;
    const std::vector<double> colour{0.8, 0.03, 1.3};
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(write_file(folder / "c.ply", one_splat(colour)), warnings);
    const std::vector<float> values{static_cast<float>(visibility)};
    write_shaded_splats(folder / "out.ply", cloud, values, strength);
    const Cloud shaded = read_cloud(folder / "out.ply", warnings);
    const auto value = [](const Cloud& of, const std::string& name) {
        return value_at(*of.records, of.records->record(0), *of.records->field_named(name));
    };
    for (int channel = 0; channel < 3; ++channel) {
        const double before = colour[static_cast<std::size_t>(channel)];
        const double after = 0.5 + 0.28209479177387814 * value(shaded, fmt::format("f_dc_{}", channel));
        EXPECT_NEAR(linear(after), light * linear(before), 1e-6) << channel;
        for (int k = 3 * channel; k < 3 * channel + 3; ++k)
            EXPECT_NEAR(value(shaded, fmt::format("f_rest_{}", k)), 0.1 * (k + 1) * after / before, 1e-6) << k;
    }
    for (const char* name : {"x", "opacity", "scale_1", "rot_3"})
        EXPECT_EQ(value(shaded, name), value(cloud, name));
    write_shaded_splats(folder / "out.ply", cloud, std::vector{std::numeric_limits<float>::quiet_NaN()}, 1);
    EXPECT_EQ(tests::file_bytes(folder / "out.ply"), tests::file_bytes(folder / "c.ply")) << "nothing is known";
}

} // namespace
} // namespace scanshade
