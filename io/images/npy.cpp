// Depth as NumPy arrays (NEP 1): a header that is a Python dictionary, then the elements.
#include "io/images/readers.h"

#include "io/text.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <optional>
#include <vector>

namespace scanshade::images {

namespace {

using image_check::refuse;

struct Array {
    std::size_t data = 0; ///< where the elements begin
    std::size_t element_bytes = 0;
    char kind = 0; ///< 'f' or 'u', as in NumPy's type strings
    bool swapped = false, column_major = false;
    cv::Size size;
};

/// What follows the key, without the blanks before it; empty where there is no such key.
std::string_view after_key(std::string_view header, std::string_view key) {
    const std::size_t at = header.find(key);
    if (at == std::string_view::npos)
        return {};
    const std::size_t colon = header.find(':', at + key.size());
    return colon == std::string_view::npos ? std::string_view() : trimmed(header.substr(colon + 1));
}

/// "(480, 640)" or "(480, 640, 1)"
std::vector<std::uint64_t> shape_in(std::string_view header) {
    std::string_view text = after_key(header, "'shape'");
    std::vector<std::uint64_t> shape;
    if (!text.starts_with('('))
        return shape;
    text = text.substr(1, text.find(')') - 1);
    while (!text.empty() && shape.size() < 8) {
        const std::size_t comma = std::min(text.find(','), text.size());
        const auto side = whole_number(trimmed(text.substr(0, comma)));
        if (!side)
            break;
        shape.push_back(*side);
        text.remove_prefix(std::min(comma + 1, text.size()));
    }
    return shape;
}

Array array_in(std::string_view bytes, const Path& file) {
    constexpr std::size_t before_length = 8; // the signature, and two bytes of version
    if (bytes.size() < before_length + 4)
        refuse(file, fmt::format("npy ends early: {} bytes", bytes.size()));
    const auto byte = [&](std::size_t at) { return std::size_t(static_cast<unsigned char>(bytes[at])); };
    const bool first_version = byte(6) == 1;
    const std::size_t length_bytes = first_version ? 2 : 4,
                      length = byte(8) + (byte(9) << 8) + (first_version ? 0 : (byte(10) << 16) + (byte(11) << 24));
    Array array;
    array.data = before_length + length_bytes + length;
    if (array.data > bytes.size())
        refuse(file, fmt::format("npy header of {} bytes expected, the file has {}", length, bytes.size()));
    const std::string_view header = bytes.substr(before_length + length_bytes, length);
    const std::string_view type = after_key(header, "'descr'");
    const bool known = type.size() > 4 && (type.starts_with("'<") || type.starts_with("'>")) && type[4] == '\'' &&
                       ((type[2] == 'f' && (type[3] == '4' || type[3] == '8')) || (type[2] == 'u' && type[3] == '2'));
    if (!known)
        refuse(file, fmt::format("npy of type {}, expected <f4, <f8 or <u2, or big-endian ones",
                                 in_quotes(type.substr(0, 12))));
    array.kind = type[2];
    array.element_bytes = static_cast<std::size_t>(type[3] - '0');
    array.swapped = type[1] == '>';
    array.column_major = after_key(header, "'fortran_order'").starts_with("True");
    std::vector<std::uint64_t> shape = shape_in(header);
    if (shape.size() == 3 && shape[2] == 1)
        shape.pop_back();
    if (shape.size() != 2)
        refuse(file, fmt::format("npy of {} dimensions, expected an image's 2", shape.size()));
    array.size = image_check::checked_size(shape[1], shape[0], file);
    return array;
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

template <class Element, class Pixel>
cv::Mat elements(std::string_view bytes, const Array& array) {
    cv::Mat_<Pixel> image(array.size);
    const auto rows = static_cast<std::size_t>(array.size.height), columns = static_cast<std::size_t>(array.size.width);
    for (std::size_t v = 0; v < rows; ++v)
        for (std::size_t u = 0; u < columns; ++u) {
            const std::size_t place = array.column_major ? u * rows + v : v * columns + u;
            const auto value = element_at<Element>(bytes.data() + array.data + place * sizeof(Element), array.swapped);
            image(static_cast<int>(v), static_cast<int>(u)) = static_cast<Pixel>(value);
        }
    return image;
}

} // namespace

ImageFacts npy_header(std::string_view bytes, const Path& file) {
    const Array array = array_in(bytes, file);
    ImageFacts facts;
    facts.size = array.size;
    facts.bits = array.kind == 'f' ? 32 : 16; // as it is read
    facts.channels = 1;
    facts.floats = array.kind == 'f';
    return facts;
}

cv::Mat stored_npy(std::string_view bytes, const ImageFacts&, const Path& file) {
    const Array array = array_in(bytes, file);
    const std::uint64_t expected = std::uint64_t(array.size.area()) * array.element_bytes;
    if (const std::size_t found = bytes.size() - array.data; found != expected)
        refuse(file, fmt::format("npy of {}x{} needs {} bytes of elements, found {}", array.size.width,
                                 array.size.height, expected, found));
    if (array.kind == 'u')
        return elements<std::uint16_t, std::uint16_t>(bytes, array);
    return array.element_bytes == 4 ? elements<float, float>(bytes, array) : elements<double, float>(bytes, array);
}

} // namespace scanshade::images
