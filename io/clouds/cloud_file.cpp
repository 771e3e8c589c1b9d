// Clouds in and out: finds the format by content, reads points and colours from the records, adds fields to them.
#include "io/clouds/cloud_file.h"

#include "io/clouds/cloud_edit.h"
#include "io/clouds/cloud_records.h"
#include "io/clouds/format.h"
#include "io/clouds/splat_cameras.h"
#include "io/clouds/splats.h"
#include "io/output_file.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <utility>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Encoding = CloudRecords::Encoding;

constexpr double largest_coordinate = 1e30; // 3e38 and the like mark invalid points

CloudRecords read_records(const fs::path& file, std::vector<std::string>& warnings) {
    const std::string bytes = read_bytes(file);
    if (bytes.empty())
        throw Error(file.string() + ": empty file (0 bytes), expected a cloud");
    const CloudFormat* format = cloud_format(bytes, file);
    if (!format)
        throw Error(fmt::format("{}: begins with {}: neither {}", file.string(), in_quotes(bytes.substr(0, 4)),
                                listed(cloud_format_names(), "nor")));
    require_memory(2 * bytes.size(), // the records, and points as doubles
                   fmt::format("{}: a cloud of {} bytes", file.string(), bytes.size()));
    CloudRecords records = format->read(bytes, file, warnings);
    records.format = format;
    return records;
}

/// A coordinate of every point; finds its offset once if records have equal length.
void read_coordinate(const CloudRecords& records, std::size_t field, int axis, std::vector<Eigen::Vector3d>& points) {
    const bool alike = records.stride != 0;
    const std::size_t offset = records.fields[field].offset;
    const Scalar type = records.fields[field].type;
    const bool big_endian = records.encoding == Encoding::big_endian;
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        points[i][axis] = alike ? decoded(records.points.data() + i * records.stride + offset, type, big_endian)
                                : value_at(records, records.record(i), field);
    });
}

/// The same in the cloud's unit.
void place_coordinate(const CloudRecords& records, const char* name, int axis, std::vector<Eigen::Vector3d>& points) {
    read_coordinate(records, *records.field_named(name), axis, points);
    const double scale = records.scale[static_cast<std::size_t>(axis)],
                 shift = records.shift[static_cast<std::size_t>(axis)];
    if (scale == 1 && shift == 0)
        return;
    tbb::parallel_for(std::size_t(0), points.size(),
                      [&](std::size_t i) { points[i][axis] = points[i][axis] * scale + shift; });
}

/// In the cloud's unit, whatever they are.
std::vector<Eigen::Vector3d> recorded_points(const CloudRecords& records) {
    if (!records.placed.empty())
        return records.placed;
    std::vector<Eigen::Vector3d> points(records.point_count);
    place_coordinate(records, "x", 0, points);
    place_coordinate(records, "y", 1, points);
    place_coordinate(records, "z", 2, points);
    return points;
}

bool is_usable(const Eigen::Vector3d& point) { return (point.array().abs() <= largest_coordinate).all(); }

/// Of LAS and LAZ ("LAS Specification 1.4 - R15", tables 8, 9 and 17): withheld points "should not be included in
/// processing", and classes 7 and 18 are noise, birds and clouds among it. Elsewhere no point is.
class LeftOut {
  public:
    explicit LeftOut(const CloudRecords& records) : records_(records) {
        if (!records.format || !records.format->wide_colours || records.stride == 0) // LAS and LAZ have wide ones
            return;
        classification_ = records.field_named("classification");
        if (records.field_named("return_numbers")) // formats 6 to 10, where flags are beside the class
            flags_ = records.field_named("return_flags");
    }
    [[nodiscard]] bool operator()(std::size_t index) const {
        if (!classification_)
            return false;
        const unsigned byte = at(index, *classification_), flags = flags_ ? at(index, *flags_) : byte >> 5;
        const unsigned kind = flags_ ? byte : byte & 31;
        constexpr unsigned withheld = 4, low_noise = 7, high_noise = 18;
        return (flags & withheld) != 0 || kind == low_noise || (flags_ && kind == high_noise);
    }

  private:
    [[nodiscard]] unsigned at(std::size_t index, std::size_t field) const {
        return static_cast<unsigned char>(records_.points[index * records_.stride + records_.fields[field].offset]);
    }

    const CloudRecords& records_;
    std::optional<std::size_t> classification_, flags_;
};

} // namespace

std::vector<Eigen::Vector3d> points_of(const CloudRecords& records, PointOddities& odd) {
    std::vector<Eigen::Vector3d> points = recorded_points(records);
    const LeftOut is_left_out(records);
    std::atomic<std::size_t> absurd = 0, unusable = 0, left_out = 0; // hardly ever counted up
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        Eigen::Vector3d& point = points[i];
        const bool usable = is_usable(point), unwanted = is_left_out(i),
                   haze = !records.splats.empty() && records.splats[i].opacity < haze_opacity;
        if (usable && !unwanted && !haze)
            return;
        ++unusable;
        absurd += !usable && !point.array().isNaN().any();
        left_out += usable && unwanted;
        point.setConstant(std::numeric_limits<double>::quiet_NaN());
    });
    odd.all += points.size();
    odd.absurd += absurd;
    odd.unusable += unusable;
    odd.left_out += left_out;
    return points;
}

std::vector<Eigen::Vector3d> points_with_haze(const Cloud& cloud) {
    std::vector<Eigen::Vector3d> points = recorded_points(*cloud.records);
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        if (!is_usable(points[i]))
            points[i].setConstant(std::numeric_limits<double>::quiet_NaN());
    });
    return points;
}

void warn_of(const PointOddities& odd, const fs::path& file, std::vector<std::string>& warnings) {
    if (odd.absurd > 0)
        warnings.push_back(fmt::format("{}: {} with infinite or absurd coordinates (beyond 1e30), treated as invalid.",
                                       file.string(), counted(odd.absurd, "point")));
    if (odd.left_out > 0)
        warnings.push_back(fmt::format("{}: {} marked as withheld or as noise: left out, without visibility.",
                                       file.string(), counted(odd.left_out, "point")));
    if (odd.all == 0)
        warnings.push_back(file.string() + ": no points.");
    else if (odd.unusable == odd.all)
        warnings.push_back(fmt::format("{}: no valid points among {}.", file.string(), odd.all));
}

namespace {

cv::Vec3b bgr_of(std::uint32_t bits) {
    return {static_cast<uchar>(bits), static_cast<uchar>(bits >> 8), static_cast<uchar>(bits >> 16)};
}

/// A byte of colour that its file calls a signed one.
bool is_signed_byte(const CloudRecords& records, std::size_t field) {
    return records.fields[field].type == Scalar::int8;
}

/// What colours are divided by to be bytes. LAS has 16 bits per channel, but many writers store 8-bit values in them;
/// other files have 8 or 16 bits, or fractions of 1.
double colour_step_in(const CloudRecords& records, const std::array<std::size_t, 3>& bgr) {
    if (records.colour_step > 0)
        return records.colour_step;
    if (records.fields[bgr[0]].type == Scalar::uint8 && !records.text())
        return 1;
    double largest = 0; // NaN is smaller
    for (std::size_t i = 0; i < records.point_count; ++i)
        for (const std::size_t channel : bgr)
            if (largest = std::max(largest, value_at(records, records.record(i), channel)); largest > 255)
                return records.format->wide_colours ? 256 : 257;
    const Scalar type = records.fields[bgr[0]].type;
    const bool real = type == Scalar::float32 || type == Scalar::float64;
    return real && largest > 0 && largest <= 1 ? 1 / 255.0 : 1;
}

} // namespace

std::vector<cv::Vec3b> colours_of(const CloudRecords& records) {
    const ColourFields fields = colour_fields(records);
    std::vector<cv::Vec3b> colours;
    if (!fields.packed && !fields.bgr) {
        if (const auto splats = splat_fields(records))
            return colours_of(records, *splats);
        return colours;
    }
    const double step = fields.packed ? 1 : colour_step_in(records, *fields.bgr);
    colours.reserve(records.point_count);
    for (std::size_t i = 0; i < records.point_count; ++i) {
        const std::string_view record = records.record(i);
        if (fields.packed) {
            colours.push_back(bgr_of(packed_bits(records, record, *fields.packed)));
            continue;
        }
        cv::Vec3b colour;
        for (std::size_t channel = 0; channel < 3; ++channel) {
            const double stored = value_at(records, record, (*fields.bgr)[channel]);
            const double value =
                (is_signed_byte(records, (*fields.bgr)[channel]) && stored < 0 ? stored + 256 : stored) / step;
            colour[static_cast<int>(channel)] = cv::saturate_cast<uchar>(step == 256 ? std::floor(value) : value);
        }
        colours.push_back(colour);
    }
    return colours;
}

namespace {

void check_added(std::size_t points, const AddedField& field) {
    const bool word = !field.name.empty() && field.name.find_first_of(" \t\r\n") == std::string::npos;
    if (!word)
        throw Error(fmt::format("added field {}: expected a name without blanks", in_quotes(field.name)));
    if (field.values.size() != points)
        throw Error(fmt::format("added field {}: {}, expected one for each of {}", field.name,
                                counted(field.values.size(), "value"), counted(points, "point")));
}

/// Splits the added fields into those that the file already has and new ones.
void sort_out(const CloudRecords& records, const std::vector<AddedField>& added,
              std::vector<FieldReplacement>& replacements, std::vector<FieldAddition>& additions) {
    for (const AddedField& field : added) {
        const auto existing = records.field_named(field.name);
        const bool list = std::ranges::any_of(
            records.fields, [&](const CloudField& f) { return f.name == field.name && f.list_length; });
        if (!existing && !list) {
            additions.push_back({field.name, field.values});
            continue;
        }
        if (list || records.fields[*existing].count != 1)
            throw Error(
                fmt::format("field {} is already there with several values per point; it is not replaced", field.name));
        const CloudField& old = records.fields[*existing];
        replacements.push_back(
            {*existing, [&records, type = old.type, values = field.values](std::size_t point, std::string_view) {
                 return encoded(records, type, static_cast<double>(values[point]));
             }});
    }
}

void replace_colours(const CloudRecords& records, std::span<const cv::Vec3b> colours,
                     std::vector<FieldReplacement>& replacements) {
    const ColourFields fields = colour_fields(records);
    if (fields.packed) {
        replacements.push_back(
            {*fields.packed, [&records, colours, field = *fields.packed](std::size_t point, std::string_view record) {
                 const cv::Vec3b& c = colours[point];
                 const std::uint32_t alpha = packed_bits(records, record, field) & 0xff000000U;
                 const auto bits = alpha | std::uint32_t(c[2]) << 16 | std::uint32_t(c[1]) << 8 | c[0];
                 return encoded_bits(records, records.fields[field].type, bits);
             }});
    } else if (fields.bgr) {
        const double step = colour_step_in(records, *fields.bgr), full = step == 256 ? 257 : step; // 255 is 65535 then
        for (int channel = 0; channel < 3; ++channel) {
            const std::size_t field = (*fields.bgr)[static_cast<std::size_t>(channel)];
            replacements.push_back({field, [&records, colours, channel, full,
                                            type = records.fields[field].type](std::size_t point, std::string_view) {
                                        const double value = full * colours[point][channel];
                                        return encoded(records, type,
                                                       type == Scalar::int8 && value > 127 ? value - 256 : value);
                                    }});
        }
    } else {
        throw Error("the cloud has no colour field to replace (rgb, rgba, or red green blue)");
    }
}

/// Fields for colours that the file does not have. `values` keeps what they point to.
std::vector<FieldAddition> new_colour_fields(const CloudRecords& records, std::span<const cv::Vec3b> colours,
                                             std::vector<std::vector<float>>& values) {
    if (records.format->new_colours == NewColours::packed) {
        values.resize(1);
        for (const cv::Vec3b& c : colours) // no NaN among them: the highest byte is 0
            values[0].push_back(std::bit_cast<float>(std::uint32_t(c[2]) << 16 | std::uint32_t(c[1]) << 8 | c[0]));
        return {{"rgb", values[0]}};
    }
    values.resize(3);
    for (const cv::Vec3b& c : colours)
        for (int channel = 0; channel < 3; ++channel)
            values[static_cast<std::size_t>(channel)].push_back(c[2 - channel]);
    return {{"red", values[0], Scalar::uint8}, {"green", values[1], Scalar::uint8}, {"blue", values[2], Scalar::uint8}};
}

bool has_colour_fields(const CloudRecords& records) {
    const ColourFields fields = colour_fields(records);
    return fields.packed || fields.bgr;
}

} // namespace

CloudEdit edit_of(const CloudRecords& records, const std::vector<AddedField>& added,
                  std::span<const cv::Vec3b> colours) {
    CloudEdit edit;
    const std::size_t points = records.point_count;
    for (const AddedField& field : added)
        check_added(points, field);
    if (!colours.empty() && colours.size() != points)
        throw Error(fmt::format("{} for {}", counted(colours.size(), "colour"), counted(points, "point")));
    if (!colours.empty() && !has_colour_fields(records) && records.format->new_colours != NewColours::none)
        edit.additions = new_colour_fields(records, colours, edit.channels);
    else if (!colours.empty())
        replace_colours(records, colours, edit.replacements);
    sort_out(records, added, edit.replacements, edit.additions);
    std::sort(edit.replacements.begin(), edit.replacements.end(),
              [](const FieldReplacement& a, const FieldReplacement& b) { return a.field < b.field; });
    return edit;
}

double colour_step_of(const CloudRecords& records) {
    const ColourFields fields = colour_fields(records);
    return fields.bgr && !fields.packed ? colour_step_in(records, *fields.bgr) : 0;
}

namespace {

/// Says how colours were taken where the file does not, and which are not used.
void warn_of_colours(const CloudRecords& records, const fs::path& file, std::vector<std::string>& warnings) {
    const double step = records.colour_step;
    if (step > 0 && step < 1)
        warnings.push_back(file.string() + ": colours are at most 1: taken as fractions.");
    else if (step == 257)
        warnings.push_back(file.string() + ": colours above 255: taken as numbers of 16 bits.");
    if (step > 0 || has_colour_fields(records))
        return;
    constexpr std::array<std::string_view, 5> names{"red", "green", "blue", "rgb", "rgba"};
    for (const CloudField& field : records.fields)
        if (std::ranges::any_of(names, [&](std::string_view name) { return is_named(field, name); })) {
            warnings.push_back(
                fmt::format("{}: the field {} is not used as a colour: expected red, green and blue, or rgb "
                            "of 4 bytes.",
                            file.string(), in_quotes(field.name)));
            return;
        }
}

template <class Number>
void append(std::string& bytes, Number value) {
    const auto raw = std::bit_cast<std::array<char, sizeof(Number)>>(value);
    bytes.append(raw.data(), raw.size());
}

} // namespace

Cloud read_cloud(const fs::path& file, std::vector<std::string>& warnings) {
    auto records = std::make_shared<CloudRecords>(read_records(file, warnings));
    Cloud cloud;
    cloud.grid = records->grid;
    PointOddities odd;
    cloud.points = points_of(*records, odd);
    warn_of(odd, file, warnings);
    if (!records->splats.empty())
        records->cameras = splat_cameras(file, warnings);
    records->colour_step = colour_step_of(*records);
    warn_of_colours(*records, file, warnings);
    cloud.colours = colours_of(*records);
    cloud.records = std::move(records);
    return cloud;
}

std::span<const Splat> splats_of(const Cloud& cloud) {
    return cloud.records ? std::span(cloud.records->splats) : std::span<const Splat>();
}

std::vector<std::array<int, 3>> triangles_of(const Cloud& cloud) {
    const bool mesh = cloud.records && cloud.records->format->triangles;
    return mesh ? cloud.records->format->triangles(*cloud.records) : std::vector<std::array<int, 3>>();
}

std::optional<std::array<std::size_t, 3>> normal_fields(const CloudRecords& records) {
    for (const auto& names : {std::array{"nx", "ny", "nz"}, {"normal_x", "normal_y", "normal_z"}}) {
        const auto x = records.field_named(names[0]), y = records.field_named(names[1]),
                   z = records.field_named(names[2]);
        if (x && y && z)
            return std::array{*x, *y, *z};
    }
    return std::nullopt;
}

std::vector<Eigen::Vector3d> normals_of(const CloudRecords& records, const std::array<std::size_t, 3>& fields) {
    std::vector<Eigen::Vector3d> normals(records.point_count);
    for (int axis = 0; axis < 3; ++axis)
        read_coordinate(records, fields[static_cast<std::size_t>(axis)], axis, normals);
    // Some are as long as the area of their faces, and integers of 8 bits are 127 long.
    tbb::parallel_for(std::size_t(0), normals.size(), [&](std::size_t i) {
        if (const double length = normals[i].norm(); length > 0 && std::isfinite(length))
            normals[i] /= length;
    });
    return normals;
}

void NormalCounts::add(std::span<const Eigen::Vector3d> points, std::span<const Eigen::Vector3d> normals) {
    using Counts = std::pair<std::size_t, std::size_t>;
    const auto [more_valid, more_unit] = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, normals.size()), Counts(0, 0),
        [&](const auto& range, Counts counts) {
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                counts.first += points[i].allFinite();
                counts.second += points[i].allFinite() && std::abs(normals[i].norm() - 1) < 0.01;
            }
            return counts;
        },
        [](const Counts& a, const Counts& b) { return Counts(a.first + b.first, a.second + b.second); });
    valid += more_valid;
    unit += more_unit;
}

std::vector<Eigen::Vector3d> recorded_normals(const Cloud& cloud) {
    const auto fields = cloud.records ? normal_fields(*cloud.records) : std::nullopt;
    if (!fields)
        return {};
    std::vector<Eigen::Vector3d> normals = normals_of(*cloud.records, *fields);
    NormalCounts counts;
    counts.add(cloud.points, normals);
    return counts.are_normals() ? normals : std::vector<Eigen::Vector3d>();
}

std::vector<float> recorded_field(const Cloud& cloud, const std::string& name, const fs::path& file) {
    const auto field = cloud.records ? cloud.records->field_named(name) : std::nullopt;
    if (!field)
        throw Error(fmt::format("{}: no field {}", file.string(), name));
    std::vector<float> values(cloud.points.size());
    for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = static_cast<float>(value_at(*cloud.records, cloud.records->record(i), *field));
    return values;
}

void write_cloud(const fs::path& file, const Cloud& cloud, const std::vector<AddedField>& added,
                 std::span<const cv::Vec3b> colours) {
    if (!cloud.records)
        throw Error(file.string() + ": this cloud was not read from a file");
    const CloudRecords& records = *cloud.records;
    std::string bytes = during(file.string(), [&] {
        const CloudEdit edit = edit_of(records, added, colours);
        return records.format->written(records, edited_points(records, edit.replacements, edit.additions),
                                       edit.additions);
    });
    write_atomically(file, bytes);
}

void write_shaded_splats(const fs::path& file, const Cloud& cloud, std::span<const float> visibility, double strength) {
    const CloudRecords& records = *cloud.records;
    std::string bytes = during(file.string(), [&] {
        if (records.format->shaded)
            return records.format->shaded(records, visibility, strength);
        const auto shaded = shaded_splats(records, splat_fields(records).value(), visibility, strength);
        return records.format->written(records, edited_points(records, shaded, {}), {});
    });
    write_atomically(file, bytes);
}

void write_new_ply(const fs::path& file, const std::vector<Eigen::Vector3d>& points,
                   const std::vector<cv::Vec3b>& colours, const std::vector<AddedField>& added,
                   const std::vector<std::string>& comments) {
    // Beyond 4096 m neighbouring floats are half a millimetre apart.
    static constexpr double far_away_m = 4096;
    const bool doubles = std::any_of(points.begin(), points.end(),
                                     [](const Eigen::Vector3d& p) { return (p.array().abs() > far_away_m).any(); });
    if (!colours.empty() && colours.size() != points.size())
        throw Error(fmt::format("{}: {} for {}", file.string(), counted(colours.size(), "colour"),
                                counted(points.size(), "point")));
    for (const AddedField& field : added)
        if (field.values.size() != points.size())
            throw Error(fmt::format("{}: field {} has {} for {}", file.string(), field.name,
                                    counted(field.values.size(), "value"), counted(points.size(), "point")));

    std::string bytes = "ply\nformat binary_little_endian 1.0\n";
    for (std::string comment : comments) {
        std::replace_if(
            comment.begin(), comment.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
        bytes += "comment " + comment + "\n";
    }
    bytes += fmt::format("element vertex {}\n", points.size());
    for (const auto* axis : {"x", "y", "z"})
        bytes += fmt::format("property {} {}\n", doubles ? "double" : "float", axis);
    if (!colours.empty())
        for (const auto* channel : {"red", "green", "blue"})
            bytes += fmt::format("property uchar {}\n", channel);
    for (const AddedField& field : added)
        bytes += fmt::format("property float {}\n", field.name);
    bytes += "end_header\n";

    for (std::size_t i = 0; i < points.size(); ++i) {
        for (const double coordinate : points[i])
            doubles ? append(bytes, coordinate) : append(bytes, static_cast<float>(coordinate));
        if (!colours.empty())
            for (const int channel : {2, 1, 0})
                append(bytes, colours[i][channel]);
        for (const AddedField& field : added)
            append(bytes, field.values[i]);
    }
    write_atomically(file, bytes);
}

namespace {

std::string encoding_name(const CloudRecords& records) {
    switch (records.encoding) {
    case Encoding::ascii:
        return "ascii";
    case Encoding::compressed:
        return "binary_compressed";
    case Encoding::big_endian:
        return "binary_big_endian";
    case Encoding::binary:
        break;
    }
    return std::string(records.format->binary_encoding);
}

} // namespace

std::string describe(const CloudRecords& records) {
    std::string names;
    const bool as_read = records.format->written_extension.empty(); // else the encoding is that of what is written
    for (const CloudField& field : records.fields)
        names += " " + field.name;
    const std::string grid =
        records.grid.height > 1 ? fmt::format(", {}x{} organised", records.grid.width, records.grid.height) : "";
    const bool splats = !records.splats.empty() || splat_fields(records);
    return fmt::format("{}{}{}, {}{}, fields{}{}", records.format->name, as_read ? " " + encoding_name(records) : "",
                       records.octree.empty() ? ""
                                              : fmt::format(", COPC of {}", counted(records.octree.size(), "node")),
                       counted(records.point_count, splats ? "Gaussian splat" : "point"), grid, names,
                       records.unit.empty() ? "" : ", in " + records.unit);
}

std::string unit_of(const CloudRecords& records) { return records.unit; }

bool takes_colours(const Cloud& cloud) {
    return cloud.records && (cloud.records->format->new_colours != NewColours::none ||
                             has_colour_fields(*cloud.records) || !cloud.records->splats.empty());
}

bool takes_fields(const Cloud& cloud) { return !cloud.records || cloud.records->format->written; }

void MapCounts::add(const Eigen::Vector3d& point) {
    constexpr double from = 1e5; // eastings and northings have six digits or more
    if (!point.allFinite())
        return;
    ++all;
    there += point.head<2>().cwiseAbs().maxCoeff() > from && std::abs(point.z()) < from;
}

bool is_on_a_map(const Cloud& cloud) {
    MapCounts counts;
    for (std::size_t i = 0; i < cloud.points.size(); i += MapCounts::step(cloud.points.size()))
        counts.add(cloud.points[i]);
    return counts.on_a_map();
}

bool z_is_up(const Cloud& cloud) { return (cloud.records && cloud.records->format->z_up) || is_on_a_map(cloud); }

std::string extension(const CloudRecords& records) { return std::string(written_extension(*records.format)); }

std::string written_name(const std::string& name, const CloudRecords& records) {
    const bool plain_laz =
        records.encoding == Encoding::compressed && extension(records) == ".laz" && records.octree.empty();
    return (plain_laz ? plain_laz_name(name) : name) + extension(records);
}

} // namespace scanshade
