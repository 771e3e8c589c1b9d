// What formats of splats have in common, and the .splat of antimatter15's viewer (github.com/antimatter15/splat).
#include "io/clouds/packed_splats.h"

#include "io/clouds/splats.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

constexpr std::array names{"x",       "y",       "z",       "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                           "scale_0", "scale_1", "scale_2", "rot_0",  "rot_1",  "rot_2",  "rot_3"};

constexpr std::size_t splat_stride = 32, splat_colour = 24, splat_rotation = 28;

float float_at(std::string_view bytes, std::size_t at) {
    return static_cast<float>(decoded(bytes.data() + at, Scalar::float32, false));
}

} // namespace

SplatTable::SplatTable(std::uint64_t count, const fs::path& file) {
    constexpr std::uint64_t most = 0x7fffffff;
    if (count > most)
        throw Error(fmt::format("{}: {} splats, at most {} are read", file.string(), count, most));
    records_.stride = names.size() * sizeof(float);
    require_memory(count * (records_.stride + sizeof(Splat) + sizeof(Eigen::Vector3d)),
                   fmt::format("{}: {} splats", file.string(), count));
    for (std::size_t k = 0; k < names.size(); ++k)
        records_.fields.push_back({names[k], Scalar::float32, 1, std::nullopt, k * sizeof(float)});
    records_.point_count = count;
    records_.grid = {static_cast<int>(count), 1};
    records_.points.resize(count * records_.stride);
}

void SplatTable::set(std::size_t splat, const SplatRow& row) {
    std::array<float, names.size()> values;
    const Eigen::Vector3f f_dc = (row.colour.array() - 0.5F) / static_cast<float>(colour_of_degree_0);
    std::ranges::copy(row.position, values.begin());
    std::ranges::copy(f_dc, values.begin() + 3);
    values[6] = std::log(row.opacity / (1 - row.opacity));
    std::ranges::copy(row.log_sigma, values.begin() + 7);
    values[10] = row.rotation.w();
    std::ranges::copy(row.rotation.vec(), values.begin() + 11);
    std::memcpy(records_.points.data() + splat * records_.stride, values.data(), sizeof values);
}

CloudRecords SplatTable::records(std::string packed) && {
    records_.packed = std::move(packed);
    records_.splats = splats_of(records_);
    return std::move(records_);
}

std::uint8_t shaded_byte(std::uint8_t byte, double light) {
    constexpr double full = 255;
    return cv::saturate_cast<std::uint8_t>(full * shaded_channel(byte / full, light));
}

CloudRecords read_splat(std::string_view bytes, const fs::path& file, std::vector<std::string>&) {
    constexpr std::size_t looks = 1024;
    if (bytes.size() % splat_stride != 0)
        throw Error(fmt::format("{}: {} bytes are no multiple of {}: the file is cut short, or no .splat",
                                file.string(), bytes.size(), splat_stride));
    SplatTable table(bytes.size() / splat_stride, file);
    const std::size_t count = bytes.size() / splat_stride;
    for (std::size_t i = 0; i < std::min(looks, count); ++i)
        for (std::size_t k = 0; k < 6; ++k)
            if (const float value = float_at(bytes, i * splat_stride + k * sizeof(float));
                !std::isfinite(value) || (k >= 3 && value < 0))
                throw Error(fmt::format("{}: does not look like a .splat: {} of record {} (byte {}) is {}",
                                        file.string(), k < 3 ? "a position" : "a sigma", i + 1,
                                        i * splat_stride + k * sizeof(float), value));
    tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
        const std::string_view record = bytes.substr(i * splat_stride, splat_stride);
        const auto number = [&](std::size_t k) { return float_at(record, k * sizeof(float)); };
        const auto byte = [&](std::size_t at) { return static_cast<float>(static_cast<unsigned char>(record[at])); };
        const auto turn = [&](std::size_t k) { return (byte(splat_rotation + k) - 127.5F) / 127.5F; };
        constexpr float full = 255;
        table.set(i,
                  {.position = {number(0), number(1), number(2)},
                   .colour = {byte(splat_colour) / full, byte(splat_colour + 1) / full, byte(splat_colour + 2) / full},
                   .log_sigma = Eigen::Array3f(number(3), number(4), number(5)).log(),
                   .opacity = byte(splat_colour + 3) / full,
                   .rotation = {turn(0), turn(1), turn(2), turn(3)}});
    });
    return std::move(table).records(std::string(bytes));
}

std::string shaded_splat(const CloudRecords& records, std::span<const float> visibility, double strength) {
    std::string bytes = records.packed;
    tbb::parallel_for(std::size_t(0), records.point_count, [&](std::size_t i) {
        const double light = light_of(visibility[i], strength);
        for (std::size_t at = i * splat_stride + splat_colour; at < i * splat_stride + splat_colour + 3; ++at)
            bytes[at] = static_cast<char>(shaded_byte(static_cast<std::uint8_t>(bytes[at]), light));
    });
    return bytes;
}

} // namespace scanshade
