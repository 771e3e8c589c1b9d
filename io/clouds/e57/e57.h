// E57 (ASTM E2807, version 1.0): the file without its pages, its scans as the XML describes them, and the values of
// their fields. io/clouds/e57_cloud.cpp makes records of a cloud of these. All failures throw Error, naming scan, field
// and byte, not the file.
#pragma once

#include <cstdint>
#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::e57 {

/// CRC-32C (Castagnoli), as the pages carry it.
[[nodiscard]] std::uint32_t checksum(std::string_view bytes);

/// The contents of all pages strung together. Every checksum is compared.
[[nodiscard]] std::string without_pages(std::string_view file);

/// How the values of a field are stored.
struct Field {
    enum class Kind { integer, scaled, single_float, double_float, text };

    std::string name;
    Kind kind = Kind::integer;
    std::int64_t minimum = 0, maximum = 0; ///< of stored integers
    double scale = 1, shift = 0;           ///< of scaled integers

    /// Bits of a value; texts have no fixed number.
    [[nodiscard]] unsigned bits() const;
};

/// Where a range of values begins and ends: the file's limits of intensity and colours.
struct Limits {
    double low = 0, high = 0;
};

struct Scan {
    std::string name;
    Eigen::Isometry3d file_from_scan = Eigen::Isometry3d::Identity();
    std::vector<Field> fields;
    std::uint64_t count = 0, section = 0; ///< points; offset in the file with pages
    std::optional<Limits> intensity, red, green, blue;
    std::optional<Limits> rows, columns;

    [[nodiscard]] std::optional<std::size_t> field_named(std::string_view name) const;
};

struct Description {
    std::vector<Scan> scans;
    std::vector<std::string> images; ///< what each is, in words: name, size, camera, place
};
/// From the header and the XML. `contents` is without_pages().
[[nodiscard]] Description described(std::string_view contents);

/// The streams of a scan's points, one for each field. `contents` is without_pages().
[[nodiscard]] std::vector<std::string> streams_of(std::string_view contents, const Scan& scan);
/// Calls `take(point, value)` for all values of a field, from several threads. Integers beyond 2^53 lose their low
/// bits.
void for_each_value(const Field& field, std::string_view stream, std::uint64_t count,
                    const std::function<void(std::size_t point, double value)>& take);

} // namespace scanshade::e57
