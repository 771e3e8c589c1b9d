// PCD 0.7 (pointclouds.org, "The PCD file format"): header checked line by line, bodies kept as they are.
#include "io/clouds/cloud_records.h"

#include "io/file_bytes.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <liblzf/lzf.h>
#include <map>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Encoding = CloudRecords::Encoding;

constexpr std::size_t longest_pcd_header = 1 << 16;
constexpr std::size_t widest_point = 1 << 20;
constexpr std::uint64_t most_pcd_points = 0x7fffffff; // projection's images of point numbers are 32-bit

struct HeaderLine {
    int number = 0;
    std::vector<std::string_view> values;
};

struct PcdHeader {
    std::map<std::string, HeaderLine, std::less<>> lines;
    std::size_t length = 0; ///< bytes, the DATA line's end included
    int next_line = 0;      ///< number of the first line of the body

    [[nodiscard]] const HeaderLine* find(std::string_view key) const {
        const auto found = lines.find(key);
        return found == lines.end() ? nullptr : &found->second;
    }
};

PcdHeader split_header(std::string_view bytes, const fs::path& file) {
    static constexpr std::array known{"VERSION", "FIELDS", "COLUMNS",   "SIZE",   "TYPE", "COUNT",
                                      "WIDTH",   "HEIGHT", "VIEWPOINT", "POINTS", "DATA"};
    PcdHeader header;
    int number = 0;
    for (std::size_t at = 0; at < std::min(bytes.size(), longest_pcd_header);) {
        const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
        const auto line = words(bytes.substr(at, end - at));
        at = std::min(end + 1, bytes.size());
        ++number;
        if (line.empty() || line[0].starts_with('#'))
            continue;
        if (std::find(known.begin(), known.end(), line[0]) == known.end())
            throw Error(fmt::format("{}: {} is no header entry, and no DATA line came before it", at_line(file, number),
                                    in_quotes(line[0])));
        const std::string key(line[0] == "COLUMNS" ? "FIELDS" : line[0]);
        if (!header.lines.emplace(key, HeaderLine{number, {line.begin() + 1, line.end()}}).second)
            throw Error(fmt::format("{}: {} appears a second time", at_line(file, number), key));
        if (key != "DATA")
            continue;
        header.length = at;
        header.next_line = number + 1;
        return header;
    }
    throw Error(fmt::format("{}: no DATA line in the header", file.string()));
}

/// The values of a header line; one per field.
const HeaderLine& required(const PcdHeader& header, std::string_view key, std::size_t values, const fs::path& file) {
    const HeaderLine* line = header.find(key);
    if (!line)
        throw Error(fmt::format("{}: no {} line in the header", file.string(), key));
    if (values != 0 && line->values.size() != values)
        throw Error(fmt::format("{}: {} has {}, expected {}", at_line(file, line->number), key,
                                counted(line->values.size(), "value"), values));
    return *line;
}

std::uint64_t count_in(const HeaderLine& line, std::string_view key, std::size_t index, const fs::path& file) {
    const auto value = whole_number(line.values[index]);
    if (!value)
        throw Error(fmt::format("{}: {} is {}, expected a whole number", at_line(file, line.number), key,
                                in_quotes(line.values[index])));
    return *value;
}

Scalar scalar_of(std::uint64_t size, std::string_view type, const fs::path& file, const HeaderLine& size_line,
                 const HeaderLine& type_line) {
    if (type != "I" && type != "U" && type != "F")
        throw Error(fmt::format("{}: TYPE {}, expected I, U or F", at_line(file, type_line.number), in_quotes(type)));
    const bool is_signed = type == "I";
    if (type == "F" && size == 4)
        return Scalar::float32;
    if (type == "F" && size == 8)
        return Scalar::float64;
    if (type != "F" && size == 1)
        return is_signed ? Scalar::int8 : Scalar::uint8;
    if (type != "F" && size == 2)
        return is_signed ? Scalar::int16 : Scalar::uint16;
    if (type != "F" && size == 4)
        return is_signed ? Scalar::int32 : Scalar::uint32;
    if (type != "F" && size == 8)
        return is_signed ? Scalar::int64 : Scalar::uint64;
    throw Error(fmt::format("{}: SIZE {} for type {}, expected {}", at_line(file, size_line.number), size, type,
                            type == "F" ? "4 or 8" : "1, 2, 4 or 8"));
}

std::vector<CloudField> fields_of(const PcdHeader& header, const fs::path& file, std::size_t& stride) {
    const HeaderLine& names = required(header, "FIELDS", 0, file);
    const std::size_t n = names.values.size();
    if (n == 0)
        throw Error(fmt::format("{}: FIELDS names no field", at_line(file, names.number)));
    const HeaderLine& sizes = required(header, "SIZE", n, file);
    const HeaderLine& types = required(header, "TYPE", n, file);
    const HeaderLine* counts = header.find("COUNT") ? &required(header, "COUNT", n, file) : nullptr;
    std::vector<CloudField> fields(n);
    stride = 0;
    for (std::size_t i = 0; i < n; ++i) {
        fields[i].name = names.values[i];
        fields[i].type = scalar_of(count_in(sizes, "SIZE", i, file), types.values[i], file, sizes, types);
        const std::uint64_t count = counts ? count_in(*counts, "COUNT", i, file) : 1;
        if (count > widest_point) // 0: padding of no bytes, as drivers of lidars write it
            throw Error(
                fmt::format("{}: COUNT {}, expected 0 .. {}", at_line(file, counts->number), count, widest_point));
        fields[i].count = count;
        fields[i].offset = stride;
        stride += fields[i].bytes();
        if (stride > widest_point)
            throw Error(fmt::format("{}: a point takes more than {} bytes", file.string(), widest_point));
    }
    for (const auto* name : {"x", "y", "z"}) {
        const auto found = std::find_if(fields.begin(), fields.end(),
                                        [&](const CloudField& f) { return is_named(f, name) && f.count > 0; });
        if (found == fields.end())
            throw Error(fmt::format("{}: no field {} among {}", at_line(file, names.number), name,
                                    fmt::join(names.values, " ")));
    }
    return fields;
}

/// WIDTH x HEIGHT, which must be POINTS where all three are given.
cv::Size grid_of(const PcdHeader& header, const fs::path& file) {
    const auto value = [&](std::string_view key) -> std::optional<std::uint64_t> {
        if (!header.find(key))
            return std::nullopt;
        return count_in(required(header, key, 1, file), key, 0, file);
    };
    const auto points = value("POINTS"), width = value("WIDTH"), height = value("HEIGHT");
    if (!points && !width)
        throw Error(file.string() + ": neither POINTS nor WIDTH in the header");
    const std::uint64_t columns = width.value_or(points.value_or(0)), rows = height.value_or(1);
    const bool too_many = columns > most_pcd_points || rows > most_pcd_points || columns * rows > most_pcd_points;
    if (too_many)
        throw Error(fmt::format("{}: WIDTH {} x HEIGHT {} is more than {} points", file.string(), columns, rows,
                                most_pcd_points));
    if (points && *points != columns * rows)
        throw Error(fmt::format("{}: WIDTH {} x HEIGHT {} is {}, but POINTS says {}", file.string(), columns, rows,
                                columns * rows, *points));
    return {static_cast<int>(columns), static_cast<int>(rows)};
}

std::optional<Eigen::Isometry3d> viewpoint_of(const PcdHeader& header, const fs::path& file,
                                              std::vector<std::string>& warnings) {
    const HeaderLine* line = header.find("VIEWPOINT");
    if (!line)
        return std::nullopt;
    std::vector<double> v;
    for (const auto word : line->values)
        if (const auto value = number(word); value && std::isfinite(*value))
            v.push_back(*value);
    const auto ignore = [&](std::string_view why) {
        warnings.push_back(fmt::format("{}: VIEWPOINT {}; taken as identity.", at_line(file, line->number), why));
        return std::nullopt;
    };
    if (v.size() != 7 || line->values.size() != 7)
        return ignore("is not 7 finite numbers tx ty tz qw qx qy qz");
    const Eigen::Quaterniond rotation(v[3], v[4], v[5], v[6]);
    if (!(rotation.norm() > 1e-12))
        return ignore("has a zero quaternion");
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
    pose.linear() = rotation.normalized().toRotationMatrix();
    if (pose.matrix().isIdentity(1e-12))
        return std::nullopt;
    return pose;
}

// --- bodies ---

void read_text(CloudRecords& records, std::string_view body, const PcdHeader& header, const fs::path& file,
               std::vector<std::string>& warnings) {
    std::size_t values = 0;
    for (const CloudField& field : records.fields)
        values += field.count;
    TextRecords lines(body, header.next_line);
    while (records.ends.size() < records.point_count && lines.next()) {
        if (lines.words().size() != values)
            throw Error(fmt::format("{}: {}, expected {} (one point)", at_line(file, lines.line()),
                                    counted(lines.words().size(), "value"), values));
        for (const auto word : lines.words())
            if (!number(word))
                throw Error(fmt::format("{}: {} is not a number", at_line(file, lines.line()), in_quotes(word)));
        records.ends.push_back(lines.end());
    }
    if (records.ends.size() < records.point_count)
        throw Error(fmt::format("{}: the header says {}, the file holds {}", file.string(),
                                counted(records.point_count, "point"), records.ends.size()));
    const std::size_t used = records.ends.empty() ? 0 : records.ends.back();
    std::size_t left_over = 0;
    int first_left_over = 0;
    for (; lines.next(); ++left_over)
        if (left_over == 0)
            first_left_over = lines.line();
    if (left_over > 0)
        warnings.push_back(
            fmt::format("{}: the header says {}, but {} left over from line {} on; they are not points, and are "
                        "written back as they are.",
                        file.string(), counted(records.point_count, "point"),
                        left_over == 1 ? "1 line is" : fmt::format("{} lines are", left_over), first_left_over));
    records.points = body.substr(0, used);
    records.after = body.substr(used);
}

void check_length(std::size_t found, std::size_t expected, const CloudRecords& records, const fs::path& file) {
    if (found < expected)
        throw Error(fmt::format("{}: {} of {} bytes need {} bytes, found {}", file.string(),
                                counted(records.point_count, "point"), records.stride, expected, found));
}

void keep_trailing(CloudRecords& records, std::string_view rest, const fs::path& file,
                   std::vector<std::string>& warnings) {
    records.after = rest;
    // PCL pads compressed files with zeros up to a memory page; they are kept without a warning.
    if (rest.find_first_not_of('\0') != std::string_view::npos)
        warnings.push_back(fmt::format("{}: {} after the last point; written back as they are.", file.string(),
                                       counted(rest.size(), "byte")));
}

void read_binary(CloudRecords& records, std::string_view body, const fs::path& file,
                 std::vector<std::string>& warnings) {
    const std::size_t expected = records.point_count * records.stride;
    check_length(body.size(), expected, records, file);
    records.points = body.substr(0, expected);
    keep_trailing(records, body.substr(expected), file, warnings);
}

/// Copies values of `bytes` bytes; they are `from_step` apart in the source and `to_step` in the target.
void copy_strided(const char* from, std::size_t from_step, char* to, std::size_t to_step, std::size_t bytes,
                  std::size_t count) {
    const bool usual = bytes == 4; // a copy whose length the compiler knows is several times faster
    for (std::size_t i = 0; i < count; ++i, from += from_step, to += to_step)
        usual ? std::memcpy(to, from, 4) : std::memcpy(to, from, bytes);
}

/// Compressed bodies hold the first field of all points, then the second of all points, ...
std::string rows_from_columns(const std::string& columns, const std::vector<CloudField>& fields, std::size_t stride,
                              std::size_t points) {
    std::string rows(columns.size(), '\0');
    const char* column = columns.data();
    for (const CloudField& field : fields) {
        copy_strided(column, field.bytes(), rows.data() + field.offset, stride, field.bytes(), points);
        column += points * field.bytes();
    }
    return rows;
}

std::string columns_from_rows(const std::string& rows, const std::vector<CloudField>& fields, std::size_t stride,
                              std::size_t points) {
    std::string columns(rows.size(), '\0');
    char* column = columns.data();
    for (const CloudField& field : fields) {
        copy_strided(rows.data() + field.offset, stride, column, field.bytes(), field.bytes(), points);
        column += points * field.bytes();
    }
    return columns;
}

void read_compressed(CloudRecords& records, std::string_view body, std::size_t body_at, const fs::path& file,
                     std::vector<std::string>& warnings) {
    if (body.size() < 8)
        throw Error(fmt::format("{}: ends at byte {}, before the two sizes of a compressed body", file.string(),
                                body_at + body.size()));
    std::uint32_t packed = 0, unpacked = 0;
    std::memcpy(&packed, body.data(), 4);
    std::memcpy(&unpacked, body.data() + 4, 4);
    const std::size_t expected = records.point_count * records.stride;
    if (unpacked != expected)
        throw Error(fmt::format("{}: uncompressed size at byte {} is {}, but {} of {} bytes make {}", file.string(),
                                body_at + 4, unpacked, counted(records.point_count, "point"), records.stride,
                                expected));
    if (packed > body.size() - 8)
        throw Error(fmt::format("{}: compressed body of {} bytes expected at byte {}, found {}", file.string(), packed,
                                body_at + 8, body.size() - 8));
    // Three bytes of LZF make 264 at most: a small file cannot ask for a large allocation.
    if (unpacked / 88 > packed)
        throw Error(fmt::format("{}: {} compressed bytes at byte {} cannot unpack to {}", file.string(), packed,
                                body_at + 8, unpacked));
    std::string columns(unpacked, '\0');
    if (unpacked > 0 && lzf_decompress(body.data() + 8, packed, columns.data(), unpacked) != unpacked)
        throw Error(fmt::format("{}: compressed body at byte {} is damaged (LZF)", file.string(), body_at + 8));
    records.packed = body.substr(0, 8 + packed);
    records.points = rows_from_columns(columns, records.fields, records.stride, records.point_count);
    keep_trailing(records, body.substr(8 + packed), file, warnings);
}

/// LZF without compression: runs of up to 32 literal bytes, each behind its length - 1.
std::string literal_runs(std::string_view bytes) {
    std::string packed;
    for (; !bytes.empty(); bytes.remove_prefix(std::min<std::size_t>(32, bytes.size()))) {
        const std::string_view run = bytes.substr(0, 32);
        packed += static_cast<char>(run.size() - 1);
        packed += run;
    }
    return packed;
}

std::string compressed(const std::string& columns) {
    constexpr std::size_t largest = 0xf0000000; // sizes are 32-bit, and incompressible data grow
    if (columns.size() > largest)
        throw Error("too many points for a compressed PCD");
    std::string packed(columns.size() + columns.size() / 16 + 64, '\0');
    const auto length = columns.size() < 8 ? 0
                                           : lzf_compress(columns.data(), static_cast<unsigned>(columns.size()),
                                                          packed.data(), static_cast<unsigned>(packed.size()));
    packed = length > 0 ? packed.substr(0, length) : literal_runs(columns);
    const std::array<std::uint32_t, 2> sizes{static_cast<std::uint32_t>(packed.size()),
                                             static_cast<std::uint32_t>(columns.size())};
    return std::string(reinterpret_cast<const char*>(sizes.data()), sizeof sizes) + packed;
}

/// The header with each addition's name, size, type and count at the end of its lines.
std::string header_with(const std::string& header, const std::vector<FieldAddition>& additions) {
    std::string result;
    for (std::size_t at = 0; at < header.size();) {
        const std::size_t end = std::min(header.find('\n', at), header.size() - 1) + 1;
        const std::string_view line = std::string_view(header).substr(at, end - at);
        const std::string_view text = line.substr(0, line.find_last_not_of(" \t\r\n") + 1);
        const auto line_words = words(line);
        const std::string_view key = line_words.empty() ? std::string_view() : line_words[0];
        result += text;
        for (const FieldAddition& addition : additions) {
            if (key == "FIELDS" || key == "COLUMNS")
                result += " " + addition.name;
            if (key == "SIZE")
                result += " 4";
            if (key == "TYPE")
                result += " F";
            if (key == "COUNT")
                result += " 1";
        }
        result += line.substr(text.size());
        at = end;
    }
    return result;
}

} // namespace

CloudRecords read_pcd(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    const PcdHeader header = split_header(bytes, file);
    CloudRecords records;
    records.header = bytes.substr(0, header.length);
    std::size_t stride = 0;
    records.fields = fields_of(header, file, stride);
    records.grid = grid_of(header, file);
    records.point_count = static_cast<std::size_t>(records.grid.width) * static_cast<std::size_t>(records.grid.height);
    records.viewpoint = viewpoint_of(header, file, warnings);

    const HeaderLine& data = required(header, "DATA", 1, file);
    const std::string_view body = bytes.substr(header.length);
    if (data.values[0] == "ascii") {
        records.encoding = Encoding::ascii;
        read_text(records, body, header, file, warnings);
        return records;
    }
    records.stride = stride;
    if (data.values[0] == "binary") {
        records.encoding = Encoding::binary;
        read_binary(records, body, file, warnings);
    } else if (data.values[0] == "binary_compressed") {
        records.encoding = Encoding::compressed;
        read_compressed(records, body, header.length, file, warnings);
    } else {
        throw Error(fmt::format("{}: DATA {}, expected ascii, binary or binary_compressed", at_line(file, data.number),
                                in_quotes(data.values[0])));
    }
    return records;
}

CloudShape pcd_shape(const FileBytes& file, std::vector<std::string>& warnings) {
    CloudShape shape;
    const fs::path& path = file.path();
    const std::string start = file.bytes(0, std::min<std::uint64_t>(file.size(), longest_pcd_header));
    const PcdHeader header = split_header(start, path);
    CloudRecords& records = shape.records;
    records.header = start.substr(0, header.length);
    records.fields = fields_of(header, path, records.stride);
    records.grid = grid_of(header, path);
    records.point_count = static_cast<std::size_t>(records.grid.width) * static_cast<std::size_t>(records.grid.height);
    const HeaderLine& data = required(header, "DATA", 1, path);
    if (data.values[0] != "binary") {
        shape.whole_since = fmt::format("its data are {}", data.values[0]);
        return shape;
    }
    records.viewpoint = viewpoint_of(header, path, warnings);
    records.encoding = Encoding::binary;
    shape.at = header.length;
    const std::uint64_t left = file.size() - shape.at, needed = std::uint64_t(records.point_count) * records.stride;
    check_length(left, needed, records, path);
    shape.end = shape.at + needed;
    if (left > needed)
        warnings.push_back(fmt::format("{}: {} after the last point; written back as they are.", path.string(),
                                       counted(left - needed, "byte")));
    return shape;
}

std::string pcd_bytes(const CloudRecords& records, std::string points, const std::vector<FieldAddition>& additions) {
    std::string result = header_with(records.header, additions);
    if (records.encoding != Encoding::compressed)
        return between(result, std::move(points), records.after);
    if (!records.packed.empty() && additions.empty() && points == records.points) // else LZF might pack them otherwise
        return result + records.packed + records.after;

    std::vector<CloudField> fields = records.fields;
    for (const FieldAddition& addition : additions)
        fields.push_back(
            {addition.name, Scalar::float32, 1, std::nullopt, fields.back().offset + fields.back().bytes()});
    const std::size_t stride = fields.back().offset + fields.back().bytes();
    return result + compressed(columns_from_rows(points, fields, stride, records.point_count)) + records.after;
}

} // namespace scanshade
