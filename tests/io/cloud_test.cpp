// Clouds: every encoding read to the same points, and written back bit for bit with one field more.
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "tests/support/files.h"

#include <array>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <numeric>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::file_bytes;
using tests::joined;
using tests::refusal;
using tests::says;
using tests::TemporaryFolder;
using tests::warned;
using tests::write_file;

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
const std::string ao = "ambient_occlusion";

Cloud read(const fs::path& file) {
    std::vector<std::string> warnings;
    Cloud cloud = read_cloud(file, warnings);
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
    return cloud;
}

template <class... Values>
std::string bytes_of(Values... values) {
    std::string bytes;
    (bytes.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
    return bytes;
}

template <class... Values>
std::string swapped_bytes_of(Values... values) {
    std::string bytes;
    const auto add = [&](auto value) {
        std::string one = bytes_of(value);
        std::reverse(one.begin(), one.end());
        bytes += one;
    };
    (add(values), ...);
    return bytes;
}

std::vector<float> ramp(std::size_t count) {
    std::vector<float> values(count);
    std::iota(values.begin(), values.end(), 0.0F);
    for (float& value : values)
        value /= 8;
    if (count > 0)
        values[0] = nan;
    return values;
}

/// Adds `ao`, reads it back, and hands over the new file's bytes.
std::string with_ao(const fs::path& source, const fs::path& target) {
    const Cloud cloud = read(source);
    const auto values = ramp(cloud.points.size());
    write_cloud(target, cloud, {{ao, values}});
    const Cloud back = read(target);
    EXPECT_EQ(back.grid, cloud.grid);
    const auto field = back.records->field_named(ao);
    EXPECT_TRUE(field);
    EXPECT_EQ(*field, cloud.records->fields.size()); // the last one
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double value = value_at(*back.records, back.records->record(i), *field);
        EXPECT_EQ(std::isnan(value), std::isnan(values[i])) << i;
        if (!std::isnan(value)) {
            EXPECT_EQ(static_cast<float>(value), values[i]) << i;
        }
        EXPECT_TRUE(back.points[i] == cloud.points[i] || back.points[i].array().isNaN().all()) << i;
    }
    return file_bytes(target);
}

/// Writing without additions must reproduce the file.
void expect_same_bytes(const fs::path& source) {
    const fs::path copy = source.parent_path() / ("copy" + source.extension().string());
    write_cloud(copy, read(source), {});
    EXPECT_EQ(file_bytes(copy), file_bytes(source)) << source;
}

// --- PCD ---

std::string pcd_header(const std::string& fields, const std::string& sizes, const std::string& types, cv::Size grid,
                       const std::string& data) {
    return fmt::format(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT{}\nWIDTH "
        "{}\nHEIGHT {}\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA {}\n",
        fields, sizes, types,
        [&] {
            std::string ones;
            for (std::size_t i = 0; i < sizes.size(); i += 2)
                ones += " 1";
            return ones;
        }(),
        grid.width, grid.height, grid.area(), data);
}

TEST(pcd, ascii_keeps_every_word_and_gets_one_more) {
    const TemporaryFolder folder;
    // Words that a number's round trip would change: trailing zeros, exponents, capitals, odd blanks, carriage returns.
    const std::string body = "1.50 -0 3e0\tnan\r\n  nan NAN nan 4.2108e+06\r\n\r\n0.10000000149 2 3 7";
    const auto file =
        write_file(folder / "c.pcd", pcd_header("x y z rgb", "4 4 4 4", "F F F F", {3, 1}, "ascii") + body);
    expect_same_bytes(file);
    const std::string added = with_ao(file, folder / "out.pcd");
    EXPECT_TRUE(says(added, "FIELDS x y z rgb ambient_occlusion\nSIZE 4 4 4 4 4\nTYPE F F F F F\nCOUNT 1 1 1 1 1\n"));
    EXPECT_TRUE(
        added.ends_with("1.50 -0 3e0\tnan nan\r\n  nan NAN nan 4.2108e+06 0.125\r\n\r\n0.10000000149 2 3 7 0.25"));
}

TEST(pcd, binary_keeps_doubles_labels_and_nan_patterned_colours) {
    const TemporaryFolder folder;
    // A float colour with alpha 0xff is a NaN whose payload is the colour; a float copy may quieten it.
    const std::string first =
        bytes_of(std::uint16_t(7), 512345.678901234, 5403210.123456789, 252.25, std::uint32_t(0xff812345));
    const std::string second = bytes_of(std::uint16_t(9), 0.1, 0.2, 0.3, std::uint32_t(0x7f800001));
    const auto file = write_file(
        folder / "c.pcd", pcd_header("label x y z rgb", "2 8 8 8 4", "U F F F F", {2, 1}, "binary") + first + second);
    expect_same_bytes(file);
    const Cloud cloud = read(file);
    EXPECT_EQ(cloud.points[0].x(), 512345.678901234); // not a float's
    EXPECT_EQ(cloud.colours[0], cv::Vec3b(0x45, 0x23, 0x81));
    const std::string added = with_ao(file, folder / "out.pcd");
    EXPECT_TRUE(added.ends_with(first + bytes_of(nan) + second + bytes_of(0.125F)));
}

TEST(pcd, compressed_holds_fields_one_after_another) {
    const TemporaryFolder folder;
    // Literal runs only: x of both points, then y, then z, then colour.
    const std::string columns = bytes_of(1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F, 0x00abcdefU, 0xff010203U);
    const std::string packed = "\x1f" + columns;
    ASSERT_EQ(columns.size(), 32);
    const auto file =
        write_file(folder / "c.pcd", pcd_header("x y z rgba", "4 4 4 4", "F F F U", {1, 2}, "binary_compressed") +
                                         bytes_of(std::uint32_t(packed.size()), std::uint32_t(32)) + packed);
    const Cloud cloud = read(file);
    EXPECT_EQ(cloud.points[0], Eigen::Vector3d(1, 3, 5));
    EXPECT_EQ(cloud.points[1], Eigen::Vector3d(2, 4, 6));
    EXPECT_TRUE(cloud.organised());
    EXPECT_EQ(cloud.colours[1], cv::Vec3b(3, 2, 1));
    (void)with_ao(file, folder / "out.pcd");
    const Cloud back = read(folder / "out.pcd");
    EXPECT_EQ(back.records->encoding, CloudRecords::Encoding::compressed);
    for (std::size_t i = 0; i < 2; ++i)
        EXPECT_EQ(back.records->record(i).substr(0, 16), cloud.records->record(i));
}

TEST(pcd, large_compressed_bodies_of_every_texture_survive) {
    const TemporaryFolder folder;
    constexpr int n = 5000;
    std::string rows;
    cv::RNG random(1);
    for (int i = 0; i < n; ++i) // smooth, constant, noise, NaN: LZF's easy and hard cases
        rows += bytes_of(static_cast<float>(i), 1.0F, static_cast<float>(random.uniform(-1.0, 1.0)), nan,
                         static_cast<std::uint32_t>(random.next()));
    const auto binary = write_file(
        folder / "b.pcd", pcd_header("x y z curvature rgba", "4 4 4 4 4", "F F F F U", {n, 1}, "binary") + rows);
    Cloud cloud = read(binary);
    auto records = std::make_shared<CloudRecords>(*cloud.records);
    records->encoding = CloudRecords::Encoding::compressed;
    records->header.replace(records->header.find("binary"), 6, "binary_compressed");
    cloud.records = records;
    write_cloud(folder / "c.pcd", cloud, {});
    EXPECT_EQ(read(folder / "c.pcd").records->points, rows);
    EXPECT_LT(fs::file_size(folder / "c.pcd"), rows.size());
}

TEST(pcd, padding_fields_and_counts_above_one_keep_their_places) {
    const TemporaryFolder folder;
    const std::string record = bytes_of(1.0F) + "abc" + bytes_of(2.0F, 3.0F, 10.0F, 11.0F);
    const auto file = write_file(folder / "c.pcd",
                                 "VERSION .7\nFIELDS x _ y z normal\nSIZE 4 1 4 4 4\nTYPE F U F F F\nCOUNT 1 3 1 1 2\n"
                                 "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary\n" +
                                     record);
    EXPECT_EQ(read(file).points[0], Eigen::Vector3d(1, 2, 3));
    EXPECT_TRUE(with_ao(file, folder / "out.pcd").ends_with(record + bytes_of(nan)));
}

TEST(pcd, counts_above_one_are_compressed_value_by_value) {
    // A compressed body holds a field of all points after the other; a field of two values stays together in it, as PCL
    // writes it. So `normal` of both points lies behind z of both points.
    const TemporaryFolder folder;
    const std::string columns =
        bytes_of(1.0F, 2.0F, 3.0F, 4.0F) + "abcdef" + bytes_of(5.0F, 6.0F, 10.0F, 11.0F, 20.0F, 21.0F);
    std::string packed; // literal runs of 32 bytes at most
    for (std::size_t at = 0; at < columns.size(); at += 32) {
        const std::string run = columns.substr(at, 32);
        packed += static_cast<char>(run.size() - 1) + run;
    }
    const auto file = write_file(folder / "c.pcd",
                                 "VERSION .7\nFIELDS x y _ z normal\nSIZE 4 4 1 4 4\nTYPE F F U F F\nCOUNT 1 1 3 1 2\n"
                                 "WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary_compressed\n" +
                                     bytes_of(std::uint32_t(packed.size()), std::uint32_t(columns.size())) + packed);
    const Cloud cloud = read(file);
    EXPECT_EQ(cloud.points[0], Eigen::Vector3d(1, 3, 5));
    EXPECT_EQ(cloud.points[1], Eigen::Vector3d(2, 4, 6));
    const std::array rows{bytes_of(1.0F, 3.0F) + "abc" + bytes_of(5.0F, 10.0F, 11.0F),
                          bytes_of(2.0F, 4.0F) + "def" + bytes_of(6.0F, 20.0F, 21.0F)};
    for (std::size_t i = 0; i < rows.size(); ++i)
        EXPECT_EQ(cloud.records->record(i), rows[i]);
    expect_same_bytes(file);
    (void)with_ao(file, folder / "out.pcd");
    const Cloud back = read(folder / "out.pcd");
    for (std::size_t i = 0; i < rows.size(); ++i)
        EXPECT_EQ(back.records->record(i).substr(0, rows[i].size()), rows[i]);
}

TEST(pcd, few_compressed_bytes_cannot_ask_for_much_memory) {
    // Three bytes of LZF make 264 at most; these ten are said to be 24 million points.
    const TemporaryFolder folder;
    const std::string packed(10, '\0');
    const auto file =
        write_file(folder / "c.pcd", pcd_header("x y z", "4 4 4", "F F F", {6000, 4000}, "binary_compressed") +
                                         bytes_of(std::uint32_t(packed.size()), 288'000'000U) + packed);
    std::vector<std::string> warnings;
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(file, warnings); }), "10 compressed bytes at byte"));
}

TEST(pcd, a_field_of_that_name_is_replaced_not_doubled) {
    const TemporaryFolder folder;
    for (const char* data : {"ascii", "binary", "binary_compressed"}) {
        const bool text = std::string(data) == "ascii";
        const std::string columns = bytes_of(1.0F, 2.0F, 3.0F);
        const std::string body = text ? "1 2 3\n"
                                 : data == std::string("binary")
                                     ? columns
                                     : bytes_of(std::uint32_t(13), std::uint32_t(12)) + "\x0b" + columns;
        const auto file = write_file(folder / "c.pcd", pcd_header("x y z", "4 4 4", "F F F", {1, 1}, data) + body);
        const std::array first{0.25F}, second{0.75F};
        write_cloud(folder / "once.pcd", read(file), {{ao, first}});
        write_cloud(folder / "twice.pcd", read(folder / "once.pcd"), {{ao, second}});
        const Cloud twice = read(folder / "twice.pcd");
        ASSERT_EQ(twice.records->fields.size(), 4) << data;
        EXPECT_EQ(value_at(*twice.records, twice.records->record(0), 3), 0.75) << data;
        EXPECT_EQ(twice.points[0], Eigen::Vector3d(1, 2, 3)) << data;
    }
}

TEST(pcd, new_colours_keep_alpha_and_are_made_only_on_request) {
    const TemporaryFolder folder;
    const auto file =
        write_file(folder / "c.pcd", pcd_header("x y z rgba", "4 4 4 4", "F F F U", {2, 1}, "binary") +
                                         bytes_of(1.0F, 1.0F, 1.0F, 0x00112233U, 1.0F, 1.0F, 1.0F, 0xff445566U));
    const std::array colours{cv::Vec3b(1, 2, 3), cv::Vec3b(4, 5, 6)};
    write_cloud(folder / "out.pcd", read(file), {}, colours);
    EXPECT_TRUE(file_bytes(folder / "out.pcd")
                    .ends_with(bytes_of(1.0F, 1.0F, 1.0F, 0x00030201U, 1.0F, 1.0F, 1.0F, 0xff060504U)));
}

TEST(clouds, colours_are_added_behind_the_fields_of_a_file_without_any) {
    const TemporaryFolder folder;
    const std::array colours{cv::Vec3b(1, 2, 3), cv::Vec3b(4, 5, 6)};
    const std::array values{0.25F, 0.75F};
    const std::string two = bytes_of(1.0F, 1.0F, 1.0F, 2.0F, 2.0F, 2.0F);
    const std::string ply = "element vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    const std::array files{
        write_file(folder / "a.pcd", pcd_header("x y z", "4 4 4", "F F F", {2, 1}, "ascii") + "1 1 1\n2 2 2\n"),
        write_file(folder / "b.pcd", pcd_header("x y z", "4 4 4", "F F F", {2, 1}, "binary") + two),
        write_file(folder / "a.ply", "ply\nformat ascii 1.0\n" + ply + "1 1 1\n2 2 2\n"),
        write_file(folder / "b.ply", "ply\nformat binary_little_endian 1.0\n" + ply + two),
        write_file(folder / "a.xyz", "1 1 1\n2 2 2\n")};
    for (const fs::path& file : files) {
        const Cloud bare = read(file);
        EXPECT_TRUE(bare.colours.empty());
        ASSERT_TRUE(takes_colours(bare)) << file;
        const fs::path out = folder / ("out-" + file.filename().string());
        write_cloud(out, bare, {{ao, values}}, colours);
        const Cloud coloured = read(out);
        EXPECT_EQ(coloured.points, bare.points) << file;
        ASSERT_EQ(coloured.colours.size(), 2U) << file;
        EXPECT_EQ(coloured.colours[0], colours[0]) << file;
        EXPECT_EQ(coloured.colours[1], colours[1]) << file;
        if (file.extension() == ".xyz") { // columns without names: the seventh may be anything
            EXPECT_TRUE(file_bytes(out).starts_with("1 1 1 3 2 1 0.25")) << file_bytes(out);
            continue;
        }
        EXPECT_EQ(recorded_field(coloured, ao, out), std::vector<float>(values.begin(), values.end())) << file;
    }
}

TEST(pcd, ascii_colours_are_replaced_as_the_words_of_their_type) {
    const TemporaryFolder folder;
    const std::array colours{cv::Vec3b(1, 2, 3)};
    const auto as_integer = write_file(
        folder / "u.pcd", pcd_header("x rgba y z", "4 4 4 4", "F U F F", {1, 1}, "ascii") + "1  4278190080 2 3\n");
    write_cloud(folder / "out.pcd", read(as_integer), {}, colours);
    EXPECT_TRUE(file_bytes(folder / "out.pcd").ends_with(fmt::format("1  {} 2 3\n", 0xff030201U)));
    const auto as_float =
        write_file(folder / "f.pcd", pcd_header("x rgb y z", "4 4 4 4", "F F F F", {1, 1}, "ascii") + "1 0 2 3\n");
    write_cloud(folder / "out.pcd", read(as_float), {}, colours);
    EXPECT_EQ(read(folder / "out.pcd").colours[0], colours[0]);
}

TEST(pcd, left_over_lines_are_warned_about_and_written_back) {
    const TemporaryFolder folder;
    const auto file =
        write_file(folder / "c.pcd", pcd_header("x y z", "4 4 4", "F F F", {1, 1}, "ascii") + "1 1 1\n2 2 2\n3 3 3\n");
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    EXPECT_EQ(cloud.points.size(), 1);
    EXPECT_TRUE(warned(warnings, "2 lines are left over from line 13 on"));
    const std::array value{0.5F};
    write_cloud(folder / "out.pcd", cloud, {{ao, value}});
    EXPECT_TRUE(file_bytes(folder / "out.pcd").ends_with("1 1 1 0.5\n2 2 2\n3 3 3\n"));
}

// --- PLY ---

std::string ply_header(const std::string& format, int vertices, const std::string& properties,
                       const std::string& after = "") {
    return fmt::format("ply\nformat {} 1.0\ncomment made by hand\nobj_info kept too\nelement vertex {}\n{}{}comment "
                       "last\nend_header\n",
                       format, vertices, properties, after);
}

const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
const std::string rgb = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
const std::string faces = "element face 1\nproperty list uchar int vertex_indices\n";

TEST(ply, comments_faces_and_both_byte_orders_survive) {
    const TemporaryFolder folder;
    const std::string little_face = bytes_of(std::uint8_t(3), 0, 1, 0),
                      big_face = swapped_bytes_of(std::uint8_t(3), 0, 1, 0);
    const std::string little = bytes_of(1.0F, 2.0F, 3.0F), big = swapped_bytes_of(1.0F, 2.0F, 3.0F);
    struct Case {
        std::string format, record, face, first_ao, second_ao;
    };
    for (const Case& c : {Case{"binary_little_endian", little, little_face, bytes_of(nan), bytes_of(0.125F)},
                          Case{"binary_big_endian", big, big_face, swapped_bytes_of(nan), swapped_bytes_of(0.125F)},
                          Case{"ascii", "1.0 2 3\n", "3 0 1 0\n", "", ""}}) {
        const auto file =
            write_file(folder / "c.ply", ply_header(c.format, 2, xyz, faces) + c.record + c.record + c.face);
        expect_same_bytes(file);
        EXPECT_EQ(read(file).points[1], Eigen::Vector3d(1, 2, 3)) << c.format;
        const std::string added = with_ao(file, folder / "out.ply");
        EXPECT_TRUE(added.starts_with(ply_header(c.format, 2, xyz + "property float ambient_occlusion\n", faces)))
            << c.format;
        if (c.format == "ascii")
            EXPECT_TRUE(added.ends_with("1.0 2 3 nan\n1.0 2 3 0.125\n3 0 1 0\n"));
        else
            EXPECT_TRUE(added.ends_with(c.record + c.first_ao + c.record + c.second_ao + c.face)) << c.format;
    }
}

TEST(ply, doubles_stay_doubles) {
    const TemporaryFolder folder;
    const std::string properties =
        "property double x\nproperty double y\nproperty double z\nproperty ushort intensity\n";
    const std::string record =
        bytes_of(515396.12345678901, 4918348.9876543210, 2324.000244140625, std::uint16_t(40000));
    const auto file = write_file(folder / "c.ply", ply_header("binary_little_endian", 1, properties) + record);
    expect_same_bytes(file);
    EXPECT_EQ(read(file).points[0].y(), 4918348.9876543210);
    EXPECT_TRUE(with_ao(file, folder / "out.ply").ends_with(record + bytes_of(nan)));
}

TEST(ply, every_type_has_its_value_in_either_byte_order) {
    // Doubles and 16-bit numbers in big-endian bytes, not floats alone: coordinates far from the origin need them.
    const TemporaryFolder folder;
    const std::string properties = "property char a\nproperty uchar b\nproperty short c\nproperty ushort d\n"
                                   "property int e\nproperty uint f\nproperty double x\nproperty double y\n"
                                   "property double z\nproperty float g\n";
    const auto record = [](const auto& bytes) {
        return bytes(std::int8_t(-5), std::uint8_t(200), std::int16_t(-300), std::uint16_t(40000), -70000, 3000000000U,
                     515396.12345678901, 4918348.9876543210, -2324.000244140625, 0.15625F);
    };
    const std::string little = record([](auto... values) { return bytes_of(values...); }),
                      big = record([](auto... values) { return swapped_bytes_of(values...); });
    for (const auto& [format, bytes] : {std::pair("binary_little_endian", little), {"binary_big_endian", big}}) {
        const auto file = write_file(folder / "c.ply", ply_header(format, 1, properties) + bytes);
        expect_same_bytes(file);
        const Cloud cloud = read(file);
        EXPECT_EQ(cloud.points[0], Eigen::Vector3d(515396.12345678901, 4918348.9876543210, -2324.000244140625))
            << format;
        for (const auto& [name, value] : {std::pair("a", -5.0),
                                          {"b", 200},
                                          {"c", -300},
                                          {"d", 40000},
                                          {"e", -70000},
                                          {"f", 3000000000},
                                          {"g", 0.15625}})
            EXPECT_EQ(value_at(*cloud.records, cloud.records->record(0), *cloud.records->field_named(name)), value)
                << format << " " << name;
    }
}

TEST(ply, lists_inside_vertices_are_walked) {
    const TemporaryFolder folder;
    const std::string properties = "property list uchar ushort tags\n" + xyz;
    const std::string first = bytes_of(std::uint8_t(2), std::uint16_t(5), std::uint16_t(6), 1.0F, 2.0F, 3.0F);
    const std::string second = bytes_of(std::uint8_t(0), 4.0F, 5.0F, 6.0F);
    const auto file = write_file(folder / "c.ply", ply_header("binary_little_endian", 2, properties) + first + second);
    expect_same_bytes(file);
    EXPECT_EQ(read(file).points[1], Eigen::Vector3d(4, 5, 6));
    EXPECT_TRUE(with_ao(file, folder / "out.ply").ends_with(first + bytes_of(nan) + second + bytes_of(0.125F)));
    const auto text = write_file(folder / "t.ply", ply_header("ascii", 2, properties) + "2 5 6 1 2 3\n0 4 5 6\n");
    expect_same_bytes(text);
    EXPECT_EQ(read(text).points[0], Eigen::Vector3d(1, 2, 3));
    EXPECT_TRUE(with_ao(text, folder / "out.ply").ends_with("2 5 6 1 2 3 nan\n0 4 5 6 0.125\n"));
}

TEST(ply, normals_of_any_length_are_made_unit_and_missing_ones_tell_nothing) {
    const TemporaryFolder folder;
    const auto normals = [&](const std::string& type, const std::string& second) {
        const std::string fields = fmt::format("property {0} nx\nproperty {0} ny\nproperty {0} nz\n", type);
        return recorded_normals(
            read(write_file(folder / "a.ply", "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty "
                                              "float y\nproperty float z\n" +
                                                  fields + "end_header\n0 0 0 0 0 127\n1 0 0 " + second + "\n")));
    };
    for (const char* type : {"char", "float"}) {
        const auto found = normals(type, "0 -50 0");
        ASSERT_EQ(found.size(), 2u) << type;
        EXPECT_EQ(found[0], Eigen::Vector3d(0, 0, 1));
        EXPECT_EQ(found[1], Eigen::Vector3d(0, -1, 0));
    }
    EXPECT_TRUE(normals("float", "0 0 0").empty());
    EXPECT_TRUE(normals("float", "nan nan nan").empty());
}

TEST(ply, elements_before_the_vertices_are_passed_over) {
    const TemporaryFolder folder;
    const std::string header =
        "ply\r\nformat binary_little_endian 1.0\r\nelement camera 2\r\nproperty int id\r\nelement vertex 1\r\n"
        "property float x\r\nproperty float y\r\nproperty float z\r\nend_header\r\n";
    const std::string body = bytes_of(11, 12, 1.0F, 2.0F, 3.0F);
    const auto file = write_file(folder / "c.ply", header + body);
    expect_same_bytes(file);
    EXPECT_EQ(read(file).points[0], Eigen::Vector3d(1, 2, 3));
    const std::string added = with_ao(file, folder / "out.ply");
    EXPECT_TRUE(says(added, "property float z\r\nproperty float ambient_occlusion\r\nend_header\r\n"));
    EXPECT_TRUE(added.ends_with(body + bytes_of(nan)));
}

TEST(ply, colours_change_only_on_request_and_leave_faces_alone) {
    const TemporaryFolder folder;
    const std::string face = bytes_of(std::uint8_t(3), 0, 0, 0);
    const auto file = write_file(folder / "c.ply", ply_header("binary_little_endian", 1, xyz + rgb, faces) +
                                                       bytes_of(1.0F, 2.0F, 3.0F) + "\x0a\x0b\x0c" + face);
    EXPECT_EQ(read(file).colours[0], cv::Vec3b(12, 11, 10));
    const std::array colours{cv::Vec3b(1, 2, 3)};
    write_cloud(folder / "out.ply", read(file), {}, colours);
    EXPECT_TRUE(file_bytes(folder / "out.ply").ends_with(bytes_of(1.0F, 2.0F, 3.0F) + "\x03\x02\x01" + face));
    const auto text = write_file(folder / "t.ply", ply_header("ascii", 1, xyz + rgb) + "1 2 3 10 11 12\n");
    write_cloud(folder / "out.ply", read(text), {}, colours);
    EXPECT_TRUE(file_bytes(folder / "out.ply").ends_with("1 2 3 3 2 1\n"));
}

TEST(ply, a_grid_in_obj_info_makes_an_organised_cloud) {
    const TemporaryFolder folder;
    const std::string header =
        "ply\nformat ascii 1.0\nobj_info num_cols 3\nobj_info num_rows 2\nelement vertex 6\n" + xyz + "end_header\n";
    const auto file = write_file(folder / "c.ply", header + "0 0 1\n1 0 1\n2 0 1\n0 1 1\n1 1 1\nnan nan nan\n");
    EXPECT_EQ(read(file).grid, cv::Size(3, 2));
    EXPECT_TRUE(read(file).points[5].array().isNaN().all());
}

// --- new clouds ---

TEST(new_ply, comes_back_and_uses_doubles_far_from_the_origin) {
    const TemporaryFolder folder;
    const std::array values{0.5F, nan};
    const std::vector<cv::Vec3b> colours{{1, 2, 3}, {4, 5, 6}};
    for (const double offset : {0.0, 500000.1}) {
        const std::vector<Eigen::Vector3d> points{{offset + 0.1, 2, 3}, {offset, 5, 6}};
        write_new_ply(folder / "n.ply", points, colours, {{ao, values}}, {"two\nlines"});
        const Cloud back = read(folder / "n.ply");
        EXPECT_EQ(back.colours, colours);
        EXPECT_TRUE(back.points[0].isApprox(points[0], offset == 0 ? 1e-7 : 1e-15));
        EXPECT_EQ(back.records->fields[0].type, offset == 0 ? Scalar::float32 : Scalar::float64);
        EXPECT_TRUE(says(back.records->header, "comment two lines\n"));
        EXPECT_EQ(value_at(*back.records, back.records->record(0), *back.records->field_named(ao)), 0.5);
    }
}

TEST(new_fields, must_fit_the_cloud) {
    const TemporaryFolder folder;
    const auto file = write_file(folder / "c.ply", ply_header("ascii", 1, xyz) + "1 2 3\n");
    const std::array two{1.0F, 2.0F};
    const std::array one{1.0F};
    EXPECT_TRUE(says(refusal([&] { write_cloud(folder / "o.ply", read(file), {{ao, two}}); }), "2 values"));
    EXPECT_TRUE(says(refusal([&] {
                         write_cloud(folder / "o.ply", read(file), {{"two words", one}});
                     }),
                     "without blanks"));
}

TEST(clouds, describe_themselves) {
    const TemporaryFolder folder;
    const auto file = write_file(folder / "c.pcd", pcd_header("x y z", "4 4 4", "F F F", {2, 2}, "ascii") +
                                                       "1 1 1\n1 1 1\n1 1 1\n1 1 1\n");
    const Cloud cloud = read(file);
    EXPECT_EQ(describe(*cloud.records), "PCD ascii, 4 points, 2x2 organised, fields x y z");
    EXPECT_EQ(extension(*cloud.records), ".pcd");
}

/// Points are edited in blocks on all cores, some dozens of blocks at a time: more points than these hold.
TEST(ply, a_million_points_keep_their_order) {
    const TemporaryFolder folder;
    constexpr std::size_t count = 1100000;
    const std::string head = "ply\nformat binary_little_endian 1.0\n",
                      rest = "element edge 1\nproperty int to\nend_header\n",
                      vertices = fmt::format("element vertex {}\nproperty float x\nproperty float y\nproperty float "
                                             "z\n",
                                             count);
    std::string plain, wider;
    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i) {
        const auto x = static_cast<float>(i);
        values[i] = x / 3;
        plain += bytes_of(x, x + 1, -x);
        wider += bytes_of(x, x + 1, -x, values[i]);
    }
    write_file(folder / "in.ply", head + vertices + rest + plain + bytes_of(7));
    const Cloud cloud = read(folder / "in.ply");
    ASSERT_EQ(cloud.points.size(), count);
    EXPECT_EQ(cloud.points[count - 1], Eigen::Vector3d(count - 1, count, -1099999));
    write_cloud(folder / "out.ply", cloud, {{ao, values}});
    EXPECT_TRUE(file_bytes(folder / "out.ply") ==
                head + vertices + "property float " + ao + "\n" + rest + wider + bytes_of(7));
}

} // namespace
} // namespace scanshade
