// LAS and clouds as text: every version and point format read, and written back with two fields more and nothing less.
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/format.h"
#include "io/clouds/point_classes.h"
#include "tests/support/files.h"

#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace tests;

template <class Number>
void put(std::string& bytes, std::size_t at, Number value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
}
template <class Number>
Number get(const std::string& bytes, std::size_t at) {
    Number value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

std::string vlr(const std::string& user, std::uint16_t id, const std::string& data) {
    std::string bytes(54, '\0');
    user.copy(bytes.data() + 2, 16);
    put(bytes, 18, id);
    put(bytes, 20, static_cast<std::uint16_t>(data.size()));
    return bytes + data;
}

constexpr std::array<std::size_t, 11> base_length{20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};

/// Three points of raw coordinates 100, 200, 300 (+1, +2 each), scale 0.01, offset 1000; a record of our own; `extra`
/// bytes nobody describes; in 1.4 a record behind the points.
std::string las(int minor, int format, std::size_t extra = 0, const std::string& more_vlrs = "",
                unsigned vlr_count = 1) {
    const std::size_t header_size = minor >= 4 ? 375 : minor == 3 ? 235 : 227;
    const std::string vlrs = vlr("ours", 7, "kept") + more_vlrs;
    const std::size_t length = base_length[static_cast<std::size_t>(format)] + extra;
    std::string bytes(header_size, '\0');
    bytes.replace(0, 4, "LASF");
    bytes[24] = 1;
    bytes[25] = static_cast<char>(minor);
    put(bytes, 94, static_cast<std::uint16_t>(header_size));
    put(bytes, 96, static_cast<std::uint32_t>(header_size + vlrs.size()));
    put(bytes, 100, vlr_count);
    bytes[104] = static_cast<char>(format);
    put(bytes, 105, static_cast<std::uint16_t>(length));
    if (format < 6)
        put(bytes, 107, std::uint32_t(3));
    for (std::size_t axis = 0; axis < 3; ++axis) {
        put(bytes, 131 + 8 * axis, 0.01);
        put(bytes, 155 + 8 * axis, 1000.0);
        const double low = 1000 + static_cast<double>(axis + 1);
        put(bytes, 179 + 16 * axis, low + 0.02);
        put(bytes, 187 + 16 * axis, low);
    }
    const std::size_t points_end = header_size + vlrs.size() + 3 * length;
    if (minor >= 4) {
        put(bytes, 235, static_cast<std::uint64_t>(points_end));
        put(bytes, 243, std::uint32_t(1));
        put(bytes, 247, std::uint64_t(3));
    }
    if (minor >= 3)
        put(bytes, 227, static_cast<std::uint64_t>(points_end));
    bytes += vlrs;
    for (int i = 0; i < 3; ++i) {
        std::string record(length, '\0');
        for (std::size_t k = 0; k < length; ++k)
            record[k] = static_cast<char>(17 * k + static_cast<std::size_t>(i));
        record[15] = record[16] = static_cast<char>(i); // class and flags: neither noise nor withheld
        for (std::size_t axis = 0; axis < 3; ++axis)
            put(record, 4 * axis, static_cast<std::int32_t>(100 * (axis + 1)) + i);
        bytes += record;
    }
    return minor >= 4 ? bytes + std::string(60, 'E') : bytes;
}

Cloud read(const fs::path& file) {
    std::vector<std::string> warnings;
    Cloud cloud = read_cloud(file, warnings);
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
    return cloud;
}

TEST(Las, withheld_points_and_noise_are_left_out_and_kept_in_the_file) {
    const TemporaryFolder folder;
    struct Row {
        int format;
        std::size_t at; // of the byte in the first record
        int value;
        bool out;
    };
    for (const auto& [format, at, value, out] :
         {Row{1, 15, 7, true}, Row{1, 15, 2, false}, Row{1, 15, 0x82, true}, Row{1, 15, 0x62, false},
          Row{1, 15, 18, false}, Row{6, 15, 4, true}, Row{6, 15, 3, false}, Row{6, 16, 7, true}, Row{6, 16, 18, true},
          Row{6, 16, 0x82, false}}) {
        SCOPED_TRACE(fmt::format("format {} byte {} is {}", format, at, value));
        std::string bytes = las(4, format);
        bytes[bytes.size() - 60 - 3 * base_length[static_cast<std::size_t>(format)] + at] = static_cast<char>(value);
        std::vector<std::string> warnings;
        const Cloud cloud = read_cloud(write_file(folder / "a.las", bytes), warnings);
        EXPECT_EQ(cloud.points[0].allFinite(), !out);
        EXPECT_TRUE(cloud.points[1].allFinite());
        EXPECT_EQ(warned(warnings, "1 point marked as withheld or as noise"), out) << joined(warnings);
        write_cloud(folder / "same.las", cloud, {});
        EXPECT_EQ(file_bytes(folder / "same.las"), bytes);
    }
}

TEST(Las, classes_and_returns_are_told_without_the_flags_beside_them) {
    const TemporaryFolder folder;
    struct Row {
        int format;
        int flags;      // of the first record, byte 14
        std::size_t at; // of the class
        int value, return_number, code;
        const char* name;
    };
    for (const Row& row : {Row{0, 0x09, 15, 2, 1, 2, "ground"}, Row{1, 0xd3, 15, 0x65, 3, 5, "high vegetation"},
                           Row{3, 0x3f, 15, 0x20, 7, 0, "never classified"}, Row{5, 0x02, 15, 31, 2, 31, "reserved"},
                           Row{6, 0xf3, 16, 17, 3, 17, "bridge deck"}, Row{7, 0x1f, 16, 64, 15, 64, "user-defined"},
                           Row{10, 0x21, 16, 255, 1, 255, "user-defined"}}) {
        SCOPED_TRACE(fmt::format("format {}", row.format));
        std::string bytes = las(4, row.format);
        const std::size_t first = bytes.size() - 60 - 3 * base_length[static_cast<std::size_t>(row.format)];
        bytes[first + 14] = static_cast<char>(row.flags);
        bytes[first + row.at] = static_cast<char>(row.value);
        std::vector<std::string> warnings;
        const fs::path file = write_file(folder / "a.las", bytes);
        const Cloud cloud = read_cloud(file, warnings);
        ASSERT_EQ(classes_of(cloud, file).size(), 3U);
        EXPECT_EQ(classes_of(cloud, file)[0], row.code);
        EXPECT_EQ(returns_of(cloud, file)[0], row.return_number);
        EXPECT_EQ(class_name(static_cast<std::uint8_t>(row.code)), row.name);
    }
    const fs::path text = write_file(folder / "a.xyz", "1 2 3\n4 5 6\n");
    EXPECT_TRUE(classes_of(read(text), text).empty());
    EXPECT_TRUE(returns_of(read(text), text).empty());
}

const std::array visibility{0.25F, 0.5F, std::numeric_limits<float>::quiet_NaN()}, confidence{1.0F, 0.75F, 0.0F};

double value(const Cloud& cloud, std::size_t point, const std::string& field) {
    const auto found = cloud.records->field_named(field);
    EXPECT_TRUE(found) << field;
    return found ? value_at(*cloud.records, cloud.records->record(point), *found) : 0;
}

TEST(Las, every_version_and_point_format_gains_fields_and_loses_nothing) {
    const TemporaryFolder folder;
    for (int minor = 0; minor <= 4; ++minor)
        for (int format = 0; format <= (minor == 4 ? 10 : 5); ++format)
            for (const std::size_t extra : {0u, 5u}) {
                SCOPED_TRACE(fmt::format("1.{} format {} extra {}", minor, format, extra));
                const std::string before = las(minor, format, extra);
                const Cloud cloud = read(write_file(folder / "a.las", before));
                ASSERT_EQ(cloud.points.size(), 3u);
                EXPECT_NEAR((cloud.points[2] - Eigen::Vector3d(1001.02, 1002.02, 1003.02)).norm(), 0, 1e-9);
                write_cloud(folder / "same.las", cloud, {});
                EXPECT_EQ(file_bytes(folder / "same.las"), before);

                write_cloud(folder / "b.las", cloud,
                            {{"ambient_occlusion", visibility}, {"ao_confidence", confidence}});
                const std::string after = file_bytes(folder / "b.las");
                const Cloud back = read(folder / "b.las");
                EXPECT_EQ(value(back, 1, "ambient_occlusion"), 0.5);
                EXPECT_TRUE(std::isnan(value(back, 2, "ambient_occlusion")));
                EXPECT_EQ(value(back, 1, "ao_confidence"), 0.75);
                for (std::size_t i = 0; i < 3; ++i) {
                    EXPECT_EQ(back.points[i], cloud.points[i]);
                    EXPECT_EQ(back.records->record(i).substr(0, cloud.records->stride), cloud.records->record(i));
                }
                EXPECT_NE(after.find("kept"), std::string::npos);
                if (minor == 4) {
                    EXPECT_EQ(after.substr(get<std::uint64_t>(after, 235)), std::string(60, 'E'));
                }
                if (minor >= 3) {
                    EXPECT_EQ(get<std::uint64_t>(after, 227), after.size() - (minor == 4 ? 60 : 0));
                }
                // Everything else of the header is as it was.
                std::string header = after.substr(0, 227);
                for (const auto& [at, length] : {std::pair(96, 4), {100, 4}, {105, 2}})
                    header.replace(static_cast<std::size_t>(at), static_cast<std::size_t>(length), before,
                                   static_cast<std::size_t>(at), static_cast<std::size_t>(length));
                EXPECT_EQ(header, before.substr(0, 227));

                const std::array second{0.1F, 0.2F, 0.3F};
                write_cloud(folder / "c.las", back, {{"ambient_occlusion", second}});
                EXPECT_EQ(file_bytes(folder / "c.las").size(), after.size()); // replaced, not doubled
                EXPECT_FLOAT_EQ(static_cast<float>(value(read(folder / "c.las"), 0, "ambient_occlusion")), 0.1F);
            }
}

TEST(Las, described_extra_bytes_keep_their_names) {
    const TemporaryFolder folder;
    std::string descriptor(192, '\0');
    descriptor[2] = 3; // unsigned short
    std::string_view("pulse width").copy(descriptor.data() + 4, 32);
    const Cloud cloud = read(write_file(folder / "a.las", las(2, 3, 2, vlr("LASF_Spec", 4, descriptor), 2)));
    EXPECT_EQ(cloud.records->fields.back().name, "pulse width");
    write_cloud(folder / "b.las", cloud, {{"ambient_occlusion", visibility}});
    const Cloud back = read(folder / "b.las");
    EXPECT_EQ(value(back, 1, "pulse width"), value(cloud, 1, "pulse width"));
    EXPECT_EQ(value(back, 0, "ambient_occlusion"), 0.25);
    EXPECT_EQ(get<std::uint32_t>(file_bytes(folder / "b.las"), 100), 2u); // one record describes both
}

TEST(Las, descriptions_of_every_type_take_the_bytes_of_their_type) {
    // Types 1 .. 10 are scalars, 11 .. 20 two of them each, 21 .. 30 three (LAS 1.4 R13, table 24). The field behind
    // such a one is found only if its bytes are counted right, and its own first value must be the record's.
    const TemporaryFolder folder;
    constexpr std::array<std::size_t, 10> sizes{1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    for (std::size_t type = 1; type <= 30; ++type) {
        SCOPED_TRACE(type);
        std::string first(192, '\0'), last(192, '\0');
        first[2] = static_cast<char>(type);
        std::string_view("first").copy(first.data() + 4, 32);
        last[2] = 5; // 32 bits without a sign
        std::string_view("last").copy(last.data() + 4, 32);
        const std::size_t size = sizes[(type - 1) % 10], values = (type + 9) / 10;
        const Cloud cloud =
            read(write_file(folder / "a.las", las(2, 0, size * values + 4, vlr("LASF_Spec", 4, first + last), 2)));
        const auto found = cloud.records->field_named("first");
        ASSERT_TRUE(found && *found + 2 == cloud.records->fields.size()) << "two fields and nothing undocumented";
        EXPECT_EQ(cloud.records->fields[*found].count, values);
        EXPECT_EQ(cloud.records->fields[*found].bytes(), size * values);
        for (std::size_t point = 0; point < 3; ++point) {
            const std::string record(cloud.records->record(point));
            EXPECT_EQ(value(cloud, point, "last"), get<std::uint32_t>(record, 20 + size * values));
            const auto scalar = [&]() -> double {
                switch ((type - 1) % 10 + 1) {
                case 1:
                    return get<std::uint8_t>(record, 20);
                case 2:
                    return get<std::int8_t>(record, 20);
                case 3:
                    return get<std::uint16_t>(record, 20);
                case 4:
                    return get<std::int16_t>(record, 20);
                case 5:
                    return get<std::uint32_t>(record, 20);
                case 6:
                    return get<std::int32_t>(record, 20);
                case 7:
                    return static_cast<double>(get<std::uint64_t>(record, 20));
                case 8:
                    return static_cast<double>(get<std::int64_t>(record, 20));
                case 9:
                    return static_cast<double>(get<float>(record, 20));
                default:
                    return get<double>(record, 20);
                }
            }();
            EXPECT_EQ(value(cloud, point, "first"), scalar);
        }
    }
}

TEST(Las, invalid_descriptions_do_not_hide_our_fields) {
    // A description of no bytes, and one of more than a record holds: what comes behind them is not understood.
    const TemporaryFolder folder;
    std::string nothing(192, '\0'), sound(192, '\0'), too_long(192, '\0');
    sound[2] = 9;
    std::string("height").copy(sound.data() + 4, 6);
    too_long[2] = 10;
    for (const std::string& descriptions : {nothing, nothing + sound, sound + too_long, too_long})
        for (const std::size_t extra : {4u, 300u}) {
            SCOPED_TRACE(fmt::format("{} descriptions, {} bytes", descriptions.size() / 192, extra));
            const Cloud cloud =
                read(write_file(folder / "a.las", las(2, 0, extra, vlr("LASF_Spec", 4, descriptions), 2)));
            EXPECT_EQ(cloud.records->field_named("height").has_value(), descriptions.starts_with(sound));
            write_cloud(folder / "b.las", cloud, {{"ambient_occlusion", visibility}, {"ao_confidence", confidence}});
            const Cloud again = read(folder / "b.las");
            for (std::size_t point = 0; point < 3; ++point) {
                EXPECT_EQ(value(again, point, "ao_confidence"), confidence[point]);
                EXPECT_EQ(again.records->record(point).substr(0, 20 + extra), cloud.records->record(point));
            }
            EXPECT_EQ(value(again, 1, "ambient_occlusion"), 0.5);
        }
}

TEST(Las, units_are_stated_not_guessed) {
    const TemporaryFolder folder;
    const auto unit = [&](const std::string& more) {
        std::vector<std::string> warnings;
        return unit_of(
            *read_cloud(write_file(folder / "a.las", las(2, 1, 0, more, more.empty() ? 1 : 2)), warnings).records);
    };
    const auto keys = [](std::uint16_t key, std::uint16_t code) {
        std::string data(16, '\0');
        put(data, 8, key);
        put(data, 14, code);
        return vlr("LASF_Projection", 34735, data);
    };
    EXPECT_TRUE(says(unit(""), "unknown"));
    EXPECT_TRUE(says(unit(keys(3076, 9003)), "US survey feet"));
    EXPECT_TRUE(says(unit(keys(3076, 9001)), "metres"));
    EXPECT_TRUE(says(unit(keys(1024, 2)), "degrees"));
    EXPECT_TRUE(
        says(unit(vlr("LASF_Projection", 2112, "PROJCS[\"x\",GEOGCS[UNIT[\"degree\",0.01]],UNIT[\"foot\",0.3048]]")),
             "foot"));
}

TEST(Las, colours_of_eight_and_sixteen_bits_are_distinguished) {
    const TemporaryFolder folder;
    std::string bytes = las(2, 2);
    const std::size_t points = get<std::uint32_t>(bytes, 96);
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t channel = 0; channel < 3; ++channel)
            put(bytes, points + 26 * i + 20 + 2 * channel, static_cast<std::uint16_t>(10 * (channel + 1)));
    EXPECT_EQ(read(write_file(folder / "a.las", bytes)).colours[0], cv::Vec3b(30, 20, 10));
    for (std::size_t channel = 0; channel < 3; ++channel)
        put(bytes, points + 20 + 2 * channel, static_cast<std::uint16_t>(0x4000 * (channel + 1)));
    const Cloud wide = read(write_file(folder / "b.las", bytes));
    EXPECT_EQ(wide.colours[0], cv::Vec3b(0xc0, 0x80, 0x40));
    const std::array colours{cv::Vec3b(255, 0, 1), cv::Vec3b(), cv::Vec3b()};
    write_cloud(folder / "c.las", wide, {}, colours);
    EXPECT_EQ(read(folder / "c.las").colours[0], colours[0]);
}

TEST(Las, what_is_packed_or_another_format_is_refused_with_help) {
    const TemporaryFolder folder;
    const auto refused = [&](const std::string& name, const std::string& bytes) {
        std::vector<std::string> warnings;
        return refusal([&] { (void)read_cloud(write_file(folder / name, bytes), warnings); });
    };
    std::string five = las(2, 3);
    five[25] = 5;
    EXPECT_TRUE(says(refused("a.las", five), "LAS version 1.5"));
    for (std::size_t length = 0; length < las(4, 7).size() - 60; ++length)
        EXPECT_NE(refused("a.las", las(4, 7).substr(0, length)), "") << length;
}

TEST(TextClouds, keep_every_word_and_get_two_more) {
    const TemporaryFolder folder;
    const auto with_ao = [&](const std::string& name, const std::string& text) {
        const Cloud cloud = read(write_file(folder / name, text));
        EXPECT_EQ(cloud.points[1], Eigen::Vector3d(4, 5, 6)) << name;
        const std::array values{0.25F, 0.5F};
        write_cloud(folder / ("out-" + name), cloud, {{"ambient_occlusion", values}});
        return file_bytes(folder / ("out-" + name));
    };
    EXPECT_EQ(with_ao("a.xyz", "1.00 2 3\n4 5 6e0\n"), "1.00 2 3 0.25\n4 5 6e0 0.5\n");
    EXPECT_EQ(with_ao("b.xyz", "//X Y Z R G B\n1 2 3 9 8 7\n4 5 6 9 8 7"),
              "//X Y Z R G B ambient_occlusion\n1 2 3 9 8 7 0.25\n4 5 6 9 8 7 0.5");
    EXPECT_EQ(with_ao("c.pts", "2\r\n1 2 3 -5 1 2 3\r\n4 5 6 7 1 2 3\r\n"),
              "2\r\n1 2 3 -5 1 2 3 0.25\r\n4 5 6 7 1 2 3 0.5\r\n");
    EXPECT_EQ(read(folder / "c.pts").colours[0], cv::Vec3b(3, 2, 1));
    std::vector<std::string> warnings;
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(write_file(folder / "d.xyz", "1 2 3\n1 2\n"), warnings); }),
                     "line 2: 2 values, expected 3"));
    EXPECT_TRUE(
        says(refusal([&] { (void)read_cloud(write_file(folder / "e.xyz", "1 2 3\n1 2 x\n"), warnings); }), "line 2"));
    (void)read_cloud(write_file(folder / "f.pts", "5\n1 2 3\n"), warnings);
    EXPECT_TRUE(warned(warnings, "says 5 points, holds 1"));
}

/// As CloudCompare, Open3D, S3DIS and Semantic3D write them, none with names of columns.
TEST(TextClouds, columns_are_told_by_their_values) {
    const TemporaryFolder folder;
    const auto names = [&](const std::string& lines) {
        std::string text;
        const Cloud cloud = read(write_file(folder / "c.xyz", lines));
        for (const CloudField& field : cloud.records->fields)
            text += (text.empty() ? "" : " ") + field.name;
        return text;
    };
    EXPECT_EQ(names("1 2 3 200 100 0\n4 5 6 1 0 0\n"), "x y z red green blue");
    EXPECT_EQ(names("1 2 3 0 0 1\n4 5 6 0.6 -0.8 0\n"), "x y z nx ny nz");
    EXPECT_EQ(names("1 2 3 0 0 1\n4 5 6 1 0 0\n"), "x y z nx ny nz") << "no colour is as dark as that everywhere";
    EXPECT_EQ(names("1 2 3 0.2 0.1 1.9\n4 5 6 0 0 0\n"), "x y z column_4 column_5 column_6");
    EXPECT_EQ(names("1 2 3 -1270 40 50 60\n4 5 6 -900 1 2 3\n"), "x y z intensity red green blue");
    EXPECT_EQ(names("1 2 3 40 50 60 0.25\n4 5 6 1 2 3 0.5\n"), "x y z red green blue column_7") << "an AO of ours, say";
    EXPECT_EQ(names("1 2 3 40 50 60 0 0 1\n4 5 6 1 2 3 0 1 0\n"), "x y z red green blue nx ny nz");
    EXPECT_EQ(names("1 2 3 9\n4 5 6 8\n"), "x y z intensity");
    EXPECT_EQ(names("1 2 3 9 9 9 9 9\n"), "x y z column_4 column_5 column_6 column_7 column_8");
}

TEST(TextClouds, of_any_name_are_told_by_their_lines) {
    const TemporaryFolder folder;
    const auto is_read = [&](const std::string& name, const std::string& line, int lines) {
        std::string text;
        for (int i = 0; i < lines; ++i)
            text += line + "\n";
        const auto file = write_file(folder / name, text);
        return is_cloud(text.substr(0, 4096), file);
    };
    EXPECT_TRUE(is_read("office_1.txt", "-15.6 39.2 2.05 43 47 48", 400)) << "S3DIS";
    EXPECT_TRUE(is_read("domfountain.txt", "-15.6 39.2 2.05 -1270 43 47 48", 9)) << "Semantic3D";
    EXPECT_TRUE(is_read("points", "1 2 3", 8));
    EXPECT_TRUE(is_read("normals.asc", "1 2 3 0.6 0 0.8", 8));
    EXPECT_TRUE(is_read("scan.csv", "1.5,2,3,200,100,0", 8));
    EXPECT_FALSE(is_read("imu.csv", "1305031098.6659,0.1,0.2,9.8", 50));
    EXPECT_FALSE(is_read("intrinsics.txt", "525 0 319.5", 3)) << "a matrix";
    EXPECT_FALSE(is_read("pose.txt", "1 0 0 0", 4));
    EXPECT_FALSE(is_read("groundtruth.txt", "1305031098.6659 1.35 0.63 1.63 0.66 0.61 -0.29 -0.32", 50))
        << "TUM's poses";
    EXPECT_FALSE(is_read("00.txt", "1 0 0 0 0 1 0 0 0 0 1 0", 50)) << "KITTI's poses";
    EXPECT_FALSE(is_read("accelerometer.txt", "1305031098.6659 0.1 0.2 9.8", 50));
    EXPECT_FALSE(is_read("depth.txt", "1305031098.6659 depth/1305031098.6659.png", 50));
    EXPECT_FALSE(is_read("read.txt", "Read me first.", 50));
}

/// CloudCompare, VeloView, and a spreadsheet of a country with decimal commas.
TEST(TextClouds, csv_has_cells_in_place_of_words) {
    const TemporaryFolder folder;
    const auto lines = [](const std::string& head, const std::string& line) {
        std::string text = head;
        for (int i = 0; i < 8; ++i)
            text += line;
        return text;
    };
    const std::string compared = lines("//X,Y,Z,R,G,B\n", "1.5,-2,3,200,100,7\n");
    const std::string velodyne =
        lines("\"Points_m_XYZ:0\",\"Points_m_XYZ:1\",\"Points_m_XYZ:2\",\"laser id\"\r\n", "1.5,-2,3,7\r\n");
    const std::string german = lines("x;y;z;Intensity\n", "1,5;-2,0;3;7\n");
    const std::string pandas = lines(",x,y,z\n", "17,1.5,-2,3\n");
    const std::string closed = lines("", "1.5,-2,3,\n");
    for (const std::string& text :
         {compared, velodyne, german, pandas, closed, lines("", "1.5, -2, 3, 200, 100, 7\n")}) {
        const auto file = write_file(folder / "a.csv", text);
        ASSERT_TRUE(is_cloud(text.substr(0, 4096), file)) << text;
        const Cloud cloud = read(file);
        ASSERT_EQ(cloud.points.size(), 8U);
        EXPECT_EQ(cloud.points[7], Eigen::Vector3d(1.5, -2, 3));
    }
    const Cloud coloured = read(write_file(folder / "a.csv", compared));
    EXPECT_EQ(coloured.colours.at(7), cv::Vec3b(7, 100, 200));
    const std::vector<float> ao(8, 0.5F);
    write_cloud(folder / "b.xyz", coloured, {{"ambient_occlusion", ao}});
    EXPECT_TRUE(file_bytes(folder / "b.xyz").starts_with("//X Y Z R G B ambient_occlusion\n1.5 -2 3 200 100 7 0.5\n"));
    const std::string poses = lines("time,x,y,z,qx,qy,qz,qw\n", "1,2,3,4,0,0,0,1\n");
    EXPECT_FALSE(is_cloud(poses, write_file(folder / "poses.csv", poses)));
    std::vector<std::string> warnings;
    const std::string gap = compared + "1.5,,3,200,100,7\n";
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(write_file(folder / "gap.csv", gap), warnings); }), "line 10"));
}

TEST(TextClouds, ptx_is_a_grid_placed_by_its_matrix) {
    const TemporaryFolder folder;
    const std::string head = "2\n2\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n";
    const std::string body = "1 0 0 0.5\n0 0 0 0.5\n0 1 0 0.5\n0 0 1 0.5\n";
    const Cloud cloud = read(write_file(folder / "a.ptx", head + body));
    EXPECT_EQ(cloud.grid, cv::Size(2, 2));
    EXPECT_EQ(cloud.points[0], Eigen::Vector3d(10, 21, 30)); // row vector times matrix: x turns to y
    EXPECT_TRUE(cloud.points[1].array().isNaN().all());
    EXPECT_EQ(cloud.records->viewpoint->translation(), Eigen::Vector3d(10, 20, 30));
    EXPECT_TRUE(cloud.records->stations.empty()) << "one scan has a viewpoint";
    const std::array values{0.5F, 0.5F, 0.5F, 0.25F};
    write_cloud(folder / "b.ptx", cloud, {{"ambient_occlusion", values}});
    EXPECT_EQ(file_bytes(folder / "b.ptx"), head + "1 0 0 0.5 0.5\n0 0 0 0.5 0.5\n0 1 0 0.5 0.5\n0 0 1 0.5 0.25\n");
    const std::vector<float> twice{1, 2, 3, 4};
    write_cloud(folder / "b.ptx", cloud, {{"ambient_occlusion", values}, {"ao_confidence", twice}});
    const Cloud again = read(folder / "b.ptx");
    EXPECT_EQ(again.points[0], cloud.points[0]);
    EXPECT_TRUE(again.colours.empty()) << "six columns, but no colours";
    std::vector<std::string> warnings;
    EXPECT_TRUE(says(refusal([&] { (void)read_cloud(write_file(folder / "d.ptx", head + "1 0 0 1\n"), warnings); }),
                     "4 points, the file holds 1"));
    // Two columns of three rows each, column by column: neighbours in the file are above each other.
    const Cloud oblong = read(write_file(folder / "e.ptx", "2\n3" + head.substr(3) + body + "0 0 2 0.5\n0 0 3 0.5\n"));
    EXPECT_EQ(oblong.grid, cv::Size(3, 2));
    // Any blank may follow the last word. A vertical tab was once taken for the begin of another scan on the same line.
    const Cloud blanks_at_end = read(write_file(folder / "f.ptx", head + body.substr(0, body.size() - 1) + "\v\n\f\n"));
    EXPECT_EQ(blanks_at_end.points.size(), 4U);
    EXPECT_EQ(blanks_at_end.grid, cv::Size(2, 2));
}

TEST(TextClouds, scans_of_a_ptx_file_are_one_cloud_and_come_back_line_by_line) {
    const TemporaryFolder folder;
    const std::string
        first = "2\r\n1\r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n0 0 1\r\n1 0 0 0\r\n0 1 0 0\r\n0 0 1 0\r\n10 20 30 1\r\n",
        second = "1\n3\n5 6 7\n1 0 0\n0 1 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n5 6 7 1\n";
    const std::string all = first + "1 0 0 0.5\r\n0 0 0 0.5\r\n" + second +
                            "1 2 3 0.25\n\n0 0 0 0.5\n 4 5 6 0.75\n \n" + second + "1 0 0 1\n2 0 0 1\n3 0 0 1";
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(write_file(folder / "a.ptx", all), warnings);
    EXPECT_TRUE(warned(warnings, "3 scans are read as one cloud"));
    ASSERT_EQ(cloud.points.size(), 8U);
    EXPECT_FALSE(cloud.organised());
    EXPECT_EQ(cloud.points[0], Eigen::Vector3d(11, 20, 30));
    EXPECT_TRUE(cloud.points[1].array().isNaN().all());
    EXPECT_EQ(cloud.points[2], Eigen::Vector3d(5 - 2, 6 + 1, 7 + 3));
    EXPECT_EQ(cloud.points[7], Eigen::Vector3d(5, 9, 7));
    EXPECT_FALSE(cloud.records->viewpoint) << "each scan has its own";
    ASSERT_EQ(cloud.records->stations.size(), 3U);
    for (const auto& [scan, begin, position] : {std::tuple(0, 0U, Eigen::Vector3d(10, 20, 30)),
                                                {1, 2U, Eigen::Vector3d(5, 6, 7)},
                                                {2, 5U, Eigen::Vector3d(5, 6, 7)}}) {
        const Station& station = cloud.records->stations[static_cast<std::size_t>(scan)];
        EXPECT_EQ(station.first, begin) << scan;
        EXPECT_EQ(station.position, position) << scan;
    }
    const std::vector<float> values{1, 2, 3, 4, 5, 6, 7, 8};
    write_cloud(folder / "b.ptx", cloud, {});
    EXPECT_EQ(file_bytes(folder / "b.ptx"), all);
    write_cloud(folder / "b.ptx", cloud, {{"ambient_occlusion", values}});
    EXPECT_EQ(file_bytes(folder / "b.ptx"), first + "1 0 0 0.5 1\r\n0 0 0 0.5 2\r\n" + second +
                                                "1 2 3 0.25 3\n\n0 0 0 0.5 4\n 4 5 6 0.75 5\n \n" + second +
                                                "1 0 0 1 6\n2 0 0 1 7\n3 0 0 1 8");
    EXPECT_EQ(read_cloud(folder / "b.ptx", warnings).points[7], cloud.points[7]);
    const auto said = [&](const std::string& bytes) {
        return refusal([&] { (void)read_cloud(write_file(folder / "c.ptx", bytes), warnings); });
    };
    const std::string one = first + "1 0 0 0.5\n0 0 0 0.5\n";
    EXPECT_TRUE(says(said(one + "1 0 0 0.5\n" + second), "line 13: expected the number of columns"));
    EXPECT_TRUE(says(said(one + "1\n3\n5 6 7\n"), "ends at line 15, expected a header of 10 lines"));
    EXPECT_TRUE(says(said(one + second + "1 2 3 4\n"), "scan 2: 1 columns of 3 rows are 3 points, the file holds 1"));
    EXPECT_TRUE(says(said(one + "\n\n" + second + "1 2 3\n"), "line 25: 3 values, expected 4"));
    EXPECT_TRUE(says(said(one + second.substr(0, 4) + "x" + second.substr(5) + "1 2 3 4\n"), "line 15"));
}

TEST(Kitti, sweeps_become_ply) {
    const TemporaryFolder folder;
    const std::array<float, 8> floats{1, 2, 3, 0.5F, 4, 5, 6, 0.25F};
    const std::string bytes(reinterpret_cast<const char*>(floats.data()), sizeof floats);
    const Cloud cloud = read(write_file(folder / "a.bin", bytes));
    EXPECT_EQ(cloud.points[1], Eigen::Vector3d(4, 5, 6));
    EXPECT_EQ(extension(*cloud.records), ".ply");
    const std::array values{0.5F, 0.25F};
    write_cloud(folder / "a.ply", cloud, {{"ambient_occlusion", values}});
    const Cloud back = read(folder / "a.ply");
    EXPECT_EQ(value(back, 1, "reflectance"), 0.25);
    EXPECT_EQ(value(back, 1, "ambient_occlusion"), 0.25);
    std::vector<std::string> warnings;
    EXPECT_TRUE(
        says(refusal([&] { (void)read_cloud(write_file(folder / "b.bin", bytes + "x"), warnings); }), "33 bytes"));
}

} // namespace
} // namespace scanshade
