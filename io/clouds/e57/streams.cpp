// Packets to streams, streams to values.
#include "io/clouds/e57/e57.h"

#include "projection/base/error.h"

#include <array>
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace scanshade::e57 {

namespace {

template <class Number>
Number read_at(std::string_view bytes, std::size_t at) {
    Number number;
    std::memcpy(&number, bytes.data() + at, sizeof number);
    return number;
}

/// An offset in the file with pages as one in its contents.
std::uint64_t in_contents(std::uint64_t offset, std::uint64_t room, const char* what) {
    const std::uint64_t place = offset / 1024 * 1020 + offset % 1024;
    if (offset % 1024 >= 1020 || place >= room)
        throw Error(fmt::format("{} at byte {}, which is no place in the file", what, offset));
    return place;
}

struct Packet {
    std::size_t begin = 0, streams = 0;
};

/// The data packets of a section, with their lengths checked.
std::vector<Packet> packets_of(std::string_view contents, const Scan& scan) {
    const std::uint64_t section = in_contents(scan.section, contents.size(), "the points");
    if (contents.size() - section < 32)
        throw Error(fmt::format("the points at byte {} end with the file", scan.section));
    const auto id = read_at<std::uint8_t>(contents, section);
    const auto length = read_at<std::uint64_t>(contents, section + 8);
    if (id != 1 || length < 32 || length > contents.size() - section || length % 4 != 0)
        throw Error(fmt::format("section of kind {} and {} bytes at byte {}, expected kind 1 within the file", id,
                                length, scan.section));
    std::uint64_t at = in_contents(read_at<std::uint64_t>(contents, section + 16), contents.size(), "the first packet");
    const std::uint64_t end = section + length;
    if (at < section + 32 || at > end)
        throw Error(fmt::format("the first packet lies outside of its section at byte {}", scan.section));
    std::vector<Packet> packets;
    while (at < end) {
        if (end - at < 4)
            throw Error(fmt::format("{} bytes behind the last packet", end - at));
        const auto type = read_at<std::uint8_t>(contents, at);
        const std::size_t size = read_at<std::uint16_t>(contents, at + 2) + std::size_t(1);
        const std::uint64_t place = at / 1020 * 1024 + at % 1020;
        if (type > 2 || size % 4 != 0 || size > end - at)
            throw Error(
                fmt::format("packet of kind {} and {} bytes at byte {}, {} are left", type, size, place, end - at));
        if (type == 1) {
            const std::size_t streams = size < 6 ? 0 : read_at<std::uint16_t>(contents, at + 4);
            if (streams != scan.fields.size())
                throw Error(fmt::format("packet of {} streams at byte {}, the scan has {} fields", streams, place,
                                        scan.fields.size()));
            std::size_t sum = 6 + 2 * streams;
            for (std::size_t i = 0; i < streams && sum <= size; ++i)
                sum += 6 + 2 * (i + 1) <= size ? read_at<std::uint16_t>(contents, at + 6 + 2 * i) : size + 1;
            if (sum > size)
                throw Error(
                    fmt::format("the streams of the packet at byte {} have {} bytes, it has {}", place, sum, size));
            packets.push_back({at, streams});
        }
        at += size;
    }
    return packets;
}

} // namespace

std::vector<std::string> streams_of(std::string_view contents, const Scan& scan) {
    std::vector<std::string> streams(scan.fields.size());
    if (scan.count == 0)
        return streams; // what stands there then need not be a section
    const std::vector<Packet> packets = packets_of(contents, scan);
    for (const Packet& packet : packets) {
        std::size_t at = packet.begin + 6 + 2 * packet.streams;
        for (std::size_t i = 0; i < packet.streams; ++i) {
            const std::size_t size = read_at<std::uint16_t>(contents, packet.begin + 6 + 2 * i);
            streams[i] += contents.substr(at, size);
            at += size;
        }
    }
    for (std::size_t i = 0; i < streams.size(); ++i)
        if (const std::uint64_t bits = scan.fields[i].bits(); bits > 0 && streams[i].size() * 8 / bits < scan.count)
            throw Error(fmt::format("{} holds {} values, {} records are said to be there", scan.fields[i].name,
                                    streams[i].size() * 8 / bits, scan.count));
    return streams;
}

void for_each_value(const Field& field, std::string_view stream, std::uint64_t count,
                    const std::function<void(std::size_t, double)>& take) {
    const unsigned bits = field.bits();
    const std::uint64_t range = static_cast<std::uint64_t>(field.maximum) - static_cast<std::uint64_t>(field.minimum);
    const auto stored = [&](std::size_t index) -> std::uint64_t {
        if (bits == 0)
            return 0;
        const std::uint64_t first = std::uint64_t(index) * bits;
        const std::size_t at = first / 8, shift = first % 8;
        // Nine bytes hold any value.
        std::array<char, 16> around{};
        stream.substr(at).copy(around.data(), 9);
        std::uint64_t low = 0;
        std::memcpy(&low, around.data(), 8);
        std::uint64_t value = low >> shift;
        if (shift > 0)
            value |= std::uint64_t(static_cast<unsigned char>(around[8])) << (64 - shift);
        return bits == 64 ? value : value & ((std::uint64_t(1) << bits) - 1);
    };
    const auto value_of = [&](std::size_t index) {
        const std::uint64_t raw = stored(index);
        if (field.kind == Field::Kind::single_float)
            return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
        if (field.kind == Field::Kind::double_float)
            return std::bit_cast<double>(raw);
        if (raw > range)
            throw Error(
                fmt::format("{} of point {} is {} above its minimum, its range is {}", field.name, index, raw, range));
        const auto whole =
            static_cast<double>(static_cast<std::int64_t>(static_cast<std::uint64_t>(field.minimum) + raw));
        return field.kind == Field::Kind::integer ? whole : whole * field.scale + field.shift;
    };
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1 << 14), [&](const auto& points) {
        for (std::size_t i = points.begin(); i < points.end(); ++i)
            take(i, value_of(i));
    });
}

} // namespace scanshade::e57
