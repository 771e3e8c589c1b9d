// Finding, reading and replacing fields in a cloud file's records, whatever their encoding.
#include "io/clouds/cloud_records.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <tbb/parallel_for.h>

namespace scanshade {

static_assert(std::endian::native == std::endian::little, "byte orders here are written for little-endian machines");

std::size_t size_of(Scalar type) {
    switch (type) {
    case Scalar::int8:
    case Scalar::uint8:
        return 1;
    case Scalar::int16:
    case Scalar::uint16:
        return 2;
    case Scalar::int32:
    case Scalar::uint32:
    case Scalar::float32:
        return 4;
    case Scalar::int64:
    case Scalar::uint64:
    case Scalar::float64:
        break;
    }
    return 8;
}

std::string_view CloudRecords::record(std::size_t index) const {
    const std::string_view all = points;
    if (stride != 0)
        return all.substr(index * stride, stride);
    const std::size_t start = index == 0 ? 0 : ends[index - 1];
    return all.substr(start, ends[index] - start);
}

std::optional<std::size_t> CloudRecords::field_named(std::string_view name) const {
    for (std::size_t i = 0; i < fields.size(); ++i)
        if (fields[i].name == name && !fields[i].list_length)
            return i;
    for (std::size_t i = 0; i < fields.size(); ++i)
        if (is_named(fields[i], name) && !fields[i].list_length)
            return i;
    return std::nullopt;
}

namespace {

/// Reads a `Number` in either byte order.
template <class Number>
Number raw(const char* from, bool big_endian) {
    std::array<char, sizeof(Number)> bytes{};
    std::memcpy(bytes.data(), from, bytes.size());
    if (big_endian)
        std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<Number>(bytes);
}

template <class Number>
std::string raw_bytes(Number value, bool big_endian) {
    auto bytes = std::bit_cast<std::array<char, sizeof(Number)>>(value);
    if (big_endian)
        std::reverse(bytes.begin(), bytes.end());
    return {bytes.data(), bytes.size()};
}

/// Calls `action` with a value of the C++ type that `type` stands for.
template <class Action>
decltype(auto) with_type(Scalar type, Action&& action) {
    switch (type) {
    case Scalar::int8: // NOLINT(bugprone-branch-clone): clang-tidy 14 takes the types of a template for one
        return action(std::int8_t());
    case Scalar::uint8:
        return action(std::uint8_t());
    case Scalar::int16:
        return action(std::int16_t());
    case Scalar::uint16:
        return action(std::uint16_t());
    case Scalar::int32:
        return action(std::int32_t());
    case Scalar::uint32:
        return action(std::uint32_t());
    case Scalar::int64:
        return action(std::int64_t());
    case Scalar::uint64:
        return action(std::uint64_t());
    case Scalar::float32:
        return action(float());
    case Scalar::float64:
        break;
    }
    return action(double());
}

/// Rounded and clamped to the type's range; integers have no NaN and get 0.
template <class Number>
Number nearest(double value) {
    if constexpr (std::is_floating_point_v<Number>)
        return static_cast<Number>(value);
    if (std::isnan(value))
        return 0;
    constexpr auto low = static_cast<double>(std::numeric_limits<Number>::lowest());
    constexpr auto high = static_cast<double>(std::numeric_limits<Number>::max());
    const double rounded = std::round(value);
    return rounded <= low    ? std::numeric_limits<Number>::lowest()
           : rounded >= high ? std::numeric_limits<Number>::max()
                             : static_cast<Number>(rounded);
}

std::size_t list_size(std::string_view word_or_bytes, bool text, Scalar type, bool big_endian) {
    const double count = text ? number(word_or_bytes).value_or(0) : decoded(word_or_bytes.data(), type, big_endian);
    return count > 0 ? static_cast<std::size_t>(count) : 0; // the readers have checked it
}

FieldPlace locate_words(const CloudRecords& records, std::string_view record, std::size_t field) {
    const auto all = words(record);
    std::size_t first = 0;
    for (std::size_t i = 0;; ++i) {
        const CloudField& f = records.fields[i];
        const std::size_t length = f.list_length ? 1 + list_size(all[first], true, *f.list_length, false) : f.count;
        if (i == field) {
            const auto start = static_cast<std::size_t>(all[first].data() - record.data());
            const std::string_view last = all[first + length - 1];
            return {start, static_cast<std::size_t>(last.data() - record.data()) + last.size() - start};
        }
        first += length;
    }
}

FieldPlace locate_bytes(const CloudRecords& records, std::string_view record, std::size_t field) {
    const bool big_endian = records.encoding == CloudRecords::Encoding::big_endian;
    std::size_t offset = 0;
    for (std::size_t i = 0;; ++i) {
        const CloudField& f = records.fields[i];
        std::size_t length = f.bytes();
        if (f.list_length)
            length = size_of(*f.list_length) +
                     size_of(f.type) * list_size(record.substr(offset), false, *f.list_length, big_endian);
        if (i == field)
            return {offset, length};
        offset += length;
    }
}

} // namespace

FieldPlace locate(const CloudRecords& records, std::string_view record, std::size_t field) {
    if (records.stride != 0)
        return {records.fields[field].offset, records.fields[field].bytes()};
    return records.text() ? locate_words(records, record, field) : locate_bytes(records, record, field);
}

double decoded(const char* from, Scalar type, bool big_endian) {
    return with_type(type, [&](auto zero) { return static_cast<double>(raw<decltype(zero)>(from, big_endian)); });
}

double value_at(const CloudRecords& records, std::string_view record, std::size_t field) {
    const FieldPlace place = locate(records, record, field);
    if (records.text()) {
        const auto value = number(words(record.substr(place.offset, place.length)).front());
        return value.value_or(std::numeric_limits<double>::quiet_NaN());
    }
    return decoded(record.data() + place.offset, records.fields[field].type,
                   records.encoding == CloudRecords::Encoding::big_endian);
}

std::string encoded(const CloudRecords& records, Scalar type, double value) {
    return with_type(type, [&](auto zero) {
        const auto exact = nearest<decltype(zero)>(value);
        // fmt's "{}" is the shortest text that reads back as the same bits; the + makes characters of bytes numbers.
        if (records.text())
            return fmt::format("{}", +exact);
        return raw_bytes(exact, records.encoding == CloudRecords::Encoding::big_endian);
    });
}

bool is_named(const CloudField& field, std::string_view name) {
    return std::ranges::equal(
        field.name, name, {}, [](unsigned char c) { return std::tolower(c); },
        [](unsigned char c) { return std::tolower(c); });
}

ColourFields colour_fields(const CloudRecords& records) {
    ColourFields found;
    for (const auto* name : {"rgba", "rgb"}) {
        const auto field = records.field_named(name);
        if (!field)
            continue;
        const CloudField& f = records.fields[*field];
        if (f.count == 1 && !f.list_length && (records.text() || size_of(f.type) == 4))
            found.packed = field;
    }
    // The last that are there count; "Rf" are CloudCompare's fractions.
    constexpr std::array<std::array<const char*, 3>, 9> names{{{"b8", "g8", "r8"},
                                                               {"scalar_blue", "scalar_green", "scalar_red"},
                                                               {"col_b", "col_g", "col_r"},
                                                               {"colorb", "colorg", "colorr"},
                                                               {"color_b", "color_g", "color_r"},
                                                               {"bf", "gf", "rf"},
                                                               {"b", "g", "r"},
                                                               {"diffuse_blue", "diffuse_green", "diffuse_red"},
                                                               {"blue", "green", "red"}}};
    for (const auto& [b, g, r] : names) {
        const auto blue = records.field_named(b), green = records.field_named(g), red = records.field_named(r);
        const auto is_number = [&](const std::optional<std::size_t>& i) {
            return i && records.fields[*i].count == 1 && !records.fields[*i].list_length;
        };
        if (is_number(blue) && is_number(green) && is_number(red))
            found.bgr = {*blue, *green, *red};
    }
    return found;
}

std::uint32_t packed_bits(const CloudRecords& records, std::string_view record, std::size_t field) {
    const FieldPlace place = locate(records, record, field);
    const bool floats = records.fields[field].type == Scalar::float32;
    if (!records.text())
        return raw<std::uint32_t>(record.data() + place.offset, records.encoding == CloudRecords::Encoding::big_endian);
    const double value = value_at(records, record, field);
    if (std::isnan(value))
        return 0;                     // a NaN's text has lost its bits
    constexpr double full = 0xffffff; // no packed colour as a float is as large as one: these are written as numbers
    if (floats && !(value >= 1 && value <= full))
        return std::bit_cast<std::uint32_t>(static_cast<float>(value));
    return value < 0 ? static_cast<std::uint32_t>(nearest<std::int32_t>(value)) : nearest<std::uint32_t>(value);
}

std::string encoded_bits(const CloudRecords& records, Scalar type, std::uint32_t bits) {
    if (!records.text())
        return raw_bytes(bits, records.encoding == CloudRecords::Encoding::big_endian);
    if (type == Scalar::int32)
        return fmt::format("{}", static_cast<std::int32_t>(bits));
    if (type != Scalar::float32)
        return fmt::format("{}", bits);
    constexpr std::uint32_t colour_only = 0x00ffffff;
    const bool text_loses_it = !std::isfinite(std::bit_cast<float>(bits));
    return fmt::format("{}", std::bit_cast<float>(text_loses_it ? bits & colour_only : bits));
}

namespace {

/// A record with replacements and additions made, behind `result`.
void append_edited(std::string& result, const CloudRecords& records, std::size_t point,
                   const std::vector<FieldReplacement>& replacements, const std::vector<FieldAddition>& additions) {
    const bool big_endian = records.encoding == CloudRecords::Encoding::big_endian;
    const std::string_view record = records.record(point);
    if (const auto found = records.inserted.find(point); found != records.inserted.end())
        result += found->second;
    std::size_t copied = 0;
    for (const FieldReplacement& replacement : replacements) {
        const FieldPlace place = locate(records, record, replacement.field);
        result += record.substr(copied, place.offset - copied);
        result += replacement.content(point, record);
        copied = place.offset + place.length;
    }
    result += record.substr(copied);
    for (const FieldAddition& addition : additions) {
        const float value = addition.values[point];
        if (addition.type != Scalar::float32)
            result += (records.text() ? " " : "") + encoded(records, addition.type, static_cast<double>(value));
        else if (records.text())
            fmt::format_to(std::back_inserter(result), " {}", value);
        else
            result += raw_bytes(value, big_endian);
    }
}

} // namespace

std::string edited_points(const CloudRecords& records, const std::vector<FieldReplacement>& replacements,
                          const std::vector<FieldAddition>& additions) {
    constexpr std::size_t at_once = 1 << 14;
    const std::size_t blocks = (records.point_count + at_once - 1) / at_once;
    const std::size_t spare = records.header.size() + records.before.size() + records.after.size() + 4096;
    std::string result; // with room for what stands round the points: see between()
    result.reserve(records.points.size() + spare +
                   records.point_count * additions.size() * (records.text() ? 12 : sizeof(float)));
    // A few blocks at once, so that hardly any memory is needed besides the result.
    constexpr std::size_t row = 64;
    std::vector<std::string> parts(std::min(blocks, row));
    for (std::size_t first = 0; first < blocks; first += row) {
        const std::size_t count = std::min(row, blocks - first);
        tbb::parallel_for(std::size_t(0), count, [&](std::size_t k) {
            const std::size_t begin = (first + k) * at_once, end = std::min(begin + at_once, records.point_count);
            parts[k].clear();
            for (std::size_t point = begin; point < end; ++point)
                append_edited(parts[k], records, point, replacements, additions);
        });
        for (std::size_t k = 0; k < count; ++k)
            result += parts[k];
    }
    return result;
}

std::string between(std::string_view header, std::string points, std::string_view after) {
    points.insert(0, header);
    points += after;
    return points;
}

void check_point_count(std::uint64_t count, const std::filesystem::path& file) {
    constexpr std::uint64_t most_points = 0x7fffffff; // points are numbered with 32 bits
    if (count > most_points)
        throw Error(fmt::format("{}: {} points, at most {} are read", file.string(), count, most_points));
}

bool TextRecords::next() {
    while (at_ < body_.size()) {
        const std::size_t end = std::min(body_.find('\n', at_), body_.size());
        words_ = scanshade::words(body_.substr(at_, end - at_));
        at_ = std::min(end + 1, body_.size());
        ++line_;
        if (words_.empty())
            continue;
        end_ = static_cast<std::size_t>(words_.back().data() + words_.back().size() - body_.data());
        return true;
    }
    return false;
}

} // namespace scanshade
