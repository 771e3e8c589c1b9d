#include "io/rasters/las_crs.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace scanshade::rasters {

namespace {

template <class Number>
Number read_at(std::string_view bytes, std::size_t at) {
    Number value{};
    if (at + sizeof value <= bytes.size())
        std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

template <class Number>
std::vector<Number> numbers_of(std::string_view bytes) {
    std::vector<Number> numbers(bytes.size() / sizeof(Number));
    std::memcpy(numbers.data(), bytes.data(), numbers.size() * sizeof(Number));
    return numbers;
}

} // namespace

Crs crs_of_las(std::string_view header) {
    // Offsets in the public header block, and of a record ("LAS Specification 1.4 - R15").
    constexpr std::size_t at_encoding = 6, at_header_size = 94, at_count = 100, record_head = 54;
    constexpr std::uint16_t is_text = 0x10, text_id = 2112, keys_id = 34735, doubles_id = 34736, ascii_id = 34737;
    GeoKeys keys;
    std::string_view text;
    std::size_t at = read_at<std::uint16_t>(header, at_header_size);
    for (std::uint32_t i = 0, count = read_at<std::uint32_t>(header, at_count);
         i < count && at + record_head <= header.size(); ++i) {
        const std::string_view user = header.substr(at + 2, 16);
        const auto id = read_at<std::uint16_t>(header, at + 18);
        const std::string_view data = header.substr(at + record_head, read_at<std::uint16_t>(header, at + 20));
        at += record_head + read_at<std::uint16_t>(header, at + 20);
        if (user.substr(0, user.find('\0')) != "LASF_Projection")
            continue;
        if (id == text_id)
            text = data.substr(0, data.find('\0'));
        if (id == keys_id)
            keys.directory = numbers_of<std::uint16_t>(data);
        if (id == doubles_id)
            keys.doubles = numbers_of<double>(data);
        if (id == ascii_id)
            keys.ascii = data.substr(0, data.find('\0'));
    }
    const bool prefers_text = (read_at<std::uint16_t>(header, at_encoding) & is_text) != 0;
    if (!text.empty() && (prefers_text || keys.directory.empty()))
        return crs_of_text(text);
    if (keys.directory.empty())
        return {};
    Crs crs = crs_of_keys(std::move(keys));
    constexpr int raster_type = 1025, area = 1;
    crs.keys = with_value(std::move(crs.keys), raster_type, area);
    return crs;
}

} // namespace scanshade::rasters
