// Gaussian splats in PLY files: what they are is said, haze does not occlude, colours are theirs.
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/splats.h"
#include "tests/support/files.h"

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
const std::vector<std::string> of_2dgs{"x",       "y",       "z",       "f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0",
                                       "opacity", "scale_0", "scale_1", "rot_0",  "rot_1",  "rot_2",  "rot_3"};
const std::vector<std::string> in_another_order{"rot_3",   "rot_2",   "rot_1",   "rot_0",  "scale_2",
                                                "scale_1", "scale_0", "opacity", "f_dc_2", "f_dc_1",
                                                "f_dc_0",  "segment", "z",       "y",      "x"};

void PrintTo(const Splats& row, std::ostream* to) { *to << row.name; }

class SplatFiles : public testing::TestWithParam<Splats> {};

TEST_P(SplatFiles, are_told_and_their_haze_is_left_out) {
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
    EXPECT_TRUE(says(joined(warnings), "20 Gaussian splats")) << joined(warnings);
    EXPECT_TRUE(says(joined(warnings), "2 of them, of an opacity below 0.05, are left out")) << joined(warnings);
    EXPECT_TRUE(says(joined(warnings), "1 of an opacity below 0.5 occlude as solid ones do")) << joined(warnings);
    EXPECT_TRUE(says(describe(*cloud.records), "20 Gaussian splats"));
    EXPECT_TRUE(recorded_normals(cloud).empty()) << "zeros are no normals";
    EXPECT_FALSE(doubt_of_splats(cloud)) << "one of 18";
}

INSTANTIATE_TEST_SUITE_P(Of, SplatFiles,
                         testing::Values(Splats{"text", of_3dgs}, Splats{"flat", of_2dgs},
                                         Splats{"order", in_another_order}, Splats{"doubles", of_3dgs, {}, "double"},
                                         Splats{"binary", of_3dgs, {}, "float", "binary_little_endian"},
                                         Splats{"big_endian", of_2dgs, {}, "float", "binary_big_endian"}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(Splats, that_are_mostly_translucent_are_doubted) {
    const TemporaryFolder folder;
    const fs::path file =
        write_file(folder / "c.ply", ply_of({"", of_3dgs, {0.2, 0.2, 0.2, 0.2, 0.4}, "float", "binary_little_endian"}));
    const Frame frame = open_capture(file).load(0);
    EXPECT_TRUE(says(joined(frame.doubts), "25 % of the splats have an opacity below 0.5")) << joined(frame.doubts);
    const fs::path solid = write_file(folder / "solid.ply", ply_of({"", of_3dgs}));
    EXPECT_TRUE(open_capture(solid).load(0).doubts.empty());
}

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

TEST(Splats, that_are_packed_are_refused_by_name) {
    const TemporaryFolder folder;
    const fs::path file =
        write_file(folder / "c.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty uint packed_position\n"
                                     "property uint packed_rotation\nend_header\n1 2\n");
    std::vector<std::string> warnings;
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(file, warnings); }), "expected plain ones"));
}

} // namespace
} // namespace scanshade
