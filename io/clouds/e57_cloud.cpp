// E57 as a cloud: all scans of a file, placed by their poses. AO does not go back into E57: the records are those of a
// PLY with every field.
#include "io/clouds/cloud_records.h"
#include "io/clouds/e57/e57.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <tbb/parallel_for.h>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using e57::Field, e57::Limits, e57::Scan;

constexpr std::array cartesian{"cartesianX", "cartesianY", "cartesianZ"};
constexpr std::array spherical{"sphericalRange", "sphericalAzimuth", "sphericalElevation"};
constexpr std::array normals{"nor:normalX", "nor:normalY", "nor:normalZ"};
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

bool has_all(const Scan& scan, const std::array<const char*, 3>& names) {
    return std::ranges::all_of(names, [&](const char* name) { return scan.field_named(name).has_value(); });
}

/// The smallest number of PLY that holds all values of a field.
Scalar type_of(const Field& field) {
    if (field.kind == Field::Kind::single_float)
        return Scalar::float32;
    if (field.kind != Field::Kind::integer)
        return Scalar::float64;
    const auto fits = [&](std::int64_t low, std::int64_t high) {
        return field.minimum >= low && field.maximum <= high;
    };
    return fits(0, 0xff)                     ? Scalar::uint8
           : fits(-0x80, 0x7f)               ? Scalar::int8
           : fits(0, 0xffff)                 ? Scalar::uint16
           : fits(-0x8000, 0x7fff)           ? Scalar::int16
           : fits(0, 0xffffffff)             ? Scalar::uint32
           : fits(-0x80000000LL, 0x7fffffff) ? Scalar::int32
                                             : Scalar::float64;
}

std::string_view ply_name(Scalar type) {
    switch (type) {
    case Scalar::int8:
        return "char";
    case Scalar::uint8:
        return "uchar";
    case Scalar::int16:
        return "short";
    case Scalar::uint16:
        return "ushort";
    case Scalar::int32:
        return "int";
    case Scalar::uint32:
        return "uint";
    case Scalar::float32:
        return "float";
    default:
        return "double";
    }
}

template <class Number>
void store(char* to, double value) {
    const auto number = static_cast<Number>(value);
    std::memcpy(to, &number, sizeof number);
}

void store_as(Scalar type, char* to, double value) {
    switch (type) {
    case Scalar::int8:
        return store<std::int8_t>(to, value);
    case Scalar::uint8:
        return store<std::uint8_t>(to, value);
    case Scalar::int16:
        return store<std::int16_t>(to, value);
    case Scalar::uint16:
        return store<std::uint16_t>(to, value);
    case Scalar::int32:
        return store<std::int32_t>(to, value);
    case Scalar::uint32:
        return store<std::uint32_t>(to, value);
    case Scalar::float32:
        return store<float>(to, value);
    default:
        return store<double>(to, value);
    }
}

/// What a field is called in the cloud. Positions are x, y, z there and have no name of their own.
std::string name_in_cloud(const std::string& name) {
    static constexpr std::array<std::pair<std::string_view, std::string_view>, 6> known{{{"colorRed", "red"},
                                                                                         {"colorGreen", "green"},
                                                                                         {"colorBlue", "blue"},
                                                                                         {"nor:normalX", "nx"},
                                                                                         {"nor:normalY", "ny"},
                                                                                         {"nor:normalZ", "nz"}}};
    const auto found = std::ranges::find(known, name, &std::pair<std::string_view, std::string_view>::first);
    return found == known.end() ? name : std::string(found->second);
}

bool is_colour(const std::string& name) { return name == "colorRed" || name == "colorGreen" || name == "colorBlue"; }

/// The range that stands for black to full colour; integers use all of theirs where the file names none.
std::optional<Limits> range_of_colour(const Scan& scan, const Field& field) {
    const auto& said = field.name == "colorRed" ? scan.red : field.name == "colorGreen" ? scan.green : scan.blue;
    if (said || field.kind != Field::Kind::integer || field.maximum <= field.minimum)
        return said;
    return Limits{static_cast<double>(field.minimum), static_cast<double>(field.maximum)};
}

CloudField& field_in(CloudRecords& records, const std::string& name) {
    return records.fields[records.field_named(name).value()];
}

/// All fields that any scan has; a field of several types becomes double.
void add_fields(CloudRecords& records, const std::vector<Scan>& scans, const fs::path& file,
                std::vector<std::string>& warnings) {
    for (const char* name : {"x", "y", "z"})
        records.fields.push_back({name, Scalar::float64, 1, std::nullopt, 0});
    bool texts = false;
    for (const Scan& scan : scans)
        for (const Field& field : scan.fields) {
            if (std::ranges::find(cartesian, field.name) != cartesian.end())
                continue;
            if (field.kind == Field::Kind::text) {
                texts = true;
                continue;
            }
            const std::string name = name_in_cloud(field.name);
            const Scalar type = is_colour(field.name) ? Scalar::uint8 : type_of(field);
            if (name == "x" || name == "y" || name == "z" || name.find_first_of(" \t\r\n") != std::string::npos)
                throw Error(fmt::format("a field {}, which E57 does not have", in_quotes(name)));
            if (!records.field_named(name))
                records.fields.push_back({name, type, 1, std::nullopt, 0});
            else if (CloudField& known = field_in(records, name); known.type != type)
                known.type = Scalar::float64;
        }
    if (scans.size() > 1)
        records.fields.push_back({"scan", Scalar::uint16, 1, std::nullopt, 0});
    if (texts)
        warnings.push_back(file.string() + ": fields of text are left out.");
    for (CloudField& field : records.fields) {
        field.offset = records.stride;
        records.stride += field.bytes();
    }
}

/// Reads one scan into the records from point `first` on.
class ScanReader {
  public:
    ScanReader(CloudRecords& records, const Scan& scan, std::string_view contents, std::size_t first)
        : records_(records), scan_(scan), streams_(e57::streams_of(contents, scan)), first_(first) {}

    void read(std::size_t index) {
        for (std::size_t i = 0; i < scan_.fields.size(); ++i)
            read_field(i);
        place_points();
        turn_normals();
        if (const auto number = records_.field_named("scan"); number && records_.fields[*number].type == Scalar::uint16)
            for (std::size_t i = 0; i < scan_.count; ++i)
                store<std::uint16_t>(place(i, *number), static_cast<double>(index));
    }

  private:
    char* place(std::size_t point, std::size_t field) {
        return records_.points.data() + (first_ + point) * records_.stride + records_.fields[field].offset;
    }

    void read_field(std::size_t index) {
        const Field& field = scan_.fields[index];
        if (field.kind == Field::Kind::text || std::ranges::find(cartesian, field.name) != cartesian.end())
            return;
        const std::size_t to = records_.field_named(name_in_cloud(field.name)).value();
        const Scalar type = records_.fields[to].type;
        const auto range = is_colour(field.name) ? range_of_colour(scan_, field) : std::nullopt;
        e57::for_each_value(field, streams_[index], scan_.count, [&](std::size_t i, double value) {
            if (range)
                value = 255 * (value - range->low) / (range->high - range->low);
            if (is_colour(field.name))
                value = value > 0 ? std::min(std::round(value), 255.0) : 0; // NaN is black
            store_as(type, place(i, to), value);
        });
    }

    /// Three fields as vectors, one for each point.
    std::vector<Eigen::Vector3d> vectors(const std::array<const char*, 3>& names) {
        std::vector<Eigen::Vector3d> found(scan_.count);
        for (int axis = 0; axis < 3; ++axis) {
            const std::size_t field = scan_.field_named(names[static_cast<std::size_t>(axis)]).value();
            e57::for_each_value(scan_.fields[field], streams_[field], scan_.count,
                                [&](std::size_t i, double value) { found[i][axis] = value; });
        }
        return found;
    }

    void place_points() {
        const bool straight = has_all(scan_, cartesian);
        if (!straight && !has_all(scan_, spherical))
            throw Error("neither cartesianX Y Z nor spherical coordinates");
        std::vector<Eigen::Vector3d> points = vectors(straight ? cartesian : spherical);
        if (!straight)
            tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
                const double range = points[i][0], azimuth = points[i][1], elevation = points[i][2];
                points[i] = range * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                                    std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
            });
        if (const auto state = scan_.field_named(straight ? "cartesianInvalidState" : "sphericalInvalidState"))
            e57::for_each_value(scan_.fields[*state], streams_[*state], scan_.count, [&](std::size_t i, double value) {
                if (value != 0)
                    points[i].setConstant(nan);
            });
        tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
            const Eigen::Vector3d point = scan_.file_from_scan * points[i];
            std::memcpy(place(i, 0), point.data(), sizeof(double) * 3);
        });
    }

    void turn_normals() {
        if (!has_all(scan_, normals))
            return;
        const std::vector<Eigen::Vector3d> found = vectors(normals);
        for (int axis = 0; axis < 3; ++axis) {
            const std::size_t to =
                records_.field_named(std::array{"nx", "ny", "nz"}[static_cast<std::size_t>(axis)]).value();
            if (const Scalar type = records_.fields[to].type; type == Scalar::float32 || type == Scalar::float64)
                tbb::parallel_for(std::size_t(0), found.size(), [&](std::size_t i) {
                    store_as(type, place(i, to), scan_.file_from_scan.linear().row(axis).dot(found[i]));
                });
        }
    }

    CloudRecords& records_;
    const Scan& scan_;
    std::vector<std::string> streams_;
    std::size_t first_;
};

/// Puts the points of a single scan into the order of its grid, if every cell has exactly one. Otherwise they stay as
/// they are; returns why, empty for success.
std::string put_in_grid(CloudRecords& records) {
    std::array<std::vector<std::int64_t>, 2> index;
    std::array<std::int64_t, 2> low{}, size{};
    for (std::size_t k = 0; k < 2; ++k) {
        const auto field = records.field_named(k == 0 ? "rowIndex" : "columnIndex");
        if (!field || records.point_count == 0)
            return "it has none";
        std::int64_t high = std::numeric_limits<std::int64_t>::min();
        low[k] = std::numeric_limits<std::int64_t>::max();
        for (std::size_t i = 0; i < records.point_count; ++i) {
            const double value = value_at(records, records.record(i), *field);
            if (!(std::abs(value) <= 0x7fffffff))
                return fmt::format("point {} is in row or column {}", i, value);
            index[k].push_back(static_cast<std::int64_t>(value));
            low[k] = std::min(low[k], index[k].back()), high = std::max(high, index[k].back());
        }
        size[k] = high - low[k] + 1;
    }
    const auto count = static_cast<std::int64_t>(records.point_count);
    if (size[0] > count || size[1] > count || size[0] * size[1] != count)
        return fmt::format("{} columns of {} rows are not {} points", size[1], size[0], count);
    std::vector<bool> seen(records.point_count);
    std::string sorted(records.points.size(), '\0');
    for (std::size_t i = 0; i < records.point_count; ++i) {
        const auto cell = static_cast<std::size_t>((index[0][i] - low[0]) * size[1] + index[1][i] - low[1]);
        if (seen[cell])
            return fmt::format("two points are in row {}, column {}", index[0][i], index[1][i]);
        seen[cell] = true;
        records.record(i).copy(sorted.data() + cell * records.stride, records.stride);
    }
    records.points = std::move(sorted);
    records.grid = {static_cast<int>(size[1]), static_cast<int>(size[0])};
    return "";
}

std::string ply_header(const CloudRecords& records, const std::vector<Scan>& scans) {
    std::string header = "ply\nformat binary_little_endian 1.0\ncomment from E57, z up, metres\n";
    for (std::size_t i = 0; i < scans.size(); ++i) {
        std::string name = scans[i].name.substr(0, 200);
        std::ranges::replace_if(
            name, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
        header += fmt::format("comment scan {} {}\n", i, name);
    }
    if (records.grid.height > 1)
        header += fmt::format("obj_info num_cols {}\nobj_info num_rows {}\n", records.grid.width, records.grid.height);
    header += fmt::format("element vertex {}\n", records.point_count);
    for (const CloudField& field : records.fields)
        header += fmt::format("property {} {}\n", ply_name(field.type), field.name);
    return header + "end_header\n";
}

CloudRecords read_contents(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    const std::string contents = e57::without_pages(bytes);
    const e57::Description description = e57::described(contents);
    const std::vector<Scan>& scans = description.scans;
    if (scans.empty())
        throw Error(fmt::format("no scan in this E57 ({}{}{})", counted(description.images.size(), "image"),
                                description.images.empty() ? "" : "; ",
                                description.images.empty() ? "" : description.images.front()));
    CloudRecords records;
    records.encoding = CloudRecords::Encoding::binary;
    add_fields(records, scans, file, warnings);
    constexpr std::uint64_t most = 0x7fffffff, most_without_bits = 1 << 16;
    std::uint64_t count = 0;
    for (std::size_t k = 0; k < scans.size(); ++k) {
        std::uint64_t bits = 0;
        for (const Field& field : scans[k].fields)
            bits += field.bits();
        if (bits == 0 && scans[k].count > most_without_bits)
            throw Error(fmt::format("scan {}: {} points, for which nothing is stored", k, scans[k].count));
        if (bits > 0 && scans[k].count > 8 * bytes.size())
            throw Error(fmt::format("scan {}: {} points in a file of {} bytes", k, scans[k].count, bytes.size()));
        count += scans[k].count;
    }
    if (count > most)
        throw Error(fmt::format("{} points, at most {} are read", count, most));
    records.point_count = count;
    records.grid = {static_cast<int>(count), 1};
    std::size_t first = 0;
    for (std::size_t k = 0; k < scans.size(); ++k)
        during(fmt::format("scan {}", k), [&] {
            ScanReader reader(records, scans[k], contents, first); // checks its size before memory is taken for it
            const std::uint64_t size = (first + scans[k].count) * records.stride;
            require_memory(size - records.points.size() + 24 * scans[k].count, "the points");
            if (records.points.capacity() < size && scans.size() == 1)
                records.points.reserve(size);
            records.points.resize(size);
            reader.read(k);
            first += scans[k].count;
        });
    if (scans.size() == 1) {
        const bool gridded = scans[0].field_named("rowIndex") && scans[0].field_named("columnIndex");
        if (const std::string why = put_in_grid(records); gridded && !why.empty() && count > 0)
            warnings.push_back(fmt::format("{}: read without its grid: {}.", file.string(), why));
        Eigen::Isometry3d viewpoint = Eigen::Isometry3d::Identity();
        viewpoint.translation() = scans[0].file_from_scan.translation();
        records.viewpoint = viewpoint;
    } else {
        std::size_t begin = 0;
        for (const Scan& scan : scans) {
            records.stations.push_back({begin, scan.file_from_scan.translation()});
            begin += scan.count;
        }
        warnings.push_back(fmt::format("{}: {} scans are read as one cloud; the field scan tells them apart.",
                                       file.string(), scans.size()));
    }
    RepeatedWarning unused(warnings);
    for (const std::string& image : description.images)
        unused.add(fmt::format("{}: {}; not used: colours are those of the points.", file.string(), image));
    records.header = ply_header(records, scans);
    return records;
}

} // namespace

CloudRecords read_e57(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    return during(file.string(), [&] { return read_contents(bytes, file, warnings); });
}

} // namespace scanshade
