// SPZ, Niantic's packed splats (github.com/nianticlabs/spz): streams of positions, opacities, colours, sigmas,
// rotations and further coefficients, in one gzip or, since version 4, in a frame of Zstandard each.
#include "io/clouds/packed_splats.h"
#include "io/clouds/splats.h"
#include "io/compression/deflate.h"
#include "io/compression/inflate.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <tbb/parallel_for.h>
#include <zstd.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Eigen::Vector3f;

constexpr std::string_view magic = "NGSP", gzip_magic = "\x1f\x8b";
constexpr std::size_t head_bytes = 16, plain_head_bytes = 32, table_row = 16;
enum Stream : std::size_t { positions, opacities, colours, sigmas, rotations, coefficients, streams };

std::uint64_t number_at(std::string_view bytes, std::size_t at, std::size_t length) {
    std::uint64_t value = 0;
    for (std::size_t k = length; k-- > 0;)
        value = value << 8 | static_cast<unsigned char>(bytes[at + k]);
    return value;
}
unsigned char byte_at(std::string_view bytes, std::size_t at) { return static_cast<unsigned char>(bytes[at]); }

/// A file's streams, unpacked.
struct Spz {
    unsigned version = 0, degree = 0, fraction_bits = 0;
    std::uint64_t count = 0;
    std::string body;                              ///< gzip: all unpacked; else the streams one after the other
    std::array<std::size_t, streams + 1> begins{}; ///< of the streams in the body
    std::vector<std::pair<std::size_t, std::size_t>> frames; ///< version 4: where each lies in the file, and its length

    [[nodiscard]] std::array<std::size_t, streams> widths() const {
        constexpr std::array<std::size_t, 5> of_degree{0, 9, 24, 45, 72};
        return {9, 1, 3, 3, version == 2 ? 3U : 4U, of_degree[degree]};
    }
    [[nodiscard]] std::string_view row(Stream stream, std::size_t splat) const {
        const std::size_t width = widths()[stream];
        return std::string_view(body).substr(begins[stream] + splat * width, width);
    }
};

/// What the first bytes say; the sizes follow from it.
Spz header_of(std::string_view head) {
    if (head.size() < head_bytes || !head.starts_with(magic))
        throw Error("no header of SPZ");
    Spz spz;
    spz.version = static_cast<unsigned>(number_at(head, 4, 4));
    spz.count = number_at(head, 8, 4);
    spz.degree = byte_at(head, 12);
    spz.fraction_bits = byte_at(head, 13);
    if (spz.version < 2 || spz.version > 4)
        throw Error(fmt::format("version {} of SPZ, expected 2, 3 or 4", spz.version));
    if (spz.degree > 4)
        throw Error(fmt::format("spherical harmonics of degree {}, expected 0 .. 4", spz.degree));
    return spz;
}

void begin_streams(Spz& spz, std::size_t first) {
    spz.begins[0] = first;
    for (std::size_t k = 0; k < streams; ++k)
        spz.begins[k + 1] = spz.begins[k] + spz.count * spz.widths()[k];
}

/// What comes behind the streams, extensions, is kept.
Spz unpacked_gzip(std::string_view bytes) {
    constexpr std::size_t ratio = 1032; // one byte of deflate becomes at most so many
    return during("gzip", [&] {
        Spz spz = header_of(inflated_start(bytes, Inflate::gzip, head_bytes));
        begin_streams(spz, head_bytes);
        const std::size_t needed = spz.begins.back();
        if (spz.version == 4 || needed > ratio * bytes.size())
            throw Error(fmt::format("{} splats of version {} need {} bytes, which {} packed bytes cannot hold",
                                    spz.count, spz.version, needed, bytes.size()));
        constexpr std::size_t extensions = 1 << 24;
        spz.body = inflated(bytes, Inflate::gzip, needed + extensions);
        if (spz.body.size() < needed)
            throw Error(fmt::format("{} splats need {} bytes, the stream has {}", spz.count, needed, spz.body.size()));
        return spz;
    });
}

/// Version 4: a table of sizes, then frames.
Spz unpacked_frames(std::string_view bytes) {
    Spz spz = header_of(bytes);
    if (spz.version != 4 || bytes.size() < plain_head_bytes)
        throw Error(fmt::format("version {} of SPZ in {} bytes without gzip", spz.version, bytes.size()));
    const std::size_t listed = byte_at(bytes, 15), table = number_at(bytes, 16, 4);
    const std::size_t expected = spz.degree == 0 ? coefficients : streams;
    if (listed != expected)
        throw Error(fmt::format("{} streams, expected {} of degree {}", listed, expected, spz.degree));
    if (table < plain_head_bytes || table > bytes.size() || bytes.size() - table < listed * table_row)
        throw Error(
            fmt::format("the table of streams at byte {} is outside the {} bytes of the file", table, bytes.size()));
    begin_streams(spz, 0);
    std::size_t at = table + listed * table_row;
    for (std::size_t k = 0; k < listed; ++k) {
        const std::uint64_t packed = number_at(bytes, table + k * table_row, 8),
                            plain = number_at(bytes, table + k * table_row + 8, 8);
        if (const std::uint64_t needed = spz.count * spz.widths()[k]; plain != needed)
            throw Error(
                fmt::format("stream {}: {} splats need {} bytes, the stream has {}", k, spz.count, needed, plain));
        if (packed > bytes.size() - at)
            throw Error(
                fmt::format("stream {}: {} packed bytes, {} are left at byte {}", k, packed, bytes.size() - at, at));
        spz.frames.emplace_back(at, packed);
        at += packed;
    }
    if (at != bytes.size())
        throw Error(fmt::format("{} bytes behind the last stream", bytes.size() - at));
    // A block of Zstandard has at most 128 KiB, in 4 bytes at least.
    constexpr std::uint64_t most = 1 << 15;
    if (spz.begins.back() / most > bytes.size())
        throw Error(fmt::format("{} splats need {} bytes, which {} packed bytes cannot hold", spz.count,
                                spz.begins.back(), bytes.size()));
    spz.body.resize(spz.begins.back());
    for (std::size_t k = 0; k < listed; ++k) {
        const std::size_t needed = spz.begins[k + 1] - spz.begins[k];
        const std::size_t found = ZSTD_decompress(spz.body.data() + spz.begins[k], needed,
                                                  bytes.data() + spz.frames[k].first, spz.frames[k].second);
        if (ZSTD_isError(found))
            throw Error(fmt::format("stream {}: damaged Zstandard frame ({})", k, ZSTD_getErrorName(found)));
        if (found != needed)
            throw Error(fmt::format("stream {}: {} bytes, expected {}", k, found, needed));
    }
    return spz;
}

Spz unpacked(std::string_view bytes) {
    return bytes.starts_with(gzip_magic) ? unpacked_gzip(bytes) : unpacked_frames(bytes);
}

/// Version 2: x, y, z in bytes. Later: two bits tell the largest of x y z w, then the others with sign and 9 bits.
Eigen::Quaternionf spz_rotation(std::string_view row) {
    std::array<float, 4> xyzw{};
    float rest = 1;
    std::size_t largest = 3;
    if (row.size() == 3) {
        for (std::size_t k = 0; k < 3; ++k)
            xyzw[k] = static_cast<float>(byte_at(row, k)) / 127.5F - 1;
    } else {
        auto bits = static_cast<std::uint32_t>(number_at(row, 0, 4));
        largest = bits >> 30;
        for (std::size_t k = 4; k-- > 0;)
            if (k != largest) {
                const float size = static_cast<float>(bits & 511) / 511 / std::numbers::sqrt2_v<float>;
                xyzw[k] = (bits & 512) != 0 ? -size : size;
                bits >>= 10;
            }
    }
    for (std::size_t k = 0; k < 4; ++k)
        rest -= k == largest ? 0 : xyzw[k] * xyzw[k];
    xyzw[largest] = std::sqrt(std::max(rest, 0.0F));
    return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
}

constexpr double colour_scale = 0.15; // of f_dc in a byte
double colour_of(unsigned char byte) {
    return 0.5 + colour_of_degree_0 * (static_cast<double>(byte) / 255 - 0.5) / colour_scale;
}

SplatRow row_of(const Spz& spz, std::size_t splat) {
    SplatRow row;
    const std::string_view position = spz.row(positions, splat), colour = spz.row(colours, splat),
                           sigma = spz.row(sigmas, splat);
    for (int k = 0; k < 3; ++k) {
        const auto at = static_cast<std::size_t>(k);
        const auto raw = static_cast<std::int32_t>(number_at(position, 3 * at, 3) << 8) >> 8; // 24 bits with a sign
        row.position[k] = std::ldexp(static_cast<float>(raw), -static_cast<int>(spz.fraction_bits));
        row.colour[k] = static_cast<float>(colour_of(byte_at(colour, at)));
        row.log_sigma[k] = static_cast<float>(byte_at(sigma, at)) / 16 - 10;
    }
    row.opacity = static_cast<float>(byte_at(spz.row(opacities, splat), 0)) / 255;
    row.rotation = spz_rotation(spz.row(rotations, splat));
    return row;
}

void shade(Spz& spz, std::span<const float> visibility, double strength) {
    const std::size_t width = spz.widths()[coefficients];
    tbb::parallel_for(std::size_t(0), static_cast<std::size_t>(spz.count), [&](std::size_t i) {
        const double light = light_of(visibility[i], strength);
        char* const colour = spz.body.data() + spz.begins[colours] + 3 * i;
        char* const rest = spz.body.data() + spz.begins[coefficients] + width * i;
        for (std::size_t channel = 0; channel < 3 && light != 1; ++channel) {
            const double before = colour_of(static_cast<unsigned char>(colour[channel]));
            const double f_dc = (shaded_channel(before, light) - 0.5) / colour_of_degree_0;
            colour[channel] = static_cast<char>(cv::saturate_cast<unsigned char>((f_dc * colour_scale + 0.5) * 255));
            const double factor = shaded_factor(before, light);
            for (std::size_t k = channel; k < width; k += 3) {
                const double value = factor * (static_cast<unsigned char>(rest[k]) - 128);
                rest[k] = static_cast<char>(cv::saturate_cast<unsigned char>(value + 128));
            }
        }
    });
}

std::string frame_of(std::string_view bytes) {
    std::string packed(ZSTD_compressBound(bytes.size()), '\0');
    constexpr int level = 9;
    const std::size_t size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), level);
    if (ZSTD_isError(size))
        throw Error(fmt::format("Zstandard: {}", ZSTD_getErrorName(size)));
    packed.resize(size);
    return packed;
}

/// The file with anew packed colours and coefficients; the other frames keep their bytes.
std::string with_frames(std::string_view file, const Spz& spz) {
    const std::size_t table = number_at(file, 16, 4);
    std::string bytes(file.substr(0, table + spz.frames.size() * table_row));
    for (std::size_t k = 0; k < spz.frames.size(); ++k) {
        const auto [at, length] = spz.frames[k];
        const bool changed = k == colours || k == coefficients;
        const std::string frame =
            changed ? frame_of(std::string_view(spz.body).substr(spz.begins[k], spz.begins[k + 1] - spz.begins[k]))
                    : std::string(file.substr(at, length));
        const std::uint64_t size = frame.size();
        std::memcpy(bytes.data() + table + k * table_row, &size, sizeof size);
        bytes += frame;
    }
    return bytes;
}

} // namespace

bool is_spz(std::string_view start) {
    if (!start.starts_with(gzip_magic))
        return start.starts_with(magic);
    try {
        return inflated_start(start, Inflate::gzip, magic.size()) == magic;
    } catch (const Error&) {
        return false;
    }
}

CloudRecords read_spz(std::string_view bytes, const fs::path& file, std::vector<std::string>&) {
    const Spz spz = during(file.string(), [&] { return unpacked(bytes); });
    SplatTable table(spz.count, file);
    tbb::parallel_for(std::size_t(0), static_cast<std::size_t>(spz.count),
                      [&](std::size_t i) { table.set(i, row_of(spz, i)); });
    return std::move(table).records(std::string(bytes));
}

std::string shaded_spz(const CloudRecords& records, std::span<const float> visibility, double strength) {
    Spz spz = unpacked(records.packed);
    shade(spz, visibility, strength);
    return spz.frames.empty() ? deflated(spz.body, Deflate::gzip) : with_frames(records.packed, spz);
}

} // namespace scanshade
