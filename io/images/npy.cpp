// Depth as NumPy arrays (NEP 1): a header that is a Python dictionary, then the elements.
#include "io/images/npy_array.h"
#include "io/images/readers.h"

#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>

namespace scanshade {

namespace {

constexpr std::string_view signature = "\x93NUMPY";

/// What follows the key, without the blanks before it; empty where there is no such key.
std::string_view after_key(std::string_view header, std::string_view key) {
    const std::size_t at = header.find(key);
    if (at == std::string_view::npos)
        return {};
    const std::size_t colon = header.find(':', at + key.size());
    return colon == std::string_view::npos ? std::string_view() : trimmed(header.substr(colon + 1));
}

/// "(480, 640)" or "(480, 640, 1)"; one side too many for more than 8.
std::vector<std::uint64_t> shape_in(std::string_view header) {
    std::string_view text = after_key(header, "'shape'");
    std::vector<std::uint64_t> shape;
    if (!text.starts_with('('))
        return shape;
    text = text.substr(1, text.find(')') - 1);
    while (!text.empty() && shape.size() < 9) {
        const std::size_t comma = std::min(text.find(','), text.size());
        const auto side = whole_number(trimmed(text.substr(0, comma)));
        if (!side)
            break;
        shape.push_back(*side);
        text.remove_prefix(std::min(comma + 1, text.size()));
    }
    return shape;
}

template <class Element>
Element element_at(const char* at, bool swapped) {
    char raw[sizeof(Element)];
    std::memcpy(raw, at, sizeof raw);
    if (swapped)
        std::reverse(raw, raw + sizeof raw);
    Element value;
    std::memcpy(&value, raw, sizeof raw);
    return value;
}

/// IEEE 754's binary16.
double half(std::uint16_t bits) {
    const int exponent = bits >> 10 & 31, fraction = bits & 1023;
    double value = exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1024 + fraction, exponent - 25);
    if (exponent == 31)
        value = fraction == 0 ? std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
    return bits & 0x8000 ? -value : value;
}

/// The element at this place of the elements, whatever its type.
double number_at(std::string_view elements, const NpyArray& array, std::uint64_t place) {
    const char* const at = elements.data() + place * array.element_bytes;
    const auto as = [&](auto type) { return static_cast<double>(element_at<decltype(type)>(at, array.swapped)); };
    switch (array.kind) {
    case 'f':
        return array.element_bytes == 2   ? half(element_at<std::uint16_t>(at, array.swapped))
               : array.element_bytes == 4 ? as(float())
                                          : as(double());
    case 'u':
        return array.element_bytes == 1   ? as(std::uint8_t())
               : array.element_bytes == 2 ? as(std::uint16_t())
               : array.element_bytes == 4 ? as(std::uint32_t())
                                          : as(std::uint64_t());
    default:
        return array.element_bytes == 1   ? as(std::int8_t())
               : array.element_bytes == 2 ? as(std::int16_t())
               : array.element_bytes == 4 ? as(std::int32_t())
                                          : as(std::int64_t());
    }
}

template <class Pixel, class Read>
cv::Mat filled(cv::Size size, bool column_major, const Read& read) {
    cv::Mat_<Pixel> image(size);
    const auto rows = static_cast<std::size_t>(size.height), columns = static_cast<std::size_t>(size.width);
    for (std::size_t v = 0; v < rows; ++v)
        for (std::size_t u = 0; u < columns; ++u)
            image(static_cast<int>(v), static_cast<int>(u)) =
                static_cast<Pixel>(read(column_major ? u * rows + v : v * columns + u));
    return image;
}

} // namespace

std::uint64_t NpyArray::count() const {
    std::uint64_t product = 1;
    for (const std::uint64_t side : shape)
        product *= side;
    return product;
}

bool is_npy(std::string_view start) { return start.starts_with(signature); }

NpyArray npy_array_in(std::string_view start, const std::string& where) {
    constexpr std::size_t before_length = 8; // the signature, and two bytes of version
    if (!is_npy(start))
        throw Error(where + ": no npy array begins so");
    if (start.size() < before_length + 4)
        throw Error(fmt::format("{}: npy ends early: {} bytes", where, start.size()));
    const auto byte = [&](std::size_t at) { return std::size_t(static_cast<unsigned char>(start[at])); };
    const bool first_version = byte(6) == 1;
    const std::size_t length_bytes = first_version ? 2 : 4,
                      length = byte(8) + (byte(9) << 8) + (first_version ? 0 : (byte(10) << 16) + (byte(11) << 24));
    NpyArray array;
    array.data = before_length + length_bytes + length;
    if (array.data > start.size())
        throw Error(fmt::format("{}: npy header of {} bytes expected, found {}", where, length,
                                start.size() - before_length - length_bytes));
    const std::string_view header = start.substr(before_length + length_bytes, length),
                           type = after_key(header, "'descr'");
    const auto is_one_of = [](char c, std::string_view of) { return of.find(c) != std::string_view::npos; };
    if (!(type.size() > 4 && type[0] == '\'' && is_one_of(type[1], "<>|=") && is_one_of(type[2], "fui") &&
          is_one_of(type[3], type[2] == 'f' ? "248" : "1248") && type[4] == '\''))
        throw Error(fmt::format("{}: npy of type {}, expected numbers such as <f4, <f8 or <u2", where,
                                in_quotes(type.substr(0, 12))));
    array.kind = type[2];
    array.element_bytes = static_cast<std::uint64_t>(type[3] - '0');
    array.swapped = type[1] == '>';
    array.column_major = after_key(header, "'fortran_order'").starts_with("True");
    array.shape = shape_in(header);
    if (array.shape.size() > 8)
        throw Error(fmt::format("{}: npy of more than 8 dimensions", where));
    constexpr std::uint64_t most = std::uint64_t(1) << 48;
    std::uint64_t bytes = array.element_bytes;
    for (const std::uint64_t side : array.shape) {
        if (side > 0 && bytes > most / side)
            throw Error(fmt::format("{}: npy of more than 2^48 bytes", where));
        bytes *= side;
    }
    return array;
}

cv::Mat npy_image(std::string_view elements, const NpyArray& array, cv::Size size) {
    if (elements.size() != static_cast<std::size_t>(size.area()) * array.element_bytes)
        throw Error(fmt::format("{} of elements, expected {} of {}x{}", counted(elements.size(), "byte"),
                                static_cast<std::size_t>(size.area()) * array.element_bytes, size.width, size.height));
    const char* const data = elements.data();
    if (array.kind == 'u' && array.element_bytes == 2)
        return filled<ushort>(size, array.column_major, [&](std::size_t place) {
            return element_at<ushort>(data + place * sizeof(ushort), array.swapped);
        });
    if (array.kind == 'f' && array.element_bytes == 4)
        return filled<float>(size, array.column_major, [&](std::size_t place) {
            return element_at<float>(data + place * sizeof(float), array.swapped);
        });
    return filled<float>(size, array.column_major,
                         [&](std::size_t place) { return number_at(elements, array, place); });
}

std::vector<double> npy_numbers(std::string_view elements, const NpyArray& array) {
    std::vector<double> numbers(elements.size() / array.element_bytes);
    for (std::size_t i = 0; i < numbers.size(); ++i)
        numbers[i] = number_at(elements, array, i);
    return numbers;
}

} // namespace scanshade

namespace scanshade::images {

using image_check::refuse;

namespace {

struct DepthArray {
    NpyArray array;
    cv::Size size;
};

DepthArray depth_array_in(std::string_view bytes, const Path& file) {
    DepthArray depth{npy_array_in(bytes, file.string()), {}};
    const NpyArray& array = depth.array;
    if (array.element_bytes < 2)
        refuse(file, fmt::format("npy of type {}{}, expected floats, or integers of 16 bits or more", array.kind,
                                 array.element_bytes));
    std::vector<std::uint64_t> shape = array.shape;
    if (shape.size() == 3 && shape[2] == 1)
        shape.pop_back();
    else if (shape.size() == 3 && shape[0] == 1)
        shape.erase(shape.begin());
    if (shape.size() != 2)
        refuse(file, fmt::format("npy of {} dimensions, expected an image's 2", shape.size()));
    constexpr std::uint64_t narrow = 10, many = 64; // x y z with colours and normals: no camera has such images
    if (std::min(shape[0], shape[1]) <= narrow && std::max(shape[0], shape[1]) >= many)
        refuse(file,
               fmt::format("npy of {}x{} looks like points, expected a depth image; clouds are read from PLY, PCD "
                           "and LAS",
                           shape[0], shape[1]));
    depth.size = image_check::checked_size(shape[1], shape[0], file);
    return depth;
}

} // namespace

ImageFacts npy_header(std::string_view bytes, const Path& file) {
    const DepthArray depth = depth_array_in(bytes, file);
    ImageFacts facts;
    facts.size = depth.size;
    facts.bits = depth.array.kind == 'f' ? 32 : 16; // as it is read
    facts.channels = 1;
    facts.floats = depth.array.kind == 'f';
    return facts;
}

cv::Mat stored_npy(std::string_view bytes, const ImageFacts&, const Path& file) {
    const DepthArray depth = depth_array_in(bytes, file);
    const std::uint64_t expected = depth.array.bytes();
    if (const std::size_t found = bytes.size() - depth.array.data; found != expected)
        refuse(file, fmt::format("npy of {}x{} needs {} bytes of elements, found {}", depth.size.width,
                                 depth.size.height, expected, found));
    const std::string_view elements = bytes.substr(depth.array.data);
    const bool as_stored = depth.array.kind == 'f' || (depth.array.kind == 'u' && depth.array.element_bytes == 2);
    if (as_stored)
        return npy_image(elements, depth.array, depth.size);
    // Wider integers, as arithmetic leaves them, hold 16-bit depth all the same; negative ones mark holes.
    return filled<ushort>(depth.size, depth.array.column_major, [&](std::uint64_t place) {
        const double value = number_at(elements, depth.array, place);
        if (value > 65535)
            refuse(file, fmt::format("npy of type {}{} holds {}, expected depth of 16 bits, 0 .. 65535",
                                     depth.array.kind, depth.array.element_bytes, value));
        return std::max(value, 0.0);
    });
}

} // namespace scanshade::images
