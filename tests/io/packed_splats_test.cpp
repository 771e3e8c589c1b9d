// Gaussian splats in .splat, packed PLY and SPZ: read as the format says, shaded in place, refused where damaged.
#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"
#include "tests/support/files.h"
#include "tests/support/packed.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::joined;
using tests::refusal;
using tests::says;
using tests::TemporaryFolder;
using tests::write_file;

constexpr double c0 = 0.28209479177387814;

template <class Number>
void put(std::string& bytes, Number value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}
void put_bytes(std::string& bytes, const std::vector<int>& values) {
    for (const int value : values)
        bytes.push_back(static_cast<char>(value));
}

// All files hold two splats: at (1, 2, -3), of colour (0.8, 0.4, 0.2), opacity 1, sigmas 1, e^-1, e^-4, turned by 90
// degrees about x, so that their shortest axis is y; and the same at (1.5, 2, -3), of opacity 0.2.

std::string splat_file() {
    std::string bytes;
    for (const float x : {1.0F, 1.5F}) {
        for (const float value : {x, 2.0F, -3.0F, 1.0F, std::exp(-1.0F), std::exp(-4.0F)})
            put(bytes, value);
        put_bytes(bytes, {204, 102, 51, x == 1 ? 255 : 51, 218, 218, 128, 128});
    }
    return bytes;
}

std::string packed_ply(int chunks = 1, const std::string& more = "") {
    std::string bytes = fmt::format("ply\nformat binary_little_endian 1.0\nelement chunk {}\n", chunks);
    for (const char* kind : {"", "scale_"})
        for (const char* end : {"min_", "max_"})
            for (const char* axis : {"x", "y", "z"})
                bytes += fmt::format("property float {}{}{}\n", end, kind, axis);
    for (const char* end : {"min_", "max_"})
        for (const char* channel : {"r", "g", "b"})
            bytes += fmt::format("property float {}{}\n", end, channel);
    bytes += "element vertex 2\n";
    for (const char* name : {"position", "rotation", "scale", "color"})
        bytes += fmt::format("property uint packed_{}\n", name);
    bytes += "element sh 2\n";
    for (int k = 0; k < 9; ++k)
        bytes += fmt::format("property uchar f_rest_{}\n", k);
    bytes += "end_header\n";
    for (const float limit : {1.0F, 2.0F, -3.0F, 1.5F, 2.0F, -3.0F, -4.0F, -4.0F, -4.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F,
                              0.2F, 1.0F, 1.0F, 0.2F})
        put(bytes, limit);
    for (const std::uint32_t x : {0U, 2047U}) {
        put(bytes, x << 21);
        put(bytes, 0U << 30 | 1023U << 20 | 512U << 10 | 512U); // the largest is w; x = (1 - 0.5) sqrt 2
        put(bytes, 2047U << 21 | 767U << 11 | 0U);              // 0, -4 + 4 * 767 / 1023 = -1, -4
        put(bytes, 204U << 24 | 102U << 16 | 0U << 8 | (x == 0 ? 255U : 51U));
    }
    put_bytes(bytes, {0, 255, 160, 0, 255, 160, 0, 255, 160, 128, 128, 128, 128, 128, 128, 128, 128, 128});
    return bytes + more;
}

/// A Zstandard frame of one block as it is.
std::string stored_frame(const std::string& bytes) {
    std::string frame = "\x28\xb5\x2f\xfd\xa0";
    put(frame, static_cast<std::uint32_t>(bytes.size()));
    const auto block = static_cast<std::uint32_t>(bytes.size() << 3 | 1);
    frame.append(reinterpret_cast<const char*>(&block), 3);
    return frame + bytes;
}

struct SpzParts {
    int version = 3, degree = 1;
    std::uint32_t count = 2;
    int change_table = -1; ///< the stream whose size is told wrong
    std::string more = {};
};

std::string spz(const SpzParts& parts) {
    std::array<std::string, 6> streams;
    for (const int x : {4096, 6144}) {
        put_bytes(streams[0], {x & 255, x >> 8, 0, 0, 8192 >> 8, 0, 0, (65536 - 12288) >> 8, 255});
        put_bytes(streams[1], {x == 4096 ? 255 : 51});
        for (const double colour : {0.8, 0.4, 0.2})
            put_bytes(streams[2], {static_cast<int>(std::lround(255 * (0.5 + 0.15 * (colour - 0.5) / c0)))});
        put_bytes(streams[3], {160, 144, 96});
        if (parts.version == 2)
            put_bytes(streams[4], {218, 128, 128});
        else
            put(streams[4], 3U << 30 | 511U << 20);
        put_bytes(streams[5], {192, 192, 192, 64, 64, 64, 128, 128, 128});
    }
    if (parts.degree == 0)
        streams[5].clear();
    std::string bytes = "NGSP";
    put(bytes, parts.version);
    put(bytes, parts.count);
    put_bytes(bytes, {parts.degree, 12, 0, 0});
    if (parts.version < 4 || parts.version > 8) {
        for (const std::string& stream : streams)
            bytes += stream;
        return tests::packed_by_zlib(bytes + parts.more, 31);
    }
    const std::size_t listed = parts.degree == 0 ? 5 : 6;
    bytes.back() = static_cast<char>(listed);
    put(bytes, 32U);
    bytes.append(12, '\0');
    for (std::size_t k = 0; k < listed; ++k) {
        put(bytes, std::uint64_t(stored_frame(streams[k]).size()));
        put(bytes, std::uint64_t(streams[k].size() + (static_cast<int>(k) == parts.change_table ? 1 : 0)));
    }
    for (std::size_t k = 0; k < listed; ++k)
        bytes += stored_frame(streams[k]);
    return bytes + parts.more;
}

struct Packed {
    const char* name;
    std::string bytes;
    const char* format;
    double turn; ///< by which the axis may err
};
void PrintTo(const Packed& row, std::ostream* to) { *to << row.name; }

class PackedSplats : public testing::TestWithParam<Packed> {};

double linear(double colour) { return colour <= 0.04045 ? colour / 12.92 : std::pow((colour + 0.055) / 1.055, 2.4); }

TEST_P(PackedSplats, are_read_and_shaded) {
    const TemporaryFolder folder;
    const fs::path file = write_file(folder / GetParam().name, GetParam().bytes);
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    EXPECT_TRUE(warnings.empty()) << joined(warnings);
    EXPECT_TRUE(describe(*cloud.records).starts_with(GetParam().format)) << describe(*cloud.records);
    ASSERT_EQ(cloud.points.size(), 2U);
    EXPECT_LT((cloud.points[0] - Eigen::Vector3d(1, 2, -3)).norm(), 1e-6);
    EXPECT_LT((cloud.points[1] - Eigen::Vector3d(1.5, 2, -3)).norm(), 1e-6);
    const auto colour = [](const Cloud& of, std::size_t splat) {
        return Eigen::Vector3d(of.colours[splat][2], of.colours[splat][1], of.colours[splat][0]);
    };
    EXPECT_LT((colour(cloud, 0) - Eigen::Vector3d(204, 102, 51)).cwiseAbs().maxCoeff(), 2.1);
    for (const std::size_t i : {0U, 1U}) {
        const Splat& splat = splats_of(cloud)[i];
        EXPECT_NEAR(splat.opacity, i == 0 ? 1 : 0.2, 1e-5);
        EXPECT_LT((splat.sigma.array().log().matrix() - Eigen::Vector3f(0, -1, -4)).norm(), 0.002);
        const Eigen::Vector3f shortest = splat.rotation * Eigen::Vector3f::UnitZ();
        EXPECT_LT((shortest + Eigen::Vector3f::UnitY()).norm(), GetParam().turn);
    }
    EXPECT_FALSE(takes_fields(cloud));
    const std::vector<float> values{0.5F, std::numeric_limits<float>::quiet_NaN()};
    const fs::path out = folder / ("out" + extension(*cloud.records));
    write_shaded_splats(out, cloud, values, 1);
    const Cloud shaded = read_cloud(out, warnings);
    for (int channel = 0; channel < 3; ++channel)
        EXPECT_NEAR(linear(colour(shaded, 0)[channel] / 255), 0.5 * linear(colour(cloud, 0)[channel] / 255), 0.012);
    EXPECT_LT((colour(shaded, 1) - colour(cloud, 1)).cwiseAbs().maxCoeff(), 1.1) << "unknown: as it was";
    EXPECT_EQ(shaded.points, cloud.points);
    for (const std::size_t i : {0U, 1U}) {
        EXPECT_EQ(splats_of(shaded)[i].opacity, splats_of(cloud)[i].opacity);
        EXPECT_EQ(splats_of(shaded)[i].rotation.coeffs(), splats_of(cloud)[i].rotation.coeffs());
    }
    write_shaded_splats(out, cloud, std::vector<float>(2, 1), 1);
    EXPECT_EQ(read_cloud(out, warnings).records->points, cloud.records->points) << "light that nothing takes";
}

INSTANTIATE_TEST_SUITE_P(Of, PackedSplats,
                         testing::Values(Packed{"c.splat", splat_file(), "splat", 0.02},
                                         Packed{"c.compressed.ply", packed_ply(), "packed PLY", 0.004},
                                         Packed{"v2.spz", spz({.version = 2}), "SPZ", 0.02},
                                         Packed{"v3.spz", spz({.version = 3}), "SPZ", 0.004},
                                         Packed{"v3_extended.spz", spz({.version = 3, .more = "more"}), "SPZ", 0.004},
                                         Packed{"v4.spz", spz({.version = 4}), "SPZ", 0.004},
                                         Packed{"v4_plain.spz", spz({.version = 4, .degree = 0}), "SPZ", 0.004}),
                         [](const auto& row) {
                             std::string name = row.param.name;
                             std::ranges::replace(name, '.', '_');
                             return name;
                         });

TEST(PackedSplats, keep_every_byte_but_colours) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const std::string bytes = splat_file();
    const Cloud cloud = read_cloud(write_file(folder / "c.splat", bytes), warnings);
    write_shaded_splats(folder / "d.splat", cloud, std::vector<float>(2, 0.0F), 1);
    std::string expected = bytes;
    for (const std::size_t at : {24U, 56U})
        expected.replace(at, 3, std::string(3, '\0'));
    EXPECT_EQ(tests::file_bytes(folder / "d.splat"), expected);
    // Of packed PLY: coefficients -4, 4, 1.02 of red become half of linear light's factor, codes near 128 - 32.
    const std::string packed = packed_ply();
    const Cloud ply = read_cloud(write_file(folder / "c.ply", packed), warnings);
    write_shaded_splats(folder / "d.ply", ply, std::vector<float>{0.5F, 1}, 1);
    const std::string shaded = tests::file_bytes(folder / "d.ply");
    ASSERT_EQ(shaded.size(), packed.size());
    const std::size_t rest = packed.size() - 18;
    const double factor = (1.055 * std::pow(0.5 * linear(0.8), 1 / 2.4) - 0.055) / 0.8;
    EXPECT_EQ(static_cast<unsigned char>(shaded[rest]), std::floor((-4 * factor / 8 + 0.5) * 256));
    EXPECT_EQ(static_cast<unsigned char>(shaded[rest + 1]), std::floor((4 * factor / 8 + 0.5) * 256));
    EXPECT_EQ(shaded.substr(rest + 9), packed.substr(rest + 9));
}

struct Damaged {
    const char* name;
    std::string bytes;
    const char* says;
};
void PrintTo(const Damaged& row, std::ostream* to) { *to << row.says; }

class DamagedSplats : public testing::TestWithParam<Damaged> {};

TEST_P(DamagedSplats, are_refused) {
    const TemporaryFolder folder;
    const fs::path file = write_file(folder / GetParam().name, GetParam().bytes);
    std::vector<std::string> warnings;
    const std::string said = refusal([&] { (void)read_cloud(file, warnings); });
    EXPECT_TRUE(says(said, GetParam().says)) << said;
    EXPECT_TRUE(says(said, file.string())) << said;
}

std::string changed(std::string bytes, std::size_t at, const std::string& by) {
    return bytes.replace(at, by.size(), by);
}

INSTANTIATE_TEST_SUITE_P(
    Of, DamagedSplats,
    testing::Values(Damaged{"c.splat", splat_file().substr(5), "59 bytes are no multiple of 32: the file is cut short"},
                    Damaged{"c.splat", "", "empty"},
                    Damaged{"c.splat", changed(splat_file(), 48, std::string("\0\0\x80\xbf", 4)),
                            "a sigma of record 2 (byte 48) is -1"},
                    Damaged{"c.splat", changed(splat_file(), 32, std::string("\0\0\xc0\x7f", 4)),
                            "a position of record 2 (byte 32)"},
                    Damaged{"c.ply", packed_ply(0), "0 chunks, 2 splats need 1"},
                    Damaged{"c.ply", packed_ply().erase(packed_ply().size() - 30), "the header says"},
                    Damaged{"c.ply", packed_ply(1, "more"), "4 bytes after the last element"},
                    Damaged{"c.spz", spz({.version = 9}), "version 9 of SPZ, expected 2, 3 or 4"},
                    Damaged{"c.spz", spz({.degree = 9}), "degree 9, expected 0 .. 4"},
                    Damaged{"c.spz", spz({.count = 0x7fffffff}), "2147483647 splats of version 3 need"},
                    Damaged{"c.spz", spz({.count = 3}), "3 splats need 103 bytes, the stream has 74"},
                    Damaged{"c.spz", spz({}).substr(0, 60), "gzip: the packed data end early"},
                    Damaged{"c.spz", spz({.version = 4, .change_table = 2}),
                            "stream 2: 2 splats need 6 bytes, the stream has 7"},
                    Damaged{"c.spz", spz({.version = 4, .more = "more"}), "4 bytes behind the last stream"},
                    Damaged{"c.spz", spz({.version = 4}).substr(0, 200), "packed bytes"}));

} // namespace
} // namespace scanshade
