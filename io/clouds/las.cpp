// LAS (ASPRS, "LAS Specification 1.4 - R15") and LAZ: header and records checked, points kept as they are, AO as extra
// bytes.
#include "io/clouds/cloud_records.h"

#include "io/clouds/format.h"
#include "io/clouds/laz/copc.h"
#include "io/clouds/laz/laz.h"
#include "io/clouds/number_fields.h"
#include "io/file_bytes.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <map>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

// Offsets in the public header block.
constexpr std::size_t at_minor = 25, at_header_size = 94, at_points = 96, at_vlr_count = 100, at_format = 104,
                      at_length = 105, at_count = 107, at_scale = 131, at_shift = 155, at_box = 179, at_waveform = 227,
                      at_evlrs = 235, at_evlr_count = 243, at_count_64 = 247;
constexpr std::size_t least_header = 227, vlr_header = 54, descriptor_size = 192;
constexpr std::uint8_t format_mask = 0x3f, compressed_bit = 0x80; // of the byte at_format
constexpr std::uint64_t most_las_points = 0x7fffffff;             // points are numbered with 32 bits

template <class Number>
Number read_at(std::string_view bytes, std::size_t at) {
    std::array<char, sizeof(Number)> raw{};
    std::memcpy(raw.data(), bytes.data() + at, raw.size());
    return std::bit_cast<Number>(raw);
}

template <class Number>
void put(std::string& bytes, std::size_t at, Number value) {
    const auto raw = std::bit_cast<std::array<char, sizeof(Number)>>(value);
    std::copy(raw.begin(), raw.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
}

/// Text in a field of fixed width, padded with zeros.
std::string_view fixed_text(std::string_view bytes, std::size_t at, std::size_t width) {
    const std::string_view all = bytes.substr(at, width);
    return all.substr(0, all.find('\0'));
}

// --- fields ---

CloudField field(std::string name, Scalar type, std::size_t count = 1) {
    return {std::move(name), type, count, std::nullopt, 0};
}

void add(std::vector<CloudField>& fields, std::initializer_list<CloudField> more) { fields.insert(fields.end(), more); }

/// The fields of a record of point format 0 .. 10.
std::vector<CloudField> fields_of_format(int format) {
    std::vector<CloudField> fields{field("x", Scalar::int32), field("y", Scalar::int32), field("z", Scalar::int32),
                                   field("intensity", Scalar::uint16)};
    const bool colour = format == 2 || format == 3 || format == 5 || format == 7 || format == 8 || format == 10;
    const bool waveform = format == 4 || format == 5 || format == 9 || format == 10;
    if (format <= 5) {
        add(fields, {field("return_flags", Scalar::uint8), field("classification", Scalar::uint8),
                     field("scan_angle_rank", Scalar::int8), field("user_data", Scalar::uint8),
                     field("point_source_id", Scalar::uint16)});
        if (format != 0 && format != 2)
            add(fields, {field("gps_time", Scalar::float64)});
    } else {
        add(fields, {field("return_numbers", Scalar::uint8), field("return_flags", Scalar::uint8),
                     field("classification", Scalar::uint8), field("user_data", Scalar::uint8),
                     field("scan_angle", Scalar::int16), field("point_source_id", Scalar::uint16),
                     field("gps_time", Scalar::float64)});
    }
    if (colour)
        add(fields, {field("red", Scalar::uint16), field("green", Scalar::uint16), field("blue", Scalar::uint16)});
    if (format == 8 || format == 10)
        add(fields, {field("nir", Scalar::uint16)});
    if (waveform)
        add(fields, {field("wave_packet", Scalar::uint8, 29)});
    return fields;
}

std::size_t stride_of(const std::vector<CloudField>& fields) {
    std::size_t stride = 0;
    for (const CloudField& f : fields)
        stride += f.bytes();
    return stride;
}

/// One variable length record, by offsets in the file.
struct Vlr {
    std::string_view user, data;
    std::uint16_t id = 0;
    std::size_t begin = 0; ///< of its own header
};

std::vector<Vlr> vlrs_of(std::string_view header, std::size_t first, std::uint32_t count) {
    std::vector<Vlr> all;
    std::size_t at = first;
    for (std::uint32_t i = 0; i < count && at + vlr_header <= header.size(); ++i) {
        const std::size_t length = read_at<std::uint16_t>(header, at + 20);
        if (at + vlr_header + length > header.size())
            break;
        all.push_back({fixed_text(header, at + 2, 16), header.substr(at + vlr_header, length),
                       read_at<std::uint16_t>(header, at + 18), at});
        at += vlr_header + length;
    }
    return all;
}

bool names_extra_bytes(const Vlr& vlr) { return vlr.user == "LASF_Spec" && vlr.id == 4; }

/// Fields after the format's own, as far as a record describes them; the rest is one field of bytes. Returns the offset
/// in the header where the last valid description ends; 0 if there is no such record.
std::size_t add_extra_fields(std::vector<CloudField>& fields, const std::vector<Vlr>& vlrs, std::size_t record_length) {
    static constexpr std::array types{Scalar::uint8, Scalar::int8,   Scalar::uint16, Scalar::int16,   Scalar::uint32,
                                      Scalar::int32, Scalar::uint64, Scalar::int64,  Scalar::float32, Scalar::float64};
    std::size_t end = 0;
    bool sense = true;
    for (const Vlr& vlr : vlrs) {
        if (!names_extra_bytes(vlr) || !sense)
            continue;
        end = vlr.begin + vlr_header;
        for (std::size_t at = 0; at + descriptor_size <= vlr.data.size(); at += descriptor_size) {
            const auto type = read_at<std::uint8_t>(vlr.data, at + 2),
                       options = read_at<std::uint8_t>(vlr.data, at + 3);
            const std::string name(fixed_text(vlr.data, at + 4, 32));
            // 1 .. 10 are scalars, 11 .. 30 the same in twos and threes (withdrawn in 1.4 R14, but written), 0 raw
            // bytes.
            const std::size_t copies = type == 0 ? options : (type + 9U) / 10;
            CloudField extra = field(name, type == 0 || type > 30 ? Scalar::uint8 : types[(type - 1U) % 10], copies);
            sense = copies > 0 && type <= 30 && stride_of(fields) + extra.bytes() <= record_length;
            if (!sense)
                break;
            fields.push_back(std::move(extra));
            end = vlr.begin + vlr_header + at + descriptor_size;
        }
    }
    if (const std::size_t known = stride_of(fields); known < record_length)
        fields.push_back(field("undocumented", Scalar::uint8, record_length - known));
    return end;
}

// --- units ---

/// The unit of the coordinates, from GeoTIFF keys or well-known text; empty if the file does not say.
std::string unit_of(const std::vector<Vlr>& vlrs) {
    std::uint16_t linear = 0, model = 0;
    std::string_view text;
    for (const Vlr& vlr : vlrs) {
        if (vlr.user != "LASF_Projection")
            continue;
        if (vlr.id == 2112)
            text = vlr.data.substr(0, vlr.data.find('\0'));
        if (vlr.id == 34735)
            for (std::size_t at = 8; at + 8 <= vlr.data.size(); at += 8) {
                const auto key = read_at<std::uint16_t>(vlr.data, at), value = read_at<std::uint16_t>(vlr.data, at + 6);
                linear = key == 3076 ? value : linear;
                model = key == 1024 ? value : model;
            }
    }
    if (!text.empty()) {
        if (text.starts_with("GEOGCS") || text.starts_with("GEOGCRS"))
            return "degrees (well-known text)";
        // The last unit named is that of the projected coordinates; those before it belong to angles.
        const auto at = text.rfind("UNIT[\"");
        if (at != std::string_view::npos)
            return std::string(text.substr(at + 6, text.find('"', at + 6) - at - 6)) + " (well-known text)";
    }
    static const std::map<std::uint16_t, std::string> names{{9001, "metres"}, {9002, "feet"}, {9003, "US survey feet"}};
    if (model == 2)
        return "degrees (GeoTIFF keys)";
    const auto name = names.find(linear);
    return name == names.end() ? "" : name->second + " (GeoTIFF keys)";
}

// --- header ---

[[noreturn]] void refuse(const fs::path& file, const std::string& why) { throw Error(file.string() + ": " + why); }

void check_scales(CloudRecords& records, std::string_view bytes, const fs::path& file) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
        records.scale[axis] = read_at<double>(bytes, at_scale + 8 * axis);
        records.shift[axis] = read_at<double>(bytes, at_shift + 8 * axis);
        if (!std::isfinite(records.scale[axis]) || records.scale[axis] == 0)
            refuse(file, fmt::format("{} scale factor at byte {} is {}, expected a number other than 0", "xyz"[axis],
                                     at_scale + 8 * axis, records.scale[axis]));
        if (!std::isfinite(records.shift[axis]))
            refuse(file, fmt::format("{} offset at byte {} is {}, expected a number", "xyz"[axis], at_shift + 8 * axis,
                                     records.shift[axis]));
    }
}

/// The header's box is not used, but a wrong one is worth a warning.
void doubt_box(const CloudRecords& records, std::string_view header, const fs::path& file,
               std::vector<std::string>& warnings) {
    for (std::size_t axis = 0; axis < 3 && records.point_count > 0; ++axis) {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (std::size_t i = 0; i < records.point_count; ++i) {
            const double raw = read_at<std::int32_t>(records.points, i * records.stride + 4 * axis);
            low = std::min(low, raw), high = std::max(high, raw);
        }
        low = low * records.scale[axis] + records.shift[axis];
        high = high * records.scale[axis] + records.shift[axis];
        if (low > high)
            std::swap(low, high);
        const double said_high = read_at<double>(header, at_box + 16 * axis);
        const double said_low = read_at<double>(header, at_box + 16 * axis + 8);
        const double slack = std::max(2 * std::abs(records.scale[axis]), 1e-3 * (high - low));
        if (std::abs(said_low - low) <= slack && std::abs(said_high - high) <= slack)
            continue;
        warnings.push_back(
            fmt::format("{}: the header's box says {} is {} .. {}, the points lie in {} .. {}; the points "
                        "are believed.",
                        file.string(), "xyz"[axis], said_low, said_high, low, high));
        return;
    }
}

std::size_t point_count(std::string_view bytes, int minor) {
    const auto legacy = read_at<std::uint32_t>(bytes, at_count);
    if (minor < 4 || bytes.size() < at_count_64 + 8)
        return legacy;
    const auto count = read_at<std::uint64_t>(bytes, at_count_64);
    return count != 0 ? count : legacy;
}

} // namespace

namespace {

bool describes_laz(const Vlr& vlr) { return vlr.user == laz::record_user && vlr.id == laz::record_id; }
bool describes_octree(const Vlr& vlr) { return vlr.user == laz::octree_user && vlr.id == laz::octree_id; }

/// Where the block of points of a LAZ file ends at the latest.
std::uint64_t points_end(std::string_view header, std::uint64_t points_at, std::uint64_t end) {
    if (read_at<std::uint8_t>(header, at_minor) >= 4 && read_at<std::uint32_t>(header, at_evlr_count) > 0)
        if (const auto first = read_at<std::uint64_t>(header, at_evlrs); first >= points_at && first < end)
            return first;
    return end;
}

laz::Packing packing_of(const CloudRecords& records, const std::vector<Vlr>& vlrs) {
    if (const auto found = std::ranges::count_if(vlrs, describes_laz); found != 1)
        throw Error(fmt::format("LAZ with {} records that describe it (user id {}, {}), expected one",
                                static_cast<std::size_t>(found), laz::record_user, laz::record_id));
    const int format = read_at<std::uint8_t>(records.header, at_format) & format_mask;
    return laz::packing_of(std::ranges::find_if(vlrs, describes_laz)->data, format, records.stride);
}

/// The points of a LAZ file; returns where their block ends.
std::size_t unpack(CloudRecords& records, std::string_view bytes, std::size_t points_at, const std::vector<Vlr>& vlrs) {
    const laz::Packing packing = packing_of(records, vlrs);
    const std::size_t end = points_end(records.header, points_at, bytes.size());
    laz::Unpacked unpacked = laz::unpacked(bytes, points_at, end, records.point_count, packing);
    records.points = std::move(unpacked.points);
    records.octree = std::move(unpacked.chunks);
    records.packed = bytes.substr(points_at, unpacked.end - points_at);
    return unpacked.end;
}

} // namespace

namespace {

struct LasHead {
    CloudRecords records; ///< without the points
    bool compressed = false;
    std::uint64_t points_at = 0;
};

/// `start` is the file up to its points at least; `size` is that of the whole.
LasHead head_of(std::string_view start, std::uint64_t size, const fs::path& file, std::vector<std::string>& warnings) {
    if (start.size() < least_header)
        refuse(file, fmt::format("a LAS header of {} bytes expected, found {}", least_header, start.size()));
    const int minor = read_at<std::uint8_t>(start, at_minor);
    if (read_at<std::uint8_t>(start, at_minor - 1) != 1 || minor > 4)
        refuse(file, fmt::format("LAS version {}.{}, expected 1.0 .. 1.4", read_at<std::uint8_t>(start, at_minor - 1),
                                 minor));
    const std::size_t header_size = read_at<std::uint16_t>(start, at_header_size);
    const std::size_t needed = minor >= 4 ? 375 : minor == 3 ? 235 : least_header;
    if (header_size < needed || header_size > size)
        refuse(file,
               fmt::format("header size {} at byte {}, expected {} .. {}", header_size, at_header_size, needed, size));
    const int format_byte = read_at<std::uint8_t>(start, at_format), format = format_byte & format_mask;
    LasHead head;
    head.compressed = (format_byte & compressed_bit) != 0;
    if (format_byte & 0x40)
        refuse(file, fmt::format("early experimental LAZ (point format byte {}), which is not read; `laszip` of today "
                                 "rewrites it",
                                 format_byte));
    if (format > 10)
        refuse(file, fmt::format("point format {} at byte {}, expected 0 .. 10", format, at_format));
    head.points_at = read_at<std::uint32_t>(start, at_points);
    if (head.points_at < header_size || head.points_at > size)
        refuse(file, fmt::format("points are said to begin at byte {}, but the file has {} bytes and a header of {}",
                                 head.points_at, size, header_size));
    if (head.points_at > start.size())
        refuse(file, fmt::format("a header of {} bytes, {} expected at most", head.points_at, start.size()));
    CloudRecords& records = head.records;
    records.encoding = CloudRecords::Encoding::binary;
    records.header = start.substr(0, head.points_at);
    records.stride = read_at<std::uint16_t>(start, at_length);
    records.fields = fields_of_format(format);
    if (records.stride < stride_of(records.fields))
        refuse(file, fmt::format("record length {} at byte {}, but point format {} needs {}", records.stride, at_length,
                                 format, stride_of(records.fields)));
    const std::size_t count = point_count(start, minor), room = (size - head.points_at) / records.stride;
    if (count > room && !head.compressed)
        refuse(file,
               fmt::format("the header says {} points of {} bytes, the file holds {}", count, records.stride, room));
    if (count > most_las_points)
        refuse(file, fmt::format("{} points, at most {} are read", count, most_las_points));
    check_scales(records, start, file);

    const auto said_vlrs = read_at<std::uint32_t>(start, at_vlr_count);
    const auto vlrs = vlrs_of(records.header, header_size, said_vlrs);
    if (vlrs.size() != said_vlrs)
        warnings.push_back(fmt::format("{}: the header says {} variable length records, {} are there; they are kept as "
                                       "they are.",
                                       file.string(), said_vlrs, vlrs.size()));
    (void)add_extra_fields(records.fields, vlrs, records.stride);
    std::size_t offset = 0;
    for (CloudField& f : records.fields) {
        f.offset = offset;
        offset += f.bytes();
    }
    records.point_count = count;
    records.grid = {static_cast<int>(count), 1};
    const std::string unit = unit_of(vlrs);
    records.unit = unit.empty() ? "an unknown unit (the file names none)" : unit;
    if (unit.starts_with("degrees"))
        warnings.push_back(fmt::format("{}: coordinates are in {}: neither distances nor angles between points mean "
                                       "anything; project them first.",
                                       file.string(), unit));
    return head;
}

std::vector<Vlr> vlrs_of(const CloudRecords& records) {
    return vlrs_of(records.header, read_at<std::uint16_t>(records.header, at_header_size),
                   read_at<std::uint32_t>(records.header, at_vlr_count));
}

/// The extended records behind the points, by offsets in `after`, which begins at `after_at` in the file.
std::vector<Vlr> extended_of(std::string_view header, std::string_view after, std::uint64_t after_at) {
    constexpr std::size_t extended_header = 60;
    std::vector<Vlr> all;
    if (read_at<std::uint8_t>(header, at_minor) < 4)
        return all;
    const auto first = read_at<std::uint64_t>(header, at_evlrs);
    std::uint64_t at = first - after_at;
    for (auto left = read_at<std::uint32_t>(header, at_evlr_count); left > 0 && first >= after_at; --left) {
        if (at > after.size() || after.size() - at < extended_header)
            break;
        const auto length = read_at<std::uint64_t>(after, at + 20);
        if (length > after.size() - at - extended_header)
            break;
        all.push_back({fixed_text(after, at + 2, 16), after.substr(at + extended_header, length),
                       read_at<std::uint16_t>(after, at + 18), at});
        at += extended_header + length;
    }
    return all;
}

/// Where COPC keeps its octree: the first record, and the hierarchy behind the points. Throws Error where one is not
/// as COPC 1.0 wants it.
struct OctreePlace {
    std::size_t info = 0;      ///< of the record's body in the header
    std::size_t hierarchy = 0; ///< of the extended record's body in `after`
    std::size_t size = 0;
};
OctreePlace octree_place(std::string_view header, std::string_view after, std::uint64_t after_at) {
    constexpr std::size_t first = 375; // the end of a header of LAS 1.4
    const auto vlrs = vlrs_of(header, first, 1);
    if (read_at<std::uint16_t>(header, at_header_size) != first || vlrs.empty() || !describes_octree(vlrs[0]) ||
        vlrs[0].data.size() != laz::octree_info_size)
        throw Error(fmt::format("its record of {} bytes is not the first, at byte {}", laz::octree_info_size, first));
    if (const int format = read_at<std::uint8_t>(header, at_format) & format_mask; format < 6)
        throw Error(fmt::format("point format {}, expected 6 .. 8", format));
    for (const Vlr& vlr : extended_of(header, after, after_at))
        if (vlr.user == laz::octree_user && vlr.id == laz::hierarchy_id)
            return {first + vlr_header, static_cast<std::size_t>(vlr.data.data() - after.data()), vlr.data.size()};
    throw Error("no hierarchy is among the records behind the points");
}

/// Keeps the chunks as COPC's octree where they are one, and says so where they only should be.
void take_octree(CloudRecords& records, std::vector<laz::Chunk> chunks, std::uint64_t after_at, const fs::path& file,
                 std::vector<std::string>& warnings) {
    records.octree.clear();
    const auto vlrs = vlrs_of(records);
    if (std::ranges::none_of(vlrs, describes_octree)) {
        if (plain_laz_name(file.stem().string()) != file.stem().string())
            warnings.push_back(file.string() + ": the name says COPC, but the file is plain LAZ; so is the one with "
                                               "fields added, under another name.");
        return;
    }
    try {
        const OctreePlace place = octree_place(records.header, records.after, after_at);
        check_octree(records.header.substr(place.info, laz::octree_info_size),
                     {records.after.substr(place.hierarchy, place.size), after_at + place.hierarchy}, chunks);
        records.octree = std::move(chunks);
    } catch (const Error& failure) {
        records.octree_damage = failure.what();
    }
}

} // namespace

void settle_octree(CloudRecords& records, bool copc) {
    if (copc && !records.octree_damage.empty())
        throw Error("the octree of this COPC is damaged: " + records.octree_damage +
                    "; --copc no reads the points as LAZ has them");
    if (!copc)
        records.octree.clear();
}

CloudRecords read_las(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    auto [records, compressed, points_at] = head_of(bytes, bytes.size(), file, warnings);
    const auto vlrs = vlrs_of(records);
    std::size_t end = points_at + records.point_count * records.stride;
    if (compressed) {
        records.encoding = CloudRecords::Encoding::compressed;
        during(file.string(), [&, at = points_at, &to = records] { end = unpack(to, bytes, at, vlrs); });
    } else {
        records.points = bytes.substr(points_at, records.point_count * records.stride);
    }
    records.after = bytes.substr(end);
    if (compressed)
        take_octree(records, std::move(records.octree), end, file, warnings);
    doubt_box(records, records.header, file, warnings);
    return std::move(records);
}

namespace {

/// The chunks of a LAZ file, and what follows them, which is short.
void find_chunks(CloudShape& shape, const FileBytes& file) {
    constexpr std::uint64_t most_after = 64 << 20, largest_chunk = 4 << 20; // points
    CloudRecords& records = shape.records;
    records.encoding = CloudRecords::Encoding::compressed;
    const auto vlrs = vlrs_of(records);
    std::uint64_t end = points_end(records.header, shape.at, file.size());
    const laz::Packing packing = packing_of(records, vlrs);
    if (packing.compressor == 1) {
        shape.whole_since = "it is compressed without chunks";
        return;
    }
    shape.chunks = laz::chunks_of([&](std::uint64_t at, std::uint64_t count) { return file.bytes(at, count); },
                                  file.size(), shape.at, end, records.point_count, packing);
    shape.packing = packing;
    shape.end = end;
    if (std::ranges::any_of(shape.chunks, [](const laz::Chunk& chunk) { return chunk.count > largest_chunk; }))
        shape.whole_since = "its compressed chunks are large";
    else if (file.size() - end > most_after)
        shape.whole_since = "long records follow its compressed points";
    else
        records.after = file.bytes(end, file.size() - end);
}

} // namespace

CloudShape las_shape(const FileBytes& file, std::vector<std::string>& warnings) {
    constexpr std::uint64_t longest_header = 64 << 20;
    const std::string start = file.bytes(0, std::min<std::uint64_t>(file.size(), longest_header));
    LasHead head = head_of(start, file.size(), file.path(), warnings);
    CloudShape shape;
    shape.records = std::move(head.records);
    shape.at = head.points_at;
    shape.end = shape.at + std::uint64_t(shape.records.point_count) * shape.records.stride;
    Eigen::AlignedBox3d box;
    for (int axis = 0; axis < 3; ++axis) {
        const std::size_t at = at_box + 16 * static_cast<std::size_t>(axis);
        box.max()[axis] = read_at<double>(start, at), box.min()[axis] = read_at<double>(start, at + 8);
    }
    if (box.min().allFinite() && box.max().allFinite() && !box.isEmpty())
        shape.box = box;
    for (const Vlr& vlr : vlrs_of(shape.records))
        if (vlr.user == "LASF_Projection")
            shape.reference += vlr.data;
    if (head.compressed)
        during(file.path().string(), [&] { find_chunks(shape, file); });
    if (head.compressed && shape.whole_since.empty())
        take_octree(shape.records, shape.chunks, shape.end, file.path(), warnings);
    return shape;
}

LasScale las_scale(const CloudRecords& records, std::string_view name) {
    constexpr std::uint8_t has_factor = 8, has_offset = 16; // table 24
    LasScale found;
    for (const Vlr& vlr : vlrs_of(records))
        for (std::size_t at = 0; names_extra_bytes(vlr) && at + descriptor_size <= vlr.data.size();
             at += descriptor_size) {
            const auto type = read_at<std::uint8_t>(vlr.data, at + 2),
                       options = read_at<std::uint8_t>(vlr.data, at + 3);
            if (type == 0 || fixed_text(vlr.data, at + 4, 32) != name)
                continue; // of raw bytes, the options are their number
            if ((options & has_factor) != 0)
                found.factor = read_at<double>(vlr.data, at + 112);
            if ((options & has_offset) != 0)
                found.offset = read_at<double>(vlr.data, at + 136);
        }
    return found;
}

namespace {

/// A float, as an extra bytes record describes it.
std::string descriptor(const std::string& name) {
    constexpr char float32 = 9;
    std::string bytes(descriptor_size, '\0');
    bytes[2] = float32;
    name.copy(bytes.data() + 4, 31);
    std::string_view("scanshade").copy(bytes.data() + 160, 31);
    return bytes;
}

/// Describes extra bytes that have no description, so that ours come after them.
std::string descriptors_of_raw_bytes(std::size_t count) {
    constexpr std::size_t most = 255; // the number is a byte
    std::string all;
    for (; count > 0; count -= std::min(count, most)) {
        std::string bytes(descriptor_size, '\0');
        bytes[3] = static_cast<char>(std::min(count, most));
        std::string_view("undocumented").copy(bytes.data() + 4, 31);
        all += bytes;
    }
    return all;
}

/// Adds the descriptors to the record that describes extra bytes, after its valid ones, or makes a new record after the
/// last one.
void describe_extra_bytes(std::string& header, const std::string& descriptors, std::size_t stride) {
    const std::size_t first = read_at<std::uint16_t>(header, at_header_size);
    const auto count = read_at<std::uint32_t>(header, at_vlr_count);
    const std::string copy = header;
    const auto vlrs = vlrs_of(copy, first, count);
    auto fields = fields_of_format(read_at<std::uint8_t>(header, at_format) & format_mask);
    const std::size_t place = add_extra_fields(fields, vlrs, stride);
    for (const Vlr& vlr : vlrs) {
        const std::size_t begin = vlr.begin + vlr_header;
        if (place < begin || place > begin + vlr.data.size() || !names_extra_bytes(vlr))
            continue;
        const std::size_t length = vlr.data.size() + descriptors.size();
        if (length > 0xffff)
            throw Error("the LAS file describes more extra bytes than one record can hold");
        header.insert(place, descriptors);
        put(header, vlr.begin + 20, static_cast<std::uint16_t>(length));
        return;
    }
    if (descriptors.size() > 0xffff)
        throw Error("the LAS file has more extra bytes than one record can describe");
    std::string record(vlr_header, '\0');
    std::string_view("LASF_Spec").copy(record.data() + 2, 16);
    put(record, 18, std::uint16_t(4));
    put(record, 20, static_cast<std::uint16_t>(descriptors.size()));
    std::string_view("Extra bytes").copy(record.data() + 22, 32);
    record += descriptors;
    const std::size_t end = vlrs.empty() ? first : vlrs.back().begin + vlr_header + vlrs.back().data.size();
    header.insert(end, record);
    put(header, at_vlr_count, static_cast<std::uint32_t>(vlrs.size() + 1));
}

} // namespace

namespace {

/// Puts other data in place of a record's.
void replace_data(std::string& header, const Vlr& vlr, const std::string& data) {
    header.replace(vlr.begin + vlr_header, vlr.data.size(), data);
    put(header, vlr.begin + 20, static_cast<std::uint16_t>(data.size()));
}

/// The record that describes LAZ follows the longer records. An octree that is not kept points into the old chunks,
/// and goes.
laz::Packing describe_packing(std::string& header, std::size_t length, bool keeps_octree) {
    const std::size_t first = read_at<std::uint16_t>(header, at_header_size);
    auto packing = laz::usual_packing(read_at<std::uint8_t>(header, at_format) & format_mask, length);
    if (keeps_octree)
        packing.chunk_points = laz::varying_chunks;
    const auto count = read_at<std::uint32_t>(header, at_vlr_count);
    std::string copy = header;
    for (const Vlr& vlr : vlrs_of(copy, first, count))
        if (describes_laz(vlr))
            replace_data(header, vlr, laz::described(packing));
    copy = header;
    for (const Vlr& vlr : vlrs_of(copy, first, count))
        if (describes_octree(vlr) && !keeps_octree) {
            header.erase(vlr.begin, vlr_header + vlr.data.size());
            put(header, at_vlr_count, count - 1);
            break; // it has one, and it is the first
        }
    return packing;
}

/// Without the hierarchy of COPC among the records behind the points.
std::string without_octree(std::string& header, std::string after, std::size_t block_end) {
    const std::string copy = after;
    auto extended = extended_of(header, copy, block_end);
    std::ranges::reverse(extended);
    for (const Vlr& vlr : extended)
        if (vlr.user == laz::octree_user) {
            const auto end = static_cast<std::size_t>(vlr.data.data() - copy.data()) + vlr.data.size();
            after.erase(vlr.begin, end - vlr.begin);
            put(header, at_evlr_count, read_at<std::uint32_t>(header, at_evlr_count) - 1);
        }
    return after;
}

} // namespace

namespace {

/// The header with the additions described, and the new length of a record.
std::string described_header(const CloudRecords& records, const std::vector<FieldAddition>& additions) {
    std::string header = records.header;
    const std::size_t length = records.stride + additions.size() * sizeof(float);
    if (length > 0xffff)
        throw Error("a LAS point record cannot grow beyond 65535 bytes");
    if (!additions.empty()) {
        std::string descriptors;
        const bool described = records.fields.back().name != "undocumented";
        if (!described)
            descriptors += descriptors_of_raw_bytes(records.fields.back().count);
        for (const FieldAddition& addition : additions)
            descriptors += descriptor(addition.name);
        describe_extra_bytes(header, descriptors, records.stride);
    }
    put(header, at_length, static_cast<std::uint16_t>(length));
    return header;
}

/// Offsets that follow the points, which ended at `old_end`, and now end at `end`.
void shift_offsets(std::string& header, std::uint64_t old_end, std::uint64_t end) {
    const int minor = read_at<std::uint8_t>(header, at_minor);
    const auto shift = [&](std::size_t at) {
        if (const auto place = read_at<std::uint64_t>(header, at); place >= old_end)
            put(header, at, place - old_end + end);
    };
    if (minor >= 3)
        shift(at_waveform);
    if (minor >= 4 && read_at<std::uint32_t>(header, at_evlr_count) > 0)
        shift(at_evlrs);
}

} // namespace

std::string las_head(const CloudRecords& records, const std::vector<FieldAddition>& additions, std::uint64_t old_end) {
    if (additions.empty())
        return records.header;
    std::string header = described_header(records, additions);
    put(header, at_points, static_cast<std::uint32_t>(header.size()));
    const std::uint64_t length = read_at<std::uint16_t>(header, at_length);
    shift_offsets(header, old_end, header.size() + length * records.point_count);
    return header;
}

LazHead laz_head(const CloudRecords& records, const std::vector<FieldAddition>& additions, std::uint64_t old_end) {
    LazHead head{described_header(records, additions), records.after, {}, old_end, records.octree};
    const bool keeps_octree = !records.octree.empty();
    head.packing = describe_packing(head.header, read_at<std::uint16_t>(head.header, at_length), keeps_octree);
    if (!keeps_octree)
        head.after = without_octree(head.header, std::move(head.after), old_end);
    put(head.header, at_points, static_cast<std::uint32_t>(head.header.size()));
    return head;
}

laz::Packer packer_of(const LazHead& head) {
    std::vector<std::uint32_t> counts;
    for (const laz::Chunk& chunk : head.octree)
        counts.push_back(static_cast<std::uint32_t>(chunk.count));
    return laz::Packer(head.packing, std::move(counts));
}

void finish(LazHead& head, const laz::Packer& packer) {
    const std::uint64_t begin = head.header.size(), end = begin + packer.size();
    if (!head.octree.empty()) {
        const OctreePlace place = octree_place(head.header, head.after, head.old_end);
        std::string info = head.header.substr(place.info, laz::octree_info_size);
        laz::Hierarchy hierarchy{head.after.substr(place.hierarchy, place.size), head.old_end + place.hierarchy};
        move_octree(info, hierarchy, end + place.hierarchy, head.octree, packer.chunks(begin));
        head.header.replace(place.info, info.size(), info);
        head.after.replace(place.hierarchy, place.size, hierarchy.pages);
    }
    shift_offsets(head.header, head.old_end, end);
}

std::string las_bytes(const CloudRecords& records, std::string points, const std::vector<FieldAddition>& additions) {
    const bool compressed = records.encoding == CloudRecords::Encoding::compressed;
    if (compressed && additions.empty() && points == records.points && records.octree_damage.empty())
        return between(records.header, records.packed, records.after);
    if (!compressed && additions.empty())
        return between(records.header, std::move(points), records.after);
    if (!compressed)
        return las_head(records, additions, records.header.size() + records.stride * records.point_count) + points +
               records.after;
    LazHead head = laz_head(records, additions, records.header.size() + records.packed.size());
    laz::Packer packer = packer_of(head);
    points = laz::packed(points, head.header.size(), packer);
    finish(head, packer);
    return head.header + points + head.after;
}

} // namespace scanshade
