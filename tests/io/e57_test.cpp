// E57: files made here with pages, packets and XML of every kind, read as clouds; damaged ones refused by name.
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/e57/e57.h"
#include "tests/support/data.h"
#include "tests/support/e57_file.h"
#include "tests/support/files.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

double value(const Cloud& cloud, std::size_t point, const std::string& field) {
    const auto found = cloud.records->field_named(field);
    EXPECT_TRUE(found) << field;
    return found ? value_at(*cloud.records, cloud.records->record(point), *found) : 0;
}

Cloud read(const fs::path& file) {
    std::vector<std::string> warnings;
    Cloud cloud = read_cloud(file, warnings);
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
    return cloud;
}

TEST(E57, images_are_named_with_their_cameras_and_not_used) {
    const TemporaryFolder folder;
    const auto image = [](const std::string& name, const std::string& content) {
        return "<vectorChild type=\"Structure\"><name type=\"String\">" + name + "</name>" + content + "</vectorChild>";
    };
    const std::string pose = "<pose type=\"Structure\"><translation type=\"Structure\"><x type=\"Float\">1</x><y "
                             "type=\"Float\">2.5</y></translation></pose>",
                      pinhole =
                          "<pinholeRepresentation type=\"Structure\"><imageWidth>1600</imageWidth><imageHeight>1200"
                          "</imageHeight><focalLength>0.015</focalLength><pixelWidth>1e-5</pixelWidth><pixelHeight>"
                          "2e-5</pixelHeight><principalPointX>800</principalPointX><principalPointY>600.5"
                          "</principalPointY></pinholeRepresentation>";
    const std::string images =
        image("front", pose + pinhole) +
        image("back", "<pinholeRepresentation><imageWidth>8</imageWidth><imageHeight>6</imageHeight>"
                      "</pinholeRepresentation>") +
        image("", "<sphericalRepresentation><imageWidth>x</imageWidth></sphericalRepresentation>") + image("odd", "");
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(write_file(folder / "a.e57", e57_file({float_scan(5)}, "", images)), warnings);
    EXPECT_EQ(cloud.points.size(), 5U);
    EXPECT_TRUE(warned(warnings, "image 0 \"front\": pinhole, 1600x1200, fx 1500 fy 750 cx 800 cy 600.5, at 1.00 2.50 "
                                 "0.00; not used"));
    EXPECT_TRUE(warned(warnings, "image 1 \"back\": pinhole, 8x6, no usable camera (focal length 0 m); not used"));
    EXPECT_TRUE(warned(warnings, "image 2: spherical; damaged: imageWidth is \"x\", expected a number"));
    EXPECT_TRUE(warned(warnings, "image 3 \"odd\": of an unknown kind"));
    EXPECT_TRUE(
        says(refusal([&] { (void)read_cloud(write_file(folder / "b.e57", e57_file({}, "", images)), warnings); }),
             "no scan in this E57 (4 images; image 0 \"front\": pinhole, 1600x1200"));
}

TEST(E57, the_checksum_is_castagnolis) {
    EXPECT_EQ(e57::checksum("123456789"), 0xe3069283U); // the check value of catalogues
}

TEST(E57, integers_of_every_width_return) {
    const TemporaryFolder folder;
    for (const unsigned width : {0U, 1U, 3U, 7U, 8U, 11U, 17U, 33U, 46U, 53U, 63U, 64U}) {
        SCOPED_TRACE(width);
        TestScan scan = float_scan(400);
        const std::int64_t minimum = width == 64 ? std::numeric_limits<std::int64_t>::min() : -5;
        const std::uint64_t range = width == 64 ? ~std::uint64_t(0) : (std::uint64_t(1) << width) - 1;
        const auto maximum = static_cast<std::int64_t>(static_cast<std::uint64_t>(minimum) + range);
        scan.prototype += fmt::format("<timeStamp type=\"Integer\" minimum=\"{}\" maximum=\"{}\"/>", minimum, maximum);
        Bits bits;
        std::vector<double> expected;
        for (std::uint64_t i = 0; i < scan.count; ++i) {
            const std::uint64_t stored = i * 0x9e3779b97f4a7c15U & range;
            bits.add(stored, width);
            expected.push_back(
                static_cast<double>(static_cast<std::int64_t>(static_cast<std::uint64_t>(minimum) + stored)));
        }
        scan.streams.push_back(bits.bytes());
        const Cloud cloud = read(write_file(folder / "a.e57", e57_file({scan})));
        ASSERT_EQ(cloud.points.size(), scan.count);
        for (std::size_t i = 0; i < scan.count; ++i) {
            ASSERT_EQ(value(cloud, i, "timeStamp"), expected[i]) << i;
            const double x = static_cast<double>(i);
            ASSERT_EQ(cloud.points[i], Eigen::Vector3d(x, x + 0.25, x + 0.5));
        }
    }
}

TEST(E57, points_are_scaled_placed_and_invalid_ones_are_holes) {
    const TemporaryFolder folder;
    TestScan scan;
    // A quarter turn about z, given twice as long as a unit quaternion.
    const double half = std::numbers::sqrt2;
    scan.before = fmt::format("<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">{0}</w><z "
                              "type=\"Float\">{0}</z></rotation><translation type=\"Structure\"><x "
                              "type=\"Float\">5.0e+005</x></translation></pose><colorLimits type=\"Structure\">"
                              "<colorRedMinimum type=\"Integer\">0</colorRedMinimum><colorRedMaximum "
                              "type=\"Integer\">1023</colorRedMaximum></colorLimits>",
                              half);
    for (const char* axis : {"X", "Y", "Z"})
        scan.prototype +=
            fmt::format("<cartesian{} type=\"ScaledInteger\" minimum=\"-100\" maximum=\"155\" scale=\"0.5\" "
                        "offset=\"2\"/>",
                        axis);
    scan.prototype += "<cartesianInvalidState type=\"Integer\" minimum=\"0\" maximum=\"2\"/>"
                      "<colorRed type=\"Integer\" minimum=\"0\" maximum=\"1023\"/>"
                      "<colorGreen type=\"Integer\" minimum=\"0\" maximum=\"255\"/><colorBlue type=\"Integer\" "
                      "minimum=\"0\" maximum=\"65535\"/><intensity type=\"Float\" precision=\"single\"/>";
    scan.count = 2;
    scan.streams = {"\x66\x66",
                    "\x68\x68",
                    "\x64\x64",
                    std::string(1, '\x08'),
                    "",
                    "\x11\x22",
                    raw(std::uint32_t(0xffff0000)),
                    raw(0.5F) + raw(0.75F)}; // x y z: 2 + 0.5 * (2, 4, 0); states 0 and 2
    Bits red;
    red.add(1023, 10), red.add(0, 10);
    scan.streams[4] = red.bytes();
    const Cloud cloud = read(write_file(folder / "a.e57", e57_file({scan})));
    EXPECT_NEAR((cloud.points[0] - Eigen::Vector3d(500000 - 4, 3, 2)).norm(), 0, 1e-9);
    EXPECT_TRUE(cloud.points[1].array().isNaN().all());
    EXPECT_EQ(cloud.colours[0], cv::Vec3b(0, 0x11, 255));
    EXPECT_EQ(cloud.colours[1], cv::Vec3b(255, 0x22, 0));
    EXPECT_EQ(value(cloud, 1, "intensity"), 0.75);
    EXPECT_EQ(cloud.records->viewpoint->translation(), Eigen::Vector3d(500000, 0, 0));

    const std::array visibility{0.5F, 0.25F};
    write_cloud(folder / "b.ply", cloud, {{"ambient_occlusion", visibility}});
    std::vector<std::string> warnings;
    const Cloud back = read_cloud(folder / "b.ply", warnings);
    EXPECT_EQ(extension(*cloud.records), ".ply");
    EXPECT_EQ(back.points[0], cloud.points[0]);
    EXPECT_EQ(value(back, 1, "ambient_occlusion"), 0.25);
    for (const CloudField& field : cloud.records->fields)
        if (field.name.size() > 1) { // the others may be NaN
            EXPECT_EQ(value(back, 1, field.name), value(cloud, 1, field.name));
        }
}

TEST(E57, spherical_coordinates_become_points) {
    const TemporaryFolder folder;
    TestScan scan;
    for (const char* name : {"sphericalRange", "sphericalAzimuth", "sphericalElevation"})
        scan.prototype += fmt::format("<{} type=\"Float\"/>", name);
    const double quarter = std::numbers::pi / 2;
    scan.streams = {raw(2.0) + raw(4.0), raw(quarter) + raw(0.0), raw(0.0) + raw(quarter / 3)};
    scan.count = 2;
    const Cloud cloud = read(write_file(folder / "a.e57", e57_file({scan})));
    EXPECT_NEAR((cloud.points[0] - Eigen::Vector3d(0, 2, 0)).norm(), 0, 1e-12); // along y
    EXPECT_NEAR((cloud.points[1] - Eigen::Vector3d(4 * std::cos(quarter / 3), 0, 2)).norm(), 0, 1e-12);
    EXPECT_EQ(value(cloud, 1, "sphericalRange"), 4) << "what the file had stays";
}

TEST(E57, a_complete_grid_is_organised_and_others_stay_lists) {
    const TemporaryFolder folder;
    TestScan scan = float_scan(6);
    scan.prototype += "<rowIndex type=\"Integer\" minimum=\"0\" maximum=\"255\"/><columnIndex type=\"Integer\" "
                      "minimum=\"0\" maximum=\"255\"/>";
    scan.streams.emplace_back("\4\5\4\5\4\5"); // column after column
    scan.streams.emplace_back("\1\1\2\2\3\3");
    const Cloud cloud = read(write_file(folder / "a.e57", e57_file({scan})));
    EXPECT_EQ(cloud.grid, cv::Size(3, 2));
    EXPECT_EQ(cloud.points[1].x(), 2) << "row 4, column 2 was the third";
    EXPECT_EQ(cloud.points[3].x(), 1);
    const std::vector<float> values(6, 0.5F);
    write_cloud(folder / "b.ply", cloud, {{"ambient_occlusion", values}});
    EXPECT_EQ(read(folder / "b.ply").grid, cv::Size(3, 2));

    scan.streams.back() = "\1\1\2\2\3\2"; // a cell twice
    std::vector<std::string> warnings;
    EXPECT_EQ(read_cloud(write_file(folder / "c.e57", e57_file({scan})), warnings).grid, cv::Size(6, 1));
    EXPECT_TRUE(warned(warnings, "two points are in row 5, column 2"));
}

TEST(E57, several_scans_are_one_cloud_with_a_field_that_tells_them_apart) {
    const TemporaryFolder folder;
    TestScan second = float_scan(2, 100);
    second.before =
        "<pose type=\"Structure\"><translation type=\"Structure\"><z type=\"Float\">7</z></translation></pose>";
    second.prototype += "<intensity type=\"Integer\" minimum=\"0\" maximum=\"255\"/>";
    second.streams.emplace_back("\7\x8");
    std::vector<std::string> warnings;
    const Cloud cloud =
        read_cloud(write_file(folder / "a.e57", e57_file({float_scan(3), second, float_scan(0)})), warnings);
    EXPECT_TRUE(warned(warnings, "3 scans are read as one cloud"));
    ASSERT_EQ(cloud.points.size(), 5U);
    EXPECT_EQ(cloud.points[3], Eigen::Vector3d(100, 100.25, 107.5));
    ASSERT_EQ(cloud.records->stations.size(), 3U);
    EXPECT_EQ(cloud.records->stations[1].first, 3U);
    EXPECT_EQ(cloud.records->stations[1].position, Eigen::Vector3d(0, 0, 7));
    EXPECT_EQ(cloud.records->stations[2].first, 5U) << "a scan without points";
    EXPECT_EQ(value(cloud, 2, "scan"), 0);
    EXPECT_EQ(value(cloud, 3, "scan"), 1);
    EXPECT_EQ(value(cloud, 2, "intensity"), 0);
    EXPECT_EQ(value(cloud, 4, "intensity"), 8);
}

std::string refused(const fs::path& file, const std::string& bytes) {
    std::vector<std::string> warnings;
    return refusal([&] { (void)read_cloud(write_file(file, bytes), warnings); });
}

TEST(E57, damage_is_refused_by_name_and_place) {
    const TemporaryFolder folder;
    const fs::path file = folder / "a.e57";
    const std::string sound = e57_file({float_scan(200)});
    std::string damaged = sound;
    damaged[2500] ^= 4;
    EXPECT_TRUE(says(refused(file, damaged), "a.e57: page 2 (byte 2048): checksum"));
    for (std::size_t length = 8; length < sound.size(); length += 97)
        EXPECT_TRUE(says(refused(file, sound.substr(0, length)), "the file is cut short"));
    EXPECT_TRUE(says(refused(file, sound.substr(0, 2048)), "it is cut short"));
    TestScan more = float_scan(200);
    ++more.count;
    EXPECT_TRUE(says(refused(file, e57_file({more})), "scan 0: cartesianX holds 200 values, 201 records"));
    TestScan lost = float_scan(4);
    lost.prototype = lost.prototype.substr(0, lost.prototype.find("<cartesianZ"));
    lost.streams.pop_back();
    EXPECT_TRUE(says(refused(file, e57_file({lost})), "scan 0: neither cartesianX Y Z nor spherical"));
    TestScan narrow = float_scan(4);
    narrow.prototype += "<rowIndex type=\"Integer\" minimum=\"0\" maximum=\"5\"/>";
    narrow.streams.emplace_back("\xff\xff"); // 7 in three bits
    EXPECT_TRUE(says(refused(file, e57_file({narrow})), "rowIndex of point 0 is 7 above its minimum"));
    TestScan turned = float_scan(4);
    turned.before = "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">0</w></rotation></pose>";
    EXPECT_TRUE(says(refused(file, e57_file({turned})), "scan 0: a rotation of length 0"));
    EXPECT_TRUE(says(refused(file, e57_file({})), "no scan in this E57"));
    EXPECT_TRUE(says(refused(file, e57_file({float_scan(4)}, "<!DOCTYPE e57Root>")), "document type"));
    TestScan codec = float_scan(4);
    codec.prototype += "</prototype><codecs><vectorChild/></codecs><prototype>";
    EXPECT_TRUE(says(refused(file, e57_file({codec})), "uses codecs"));
    TestScan constant{.before = "", .prototype = "", .streams = {"", "", ""}, .count = 2147483647};
    for (const char* axis : {"X", "Y", "Z"})
        constant.prototype += fmt::format("<cartesian{} type=\"Integer\" minimum=\"1\" maximum=\"1\"/>", axis);
    EXPECT_TRUE(says(refused(file, e57_file({constant})), "for which nothing is stored"));
}

TEST(E57, any_changed_byte_under_a_sound_checksum_is_read_or_refused) {
    const TemporaryFolder folder;
    TestScan scan = float_scan(30);
    scan.prototype += "<rowIndex type=\"Integer\" minimum=\"0\" maximum=\"5\"/>";
    scan.streams.emplace_back(12, '\0');
    const std::string sound = e57_file({scan});
    for (std::size_t at = 8; at < sound.size(); ++at) {
        if (at % 1024 >= 1020)
            continue;
        for (const char* change : {"\xff", "\x31"}) {
            std::string damaged = sound, page;
            damaged[at] = *change;
            const std::size_t first = at / 1024 * 1024;
            const std::string sum = raw(e57::checksum(std::string_view(damaged).substr(first, 1020)));
            std::copy(sum.rbegin(), sum.rend(), damaged.begin() + static_cast<std::ptrdiff_t>(first + 1020));
            std::vector<std::string> warnings;
            Cloud cloud;
            write_file(folder / "a.e57", damaged);
            if (refusal([&] { cloud = read_cloud(folder / "a.e57", warnings); }).empty()) {
                EXPECT_LE(cloud.points.size(), 30U) << at;
            }
        }
    }
}

TEST(E57, a_recorded_cloud_has_the_known_sums) {
    const fs::path folder = tests::data_folder() / "e57";
    NEEDS(folder / "bunnyInt32.e57");
    const Cloud cloud = read(folder / "bunnyInt32.e57");
    ASSERT_EQ(cloud.points.size(), 30571U);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), low = cloud.points[0], high = low;
    for (const Eigen::Vector3d& point : cloud.points) {
        sum += point;
        low = low.cwiseMin(point), high = high.cwiseMax(point);
    }
    constexpr double rounded = 5e-6; // the known sums have five decimals
    EXPECT_LE((sum - Eigen::Vector3d(-841.0933, 3151.19874, 264.24397)).cwiseAbs().maxCoeff(), rounded);
    EXPECT_NEAR((low - Eigen::Vector3d(-0.094689, 0.040011, -0.061873)).norm(), 0, 1e-12);
    EXPECT_NEAR((high - Eigen::Vector3d(0.061009, 0.187321, 0.058799)).norm(), 0, 1e-12);
    std::vector<std::string> warnings;
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(folder / "PinholeImageWithDistortionParameters.e57", warnings); }),
                     "no scan in this E57 (3 images; image 0"));
}

} // namespace
} // namespace scanshade
