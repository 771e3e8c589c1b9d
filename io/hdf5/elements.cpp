// A data set's elements: chunks unpacked and put in rows.
#include "io/checksum.h"
#include "io/compression/inflate.h"
#include "io/hdf5/hdf5.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>

namespace scanshade {

namespace {

template <class Number>
Number loaded(const char* from, bool big_endian) {
    std::array<char, sizeof(Number)> bytes;
    std::memcpy(bytes.data(), from, sizeof(Number));
    if (big_endian)
        std::ranges::reverse(bytes);
    return std::bit_cast<Number>(bytes);
}

double half_at(const char* from, bool big_endian) {
    const auto bits = loaded<std::uint16_t>(from, big_endian);
    const int exponent = bits >> 10 & 31, mantissa = bits & 1023;
    constexpr int all_ones = 31, bias = 15, mantissa_bits = 10;
    const double sign = bits >> 15 != 0 ? -1 : 1;
    if (exponent == all_ones)
        return mantissa == 0 ? sign * std::numeric_limits<double>::infinity()
                             : std::numeric_limits<double>::quiet_NaN();
    if (exponent == 0)
        return sign * std::ldexp(mantissa, 1 - bias - mantissa_bits);
    return sign * std::ldexp(1024 + mantissa, exponent - bias - mantissa_bits);
}

/// Shuffled bytes are the first of each element, then the second ones, and so on; a rest stays as it is.
std::string unshuffled(const std::string& bytes, std::size_t element) {
    std::string straight = bytes;
    const std::size_t count = bytes.size() / element;
    for (std::size_t b = 0; b < element; ++b)
        for (std::size_t i = 0; i < count; ++i)
            straight[i * element + b] = bytes[b * count + i];
    return straight;
}

/// Fletcher's sums of 16-bit words, of which the first byte is the higher, and an odd last byte is one, too.
std::uint32_t fletcher32(std::string_view bytes) {
    std::uint32_t sum = 0, sum_of_sums = 0;
    const auto folded = [](std::uint32_t value) { return (value & 0xffff) + (value >> 16); };
    for (std::size_t i = 0; i < bytes.size(); i += 2) {
        const auto byte = [&](std::size_t at) {
            return at < bytes.size() ? std::uint32_t(static_cast<unsigned char>(bytes[at])) : 0U;
        };
        sum = folded(sum + (byte(i) << 8 | byte(i + 1)));
        sum_of_sums = folded(sum_of_sums + sum);
    }
    return folded(sum_of_sums) << 16 | folded(sum);
}

std::string without_checksum(std::string bytes) {
    constexpr std::size_t sum_bytes = 4;
    if (bytes.size() < sum_bytes)
        throw Error("shorter than its checksum");
    const auto stated = loaded<std::uint32_t>(bytes.data() + bytes.size() - sum_bytes, false);
    bytes.resize(bytes.size() - sum_bytes);
    if (const std::uint32_t found = fletcher32(bytes); !sums_agree(found, stated))
        throw Error(fmt::format("its checksum is {:08x}, its bytes have {:08x}", stated, found));
    return bytes;
}

} // namespace

double Hdf5Number::at(const char* element) const {
    if (floats)
        return bytes == 8   ? loaded<double>(element, big_endian)
               : bytes == 4 ? static_cast<double>(loaded<float>(element, big_endian))
                            : half_at(element, big_endian);
    switch (bytes) {
    case 1:
        return is_signed ? loaded<std::int8_t>(element, big_endian) : loaded<std::uint8_t>(element, big_endian);
    case 2:
        return is_signed ? loaded<std::int16_t>(element, big_endian) : loaded<std::uint16_t>(element, big_endian);
    case 4:
        return is_signed ? loaded<std::int32_t>(element, big_endian) : loaded<std::uint32_t>(element, big_endian);
    default:
        return is_signed ? static_cast<double>(loaded<std::int64_t>(element, big_endian))
                         : static_cast<double>(loaded<std::uint64_t>(element, big_endian));
    }
}

std::string Hdf5Dataset::described() const {
    return fmt::format("{}{} of {}",
                       number_.floats      ? "float"
                       : number_.is_signed ? "int"
                                           : "uint",
                       number_.bytes * 8, fmt::join(shape_, "x"));
}

std::string Hdf5Dataset::chunk(const Hdf5Chunk& chunk) const {
    return during(fmt::format("{}: chunk at byte {}", name_, chunk.address), [&] {
        // Before anything is unpacked: one byte of deflate becomes at most 1032.
        constexpr std::uint64_t most_ratio = 1032;
        if (chunk.stored > file_->size() || chunk_bytes_ / most_ratio > chunk.stored)
            throw Error(fmt::format("{} stored, expected {} packed", counted(chunk.stored, "byte"), chunk_bytes_));
        std::string bytes = file_->bytes(chunk.address, chunk.stored);
        constexpr std::size_t of_checksums = 256; // filters before it see its bytes, too
        for (std::size_t i = filters_.size(); i-- > 0;) {
            if ((chunk.left_out >> i & 1) != 0)
                continue;
            if (filters_[i] == Hdf5Filter::deflate)
                bytes = inflated(bytes, Inflate::zlib, chunk_bytes_ + of_checksums);
            else if (filters_[i] == Hdf5Filter::shuffle)
                bytes = unshuffled(bytes, number_.bytes);
            else
                bytes = without_checksum(std::move(bytes));
        }
        if (bytes.size() != chunk_bytes_)
            throw Error(fmt::format("{}, expected {}", counted(bytes.size(), "byte"), chunk_bytes_));
        return bytes;
    });
}

std::string Hdf5Dataset::elements(std::uint64_t first, std::uint64_t count) const {
    if (first > shape_[0] || count > shape_[0] - first)
        throw Error(fmt::format("{}: slices {} to {} of {}", name_, first, first + count, shape_[0]));
    std::uint64_t slice = number_.bytes;
    for (std::size_t d = 1; d < shape_.size(); ++d)
        slice *= shape_[d];
    if (!compact_.empty())
        return compact_.substr(first * slice, count * slice);
    if (chunks_.empty())
        return during(name_, [&] { return file_->bytes(address_ + first * slice, count * slice); });
    require_memory(count * slice + 3 * chunk_bytes_, fmt::format("{}: {}", name_, counted(count * slice, "byte")));
    std::string all(count * slice, '\0');
    const std::size_t dimensions = shape_.size();
    std::uint64_t each_row = 1; // chunks of a row of chunks: those with the same outermost place
    for (std::size_t d = 1; d < dimensions; ++d)
        each_row *= (shape_[d] - 1) / chunk_size_[d] + 1;
    const std::uint64_t begin = first / chunk_size_[0] * each_row,
                        end = count == 0 ? begin : ((first + count - 1) / chunk_size_[0] + 1) * each_row;
    for (std::uint64_t place = begin; place < end; ++place) {
        const std::string bytes = chunk(chunks_[place]);
        // The part of the array that lies in this chunk, from `low` to `high`; all of it but for the outermost slices.
        std::vector<std::uint64_t> corner(dimensions), low(dimensions), high(dimensions);
        for (std::uint64_t rest = place, d = dimensions; d-- > 0;) {
            const std::uint64_t grid = (shape_[d] - 1) / chunk_size_[d] + 1;
            corner[d] = rest % grid * chunk_size_[d];
            rest /= grid;
            low[d] = d == 0 ? std::max(corner[d], first) : corner[d];
            high[d] = std::min(corner[d] + chunk_size_[d], d == 0 ? first + count : shape_[d]);
        }
        const std::size_t last = dimensions - 1, run = (high[last] - low[last]) * number_.bytes;
        for (std::vector<std::uint64_t> at = low;;) { // a run of the innermost dimension each time
            std::uint64_t from = 0, to = 0;
            for (std::size_t d = 0; d < dimensions; ++d) {
                from = from * chunk_size_[d] + at[d] - corner[d];
                to = to * (d == 0 ? 1 : shape_[d]) + at[d] - (d == 0 ? first : 0);
            }
            std::memcpy(all.data() + to * number_.bytes, bytes.data() + from * number_.bytes, run);
            std::size_t d = last;
            while (d-- > 0 && ++at[d] == high[d])
                at[d] = low[d];
            if (d == std::string::npos) // every dimension but the innermost has turned over
                break;
        }
    }
    return all;
}

std::vector<double> Hdf5Dataset::numbers(std::uint64_t most) const {
    std::uint64_t count = 1;
    for (const std::uint64_t size : shape_)
        count *= size;
    if (count > most)
        throw Error(fmt::format("{}: {}, expected at most {} numbers", name_, described(), most));
    const std::string bytes = elements(0, shape_[0]);
    std::vector<double> numbers(count);
    for (std::size_t i = 0; i < count; ++i)
        numbers[i] = number_.at(bytes.data() + i * number_.bytes);
    return numbers;
}

} // namespace scanshade
