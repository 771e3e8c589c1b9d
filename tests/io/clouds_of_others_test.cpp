// Clouds as other programs write them: headers, names, line ends and colours that nobody specified.
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/format.h"
#include "tests/support/files.h"

#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>
#include <sstream>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::joined;
using tests::refusal;
using tests::says;
using tests::TemporaryFolder;
using tests::write_file;

/// Sixteen points on the corners of a grid: the k-th at k % 4, k / 4, 1, followed by what `rest` gives for it.
std::string rows(
    const std::string& between, const std::function<std::string(int)>& rest = [](int) { return ""; },
    const std::string& end = "\n") {
    std::string text;
    for (int k = 0; k < 16; ++k)
        text += fmt::format("{1}{0}{2}{0}1{3}{4}", between, (7 * k) % 4, (7 * k) / 4 % 4, rest(k), end);
    return text;
}
const auto none = [](int) { return std::string(); };
const auto bytes = [](int k) { return fmt::format(" {} {} {}", 10 * k, 255 - k, 0); };
const auto fractions = [](int k) { return fmt::format(" {} {} {}", k / 255.0, 1 - k / 255.0, 0); };

const auto comma_bytes = [](int k) { return fmt::format(",{},{},{}", 10 * k, 255 - k, 0); };

/// Every number with a fraction, and a comma for its point.
std::string commas(const std::string& text) {
    std::string result;
    for (const char c : text)
        result += c == '\t' || c == '\n' ? std::string(",0") + c : std::string(1, c);
    return result;
}
std::string quoted(const std::string& text) {
    std::string result = "\"";
    for (const char c : text)
        result += c == ',' ? "\",\"" : c == '\n' ? "\"\n\"" : std::string(1, c);
    result.pop_back();
    return result;
}
/// UTF-16 with its mark.
std::string two_bytes(const std::string& text) {
    std::string result = "\xff\xfe";
    for (const char c : text)
        result += std::string{c, '\0'};
    return result;
}
struct TextCloud {
    const char* name; ///< of the file
    std::string text;
    cv::Vec3b last_colour = {}; ///< of point 15, BGR; 0 = there are none
    const char* warning = nullptr;
    double unit = 1; ///< metres
};

void PrintTo(const TextCloud& row, std::ostream* to) { *to << row.name; }

class TextClouds : public testing::TestWithParam<TextCloud> {};

TEST_P(TextClouds, are_read_and_written_back_with_a_field_more) {
    const TextCloud& row = GetParam();
    const TemporaryFolder folder;
    const fs::path file = write_file(folder / row.name, row.text);
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    ASSERT_EQ(cloud.points.size(), 16U);
    EXPECT_EQ(cloud.points[5], row.unit * Eigen::Vector3d(3, 0, 1));
    EXPECT_EQ(warnings.empty(), row.warning == nullptr) << joined(warnings);
    EXPECT_TRUE(says(joined(warnings), row.warning ? row.warning : "")) << joined(warnings);
    ASSERT_EQ(cloud.colours.empty(), row.last_colour == cv::Vec3b());
    if (!cloud.colours.empty()) {
        EXPECT_EQ(cloud.colours[15], row.last_colour);
    }
    EXPECT_TRUE(is_cloud(file_bytes(file), file));

    const std::vector<float> values(16, 0.5F);
    const fs::path out = folder / ("out-" + std::string(row.name));
    write_cloud(out, cloud, {{"ambient_occlusion", values}});
    const Cloud again = read_cloud(out, warnings);
    EXPECT_EQ(again.points, cloud.points);
    EXPECT_EQ(again.records->fields.size(), cloud.records->fields.size() + 1) << file_bytes(out);
}

INSTANTIATE_TEST_SUITE_P(
    Of, TextClouds,
    testing::Values(
        TextCloud{"byte_order_mark.csv", "\xEF\xBB\xBFx,y,z\n" + rows(",")},
        TextCloud{"byte_order_mark.xyz", "\xEF\xBB\xBF" + rows(" ")},
        TextCloud{"units.csv", "X [m],Y [m],Z [m]\n" + rows(",")},
        TextCloud{"millimetres.csv", "X [mm],Y [mm],Z [mm]\n" + rows(","), {}, nullptr, 0.001},
        TextCloud{"survey.csv", "Easting,Northing,Elevation\n" + rows(",")},
        TextCloud{"height.csv", "x,y,z,height\n" + rows(",", [](int) { return ",2"; })},
        TextCloud{"sentence.xyz", "# x y z in metres\n" + rows(" ")},
        TextCloud{"comments.xyz", "# by hand\n# x y\n" + rows(" ")},
        TextCloud{"names_in_a_comment.txt", "# by hand\n# x y z r g b\n" + rows(" ", bytes), {0, 240, 150}},
        TextCloud{"names_then_count.asc",
                  "//X Y Z Rf Gf Bf\n16\n" + rows(" ", fractions),
                  {0, 240, 15},
                  "taken as fractions"},
        TextCloud{"fractions.txt", "x y z r g b\n" + rows(" ", fractions), {0, 240, 15}, "taken as fractions"},
        TextCloud{"crlf.xyz", rows(" ", none, "\r\n")},
        TextCloud{"scalar_last.xyz", rows(" ", [](int k) { return bytes(k) + " 255.0"; }), {0, 240, 150}},
        TextCloud{"intensity_first.xyz", rows(" ", [](int k) { return " 7" + bytes(k); }), {0, 240, 150}},
        TextCloud{"wide_intensity.xyz", rows(" ", [](int k) { return " 2000" + bytes(k); }), {0, 240, 150}},
        TextCloud{"either.xyz",
                  rows(" ", [](int k) { return fmt::format(" {} {} {} {}", k, 10 * k, 255 - k, k + 1); }),
                  {16, 240, 150},
                  "taken as x y z intensity red green blue"},
        TextCloud{"two_scans.pts",
                  "8\n" + rows(" ").substr(0, 8 * 6) + "8\n" + rows(" ").substr(8 * 6),
                  {},
                  "2 scans are read as one cloud"},
        TextCloud{"positions.csv", "pos_x,pos_y,pos_z\n" + rows(",")},
        TextCloud{"camel.csv", "PosX,PosY,PosZ\n" + rows(",")},
        TextCloud{"two_words.csv", "Point X,Point Y,Point Z\n" + rows(",")},
        TextCloud{"points.csv", "points.x,points.y,points.z\n" + rows(",")},
        TextCloud{"coordinates.csv", "xcoord,ycoord,zcoord\n" + rows(",")},
        TextCloud{"ouster.csv", "X1 (mm), Y1 (mm), Z1 (mm)\n" + rows(", "), {}, nullptr, 0.001},
        TextCloud{"unit_behind.csv", "x_mm,y_mm,z_mm\n" + rows(","), {}, nullptr, 0.001},
        TextCloud{"unit_slash.csv", "x/cm,y/cm,z/cm\n" + rows(","), {}, nullptr, 0.01},
        TextCloud{"unit_of_another.csv", "x,y,z,range [mm]\n" + rows(",", [](int) { return ",7"; })},
        TextCloud{"units_below.txt", "X Y Z\n[mm] [mm] [mm]\n" + rows(" "), {}, nullptr, 0.001},
        TextCloud{"survey_letters.csv", "E,N,H\n" + rows(",")},
        TextCloud{"german.csv", "Rechtswert;Hochwert;Hoehe\n" + rows(";")},
        TextCloud{"decimal_commas.txt", commas(rows("\t", none))},
        TextCloud{"decimal_commas_named.txt", "X\tY\tZ\n" + commas(rows("\t", none))},
        TextCloud{"quoted.csv", "\"x\",\"y\",\"z\"\n" + quoted(rows(","))},
        TextCloud{"excel.csv", "sep=;\nX;Y;Z\n" + rows(";")},
        TextCloud{"excel_mark.csv", "\xEF\xBB\xBFsep=;\nX;Y;Z\n" + rows(";")},
        TextCloud{"footer.xyz", rows(" ") + "# end of file\n"}, TextCloud{"footer_word.xyz", rows(" ") + "END\n\n"},
        TextCloud{"cr.xyz", rows(" ", none, "\r")},
        TextCloud{"two_bytes.txt", two_bytes("x y z r g b\r\n" + rows(" ", bytes, "\r\n")), {0, 240, 150}},
        TextCloud{"columns.csv", "x,y,z,col_r,col_g,col_b\n" + rows(",", comma_bytes), {0, 240, 150}},
        TextCloud{"r8.csv", "x,y,z,R8,G8,B8\n" + rows(",", comma_bytes), {0, 240, 150}},
        TextCloud{"packed.txt",
                  "x y z rgb\n" + rows(" ", [](int k) { return fmt::format(" {}", (10 * k << 16) + (255 - k) * 256); }),
                  {0, 240, 150}},
        TextCloud{"open3d.xyzrgb", rows(" ", fractions), {0, 240, 15}, "taken as fractions"}),
    [](const auto& info) {
        std::string name = info.param.name;
        std::ranges::replace(name, '.', '_');
        return name;
    });

TEST(TextCloudsOfScans, begin_with_row_and_column_which_maps_of_whole_metres_do_not) {
    const TemporaryFolder folder;
    std::string scan, map;
    for (int k = 0; k < 40; ++k) {
        scan += fmt::format("{} {} {}.25 {}.5 1.125 {} {} 0\n", k / 8, k % 8, k % 8, k / 8, 5 * k, 255 - k);
        map += fmt::format("{} {} 1.125 {} {} 0\n", k / 8, k % 8, 5 * k, 255 - k);
    }
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(write_file(folder / "scan.xyz", scan), warnings);
    EXPECT_EQ(cloud.points[13], Eigen::Vector3d(5.25, 1.5, 1.125));
    EXPECT_EQ(cloud.colours[13], cv::Vec3b(0, 242, 65));
    EXPECT_TRUE(says(joined(warnings), "count rows and columns of a scan")) << joined(warnings);
    warnings.clear();
    EXPECT_EQ(read_cloud(write_file(folder / "map.xyz", map), warnings).points[13], Eigen::Vector3d(1, 5, 1.125));
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
}

TEST(TextCloudsRefused, poses_and_degrees_are_none) {
    for (const char* names : {"pos_x,pos_y,pos_z,rot_w", "x,y,z,q_w", "lat,lon,alt"}) {
        const TemporaryFolder folder;
        const fs::path file = write_file(folder / "c.csv", std::string(names) + "\n" + rows(",", [&](int) {
                                                               return std::string(names).ends_with('w') ? ",1" : "";
                                                           }));
        EXPECT_FALSE(is_cloud(file_bytes(file), file)) << names;
    }
}

TEST(TextCloudsRefused, name_the_line_and_the_column) {
    const TemporaryFolder folder;
    const auto complaint = [&](const char* name, const std::string& text) {
        const fs::path file = write_file(folder / name, text);
        EXPECT_TRUE(is_cloud(file_bytes(file), file)) << name << ": the list of all formats would hide the cause";
        std::vector<std::string> warnings;
        return refusal([&] { (void)read_cloud(file, warnings); });
    };
    const std::string words = rows(",", [](int) { return ",wall"; });
    EXPECT_TRUE(says(complaint("class.csv", "x,y,z,class\n" + words), "line 2: \"wall\" in column 4 (class)"));
    EXPECT_TRUE(says(complaint("e.xyz", "\xff\xfe"), "a byte order mark and no text"));
    EXPECT_TRUE(says(complaint("c.xyz", rows(" ") + "1 2\n"), "line 17: 2 values, expected 3"));
    EXPECT_TRUE(
        says(complaint("n.xyz", "east west\n" + rows(" ")), "line 1: \"east west\", expected numbers, or names"));
}

std::string ply(const std::string& end, const std::string& properties, const std::string& first = "ply") {
    return first + end + "format binary_little_endian 1.0" + end + "element vertex 2" + end + properties +
           "end_header" + end;
}

TEST(PlyHeaders, end_their_lines_as_they_like) {
    const std::array<float, 6> points{1, 2, 3, 4, 5, 6};
    const std::string body(reinterpret_cast<const char*>(points.data()), sizeof points);
    for (const std::string end : {"\n", "\r\n", "\r", "\n\r", " \n"}) {
        const TemporaryFolder folder;
        std::string properties;
        for (const char* name : {"X", "y ", "z"})
            properties += fmt::format("property float {}{}", name, end);
        const fs::path file = write_file(folder / "c.ply", ply(end, properties) + body);
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(file, warnings);
        EXPECT_TRUE(warnings.empty()) << joined(warnings);
        ASSERT_EQ(cloud.points.size(), 2U);
        EXPECT_EQ(cloud.points[1], Eigen::Vector3d(4, 5, 6));
        write_cloud(folder / "out.ply", cloud, {{"ao", std::array{0.5F, 1.0F}}});
        const Cloud again = read_cloud(folder / "out.ply", warnings);
        EXPECT_EQ(again.points, cloud.points);
        EXPECT_EQ(again.records->fields.size(), 4U);
    }
}

TEST(PlyColours, of_any_width_and_name_are_bytes_and_come_back_as_they_were) {
    struct Colours {
        const char *type, *names;
        double full; ///< what stands for 255
        const char* warning;
    };
    for (const auto& [type, names, full, warning] :
         {Colours{"uchar", "r g b", 255, nullptr}, Colours{"uchar", "Red Green Blue", 255, nullptr},
          Colours{"ushort", "red green blue", 65535, "numbers of 16 bits"},
          Colours{"float", "scalar_red scalar_green scalar_blue", 255, nullptr},
          Colours{"float", "red green blue", 1, "taken as fractions"}, Colours{"float", "r g b", 255, nullptr},
          Colours{"double", "diffuse_red diffuse_green diffuse_blue", 1, "taken as fractions"}}) {
        const TemporaryFolder folder;
        std::string properties = "property float x\nproperty float y\nproperty float z\n";
        std::string names_left = names;
        for (char& c : names_left)
            c = c == ' ' ? '\n' : c;
        std::istringstream words(names_left);
        for (std::string name; words >> name;)
            properties += fmt::format("property {} {}\n", type, name);
        const auto value = [full = full](int byte) { return fmt::format("{}", full * byte / 255); };
        const fs::path file =
            write_file(folder / "c.ply",
                       fmt::format("ply\nformat ascii 1.0\nelement vertex 2\n{}end_header\n"
                                   "1 2 3 {} {} {}\n4 5 6 {} {} {}\n",
                                   properties, value(255), value(51), value(0), value(102), value(0), value(204)));
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(file, warnings);
        EXPECT_TRUE(says(joined(warnings), warning ? warning : "")) << names << joined(warnings);
        EXPECT_EQ(warnings.empty(), warning == nullptr) << names << joined(warnings);
        ASSERT_EQ(cloud.colours.size(), 2U) << names;
        EXPECT_EQ(cloud.colours[0], cv::Vec3b(0, 51, 255)) << names;
        EXPECT_EQ(cloud.colours[1], cv::Vec3b(204, 0, 102)) << names;
        const std::array shaded{cv::Vec3b(0, 51, 255), cv::Vec3b(102, 0, 51)};
        write_cloud(folder / "out.ply", cloud, {}, shaded);
        const Cloud again = read_cloud(folder / "out.ply", warnings);
        EXPECT_EQ(again.colours, std::vector(shaded.begin(), shaded.end())) << names << file_bytes(folder / "out.ply");
    }
}

TEST(PlyColours, of_signed_bytes_are_bytes) {
    const TemporaryFolder folder;
    const fs::path file =
        write_file(folder / "c.ply",
                   "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                   "property char red\nproperty char green\nproperty char blue\nend_header\n1 2 3 -56 100 -1\n");
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    EXPECT_EQ(cloud.colours.at(0), cv::Vec3b(255, 100, 200));
    write_cloud(folder / "out.ply", cloud, {}, cloud.colours);
    EXPECT_EQ(read_cloud(folder / "out.ply", warnings).colours, cloud.colours);
}

/// PCL's own example writes the number of a packed colour, not the float of its bits.
TEST(Pcd, packed_colours_of_text_are_numbers_or_bits) {
    for (const char* rgb : {"4210752", "4.210752e+06", "5.900521e-39"}) {
        const TemporaryFolder folder;
        const fs::path file = write_file(
            folder / "c.pcd", fmt::format("VERSION .7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
                                          "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3 {}\n",
                                          rgb));
        std::vector<std::string> warnings;
        EXPECT_EQ(read_cloud(file, warnings).colours.at(0), cv::Vec3b(64, 64, 64)) << rgb;
    }
}

TEST(PlyColours, that_are_not_used_are_named) {
    const TemporaryFolder folder;
    const fs::path file =
        write_file(folder / "c.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty "
                                     "float y\nproperty float z\nproperty uchar red\nend_header\n1 2 3 4\n");
    std::vector<std::string> warnings;
    EXPECT_TRUE(read_cloud(file, warnings).colours.empty());
    EXPECT_TRUE(says(joined(warnings), "the field \"red\" is not used as a colour"));
}

TEST(Pcd, padding_without_bytes_is_passed_over) {
    const TemporaryFolder folder;
    const fs::path file =
        write_file(folder / "c.pcd", "VERSION .7\nFIELDS x y z _ i _\nSIZE 4 4 4 1 4 1\nTYPE F F F U F U\n"
                                     "COUNT 1 1 1 0 1 0\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n"
                                     "1 2 3 9\n4 5 6 8\n");
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
    ASSERT_EQ(cloud.points.size(), 2U);
    EXPECT_EQ(cloud.points[1], Eigen::Vector3d(4, 5, 6));
    EXPECT_EQ(recorded_field(cloud, "i", file), (std::vector<float>{9, 8}));
}

TEST(Ptx, scans_without_points_are_passed_over) {
    const TemporaryFolder folder;
    const std::string pose = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    const fs::path file = write_file(folder / "c.ptx", "0\n0\n" + pose + "2\n1\n" + pose + "1 2 3 0.5\n4 5 6 0.5\n");
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    ASSERT_EQ(cloud.points.size(), 2U);
    EXPECT_EQ(cloud.points[1], Eigen::Vector3d(4, 5, 6));
    EXPECT_TRUE(says(joined(warnings), "no points: 0 columns of 0 rows")) << joined(warnings);
}

/// Without a header only the numbers tell: x y z r g b as floats, and records of floats and whole numbers.
TEST(BareFloats, of_other_records_are_refused) {
    const TemporaryFolder folder;
    std::string six, mixed, sweep;
    const auto add = [](std::string& to, auto value) {
        to.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    for (int k = 0; k < 400; ++k) {
        const int row = k / 20;
        for (const float value : {0.01F * static_cast<float>(k % 20) - 0.1F, 0.01F * static_cast<float>(row) - 0.1F,
                                  -1.0F, 200.0F, 100.0F, 50.0F})
            add(six, value);
        for (const float value : {0.1F * static_cast<float>(k), 2.0F, -1.0F, 0.5F})
            add(mixed, value), add(sweep, value);
        for (const int value : {k, 3, 7, 0})
            add(mixed, value);
    }
    std::vector<std::string> warnings;
    for (const auto& [name, records] : {std::pair{"six.bin", six}, {"mixed.bin", mixed}}) {
        const fs::path file = write_file(folder / name, records);
        EXPECT_TRUE(says(refusal([&] { (void)read_cloud(file, warnings); }), "does not look like records of x y z"))
            << name;
    }
    EXPECT_EQ(read_cloud(write_file(folder / "sweep.bin", sweep), warnings).points.size(), 400U);
}

/// Values that a scanner may measure, in records of other lengths: every second, third ... one holds other things.
TEST(BareFloats, of_other_lengths_are_refused_and_interleaved_lasers_are_not) {
    const TemporaryFolder folder;
    const auto records = [](const std::function<std::vector<float>(int)>& record) {
        std::string bytes;
        for (int k = 0; k < 2100; ++k)
            for (const float value : record(k))
                bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
        return bytes;
    };
    const auto x = [](int k) { return 5 * std::cos(0.01F * static_cast<float>(k)); };
    const auto y = [](int k) { return 5 * std::sin(0.01F * static_cast<float>(k)); };
    std::vector<std::string> warnings;
    const auto complaint = [&](const std::function<std::vector<float>(int)>& record) {
        return refusal([&] { (void)read_cloud(write_file(folder / "c.bin", records(record)), warnings); });
    };
    EXPECT_TRUE(says(complaint([&](int k) { return std::vector{x(k), y(k), 1.5F, 0.2F, 0.5F, 0.75F}; }),
                     "negative reflectance"));
    EXPECT_TRUE(says(complaint([&](int k) { return std::vector{x(k) + 6, y(k) + 6, 1.5F, 0.2F, 0.5F, 0.75F}; }),
                     "every 3 records hold other values, as records of 24 bytes do"));
    EXPECT_TRUE(
        says(complaint([&](int k) { return std::vector{x(k) + 6, y(k) + 6, 1.5F, 0.2F, 0.5F, 0.75F, 1.0F, 0.0F}; }),
             "every 2 records hold other values, as records of 32 bytes do"));
    EXPECT_EQ(complaint([&](int k) { return std::vector{x(k), y(k), k % 2 == 0 ? -1.0F : 1.0F, 0.5F}; }), "");
    EXPECT_EQ(complaint([&](int k) { return std::vector{x(k), y(k), 1.0F, 0.5F, static_cast<float>(k % 32)}; }), "");
}

} // namespace
} // namespace scanshade
