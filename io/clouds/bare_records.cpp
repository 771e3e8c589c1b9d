// Clouds as bare floats: KITTI's .bin and nuScenes' .pcd.bin, which only their lengths and values tell from others.
#include "io/clouds/cloud_records.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <vector>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

/// nuScenes' points have a fifth number, the scanner's ring: a whole one below 64. It calls its files .pcd.bin.
bool has_rings(std::string_view bytes, const fs::path& file) {
    if (file.stem().extension() == ".pcd")
        return true;
    constexpr std::size_t stride = 20, ring = 16;
    constexpr double rings = 64;
    if (bytes.size() % stride != 0)
        return false;
    for (std::size_t at = ring; at < bytes.size(); at += stride)
        if (const double value = decoded(bytes.data() + at, Scalar::float32, false);
            !(value >= 0 && value < rings && value == std::floor(value)))
            return false;
    return true;
}

constexpr const char* not_records =
    "does not look like records of x y z reflectance (16 bytes) or x y z intensity ring (20)";
constexpr const char* convert = "Convert it to PLY or PCD, which name their fields";

/// Records of other fields, read as these, hold numbers that no scanner measures: absurd, or next to nothing (whole
/// numbers read as floats), or a reflectance that is negative or above 16 bits.
void check_sweep(std::string_view bytes, std::size_t stride, const fs::path& file) {
    constexpr float absurd = 1e6F, next_to_nothing = 1e-30F, most_reflectance = 65535;
    std::size_t odd = 0, all = 0;
    for (std::size_t at = 0; at + stride <= bytes.size(); at += stride, ++all) {
        std::array<float, 4> p{};
        for (std::size_t i = 0; i < p.size(); ++i)
            p[i] = static_cast<float>(decoded(bytes.data() + at + i * sizeof(float), Scalar::float32, false));
        const bool fits = std::ranges::none_of(p, [](float value) {
            return std::abs(value) > absurd || (value != 0 && std::abs(value) < next_to_nothing);
        });
        odd += !fits || p[3] < 0 || p[3] > most_reflectance;
    }
    constexpr std::size_t few = 20; // one of so many
    if (odd * few > all)
        throw Error(fmt::format("{}: {}: {} of {} have absurd values or a negative reflectance. {}", file.string(),
                                not_records, odd, all, convert));
}

/// Sorted values of one column in every `period`-th record, some thousands of them spread over the file.
std::vector<double> part_of(std::string_view bytes, std::size_t stride, std::size_t column, std::size_t first,
                            std::size_t period) {
    constexpr std::size_t enough = 4096;
    const std::size_t all = bytes.size() / stride / period, step = std::max<std::size_t>(1, all / enough);
    std::vector<double> values;
    for (std::size_t i = 0; i < all; i += step)
        if (const double value =
                decoded(bytes.data() + (i * period + first) * stride + column * sizeof(float), Scalar::float32, false);
            !std::isnan(value))
            values.push_back(value);
    std::ranges::sort(values);
    return values;
}

/// The largest difference of two distributions' shares below a value (Kolmogorov and Smirnov's).
double apart(const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0;
    for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
        const double value = std::min(a[i], b[j]);
        while (i < a.size() && a[i] == value)
            ++i;
        while (j < b.size() && b[j] == value)
            ++j;
        most = std::max(most, std::abs(static_cast<double>(i) / static_cast<double>(a.size()) -
                                       static_cast<double>(j) / static_cast<double>(b.size())));
    }
    return most;
}

/// Whether a column's values depend on the place of the record among each `period` in a row.
bool alternates(std::string_view bytes, std::size_t stride, std::size_t column, std::size_t period) {
    constexpr double much = 0.3;
    const std::vector<double> first = part_of(bytes, stride, column, 0, period);
    for (std::size_t k = 1; k < period; ++k)
        if (apart(first, part_of(bytes, stride, column, k, period)) > much)
            return true;
    return false;
}

/// Records of another length, read as these, hold other things in every second, third, fifth or seventh. Spinning
/// scanners that write one laser after the other do so in z alone.
void check_alignment(std::string_view bytes, std::size_t stride, const fs::path& file) {
    constexpr std::size_t fewest_records = 500, columns = 4;
    if (bytes.size() < fewest_records * stride)
        return;
    struct Row {
        std::size_t period, numbers; ///< of a record that looks so, where these are four
    };
    constexpr std::array rows{Row{2, 8}, Row{3, 6}, Row{5, 5}, Row{7, 7}};
    for (const auto& [period, numbers] : rows) {
        std::size_t found = 0;
        for (std::size_t column = 0; column < columns; ++column)
            found += alternates(bytes, stride, column, period);
        if (found < 2)
            continue;
        const std::size_t guess = period == 3 && bytes.size() % 24 != 0 ? 3 : numbers;
        throw Error(fmt::format("{}: {}: every {} records hold other values{}. {}", file.string(), not_records, period,
                                stride == 16 ? fmt::format(", as records of {} bytes do", guess * sizeof(float)) : "",
                                convert));
    }
}

} // namespace

CloudRecords read_kitti(std::string_view bytes, const fs::path& file, std::vector<std::string>&) {
    const bool rings = has_rings(bytes, file);
    const std::vector<const char*> names =
        rings ? std::vector{"x", "y", "z", "intensity", "ring"} : std::vector{"x", "y", "z", "reflectance"};
    const std::size_t stride = names.size() * sizeof(float);
    if (bytes.size() % stride != 0)
        throw Error(fmt::format("{}: {} bytes are not whole points of {} ({} as floats)", file.string(), bytes.size(),
                                stride, fmt::join(names, " ")));
    check_point_count(bytes.size() / stride, file);
    check_sweep(bytes, stride, file);
    check_alignment(bytes, stride, file);
    CloudRecords records;
    records.encoding = CloudRecords::Encoding::binary;
    records.point_count = bytes.size() / stride;
    records.header = fmt::format("ply\nformat binary_little_endian 1.0\ncomment {}, z up, metres\nelement vertex {}\n",
                                 rings ? "nuScenes sweep: x right, y forward" : "KITTI sweep: x forward, y left",
                                 records.point_count);
    for (const char* name : names) {
        records.header += fmt::format("property float {}\n", name);
        records.fields.push_back({name, Scalar::float32, 1, std::nullopt, sizeof(float) * records.fields.size()});
    }
    records.header += "end_header\n";
    records.stride = stride;
    records.points = bytes;
    records.grid = {static_cast<int>(records.point_count), 1};
    return records;
}

} // namespace scanshade
