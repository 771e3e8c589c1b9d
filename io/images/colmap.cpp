// COLMAP's maps (stereo/depth_maps/*.bin): "WIDTH&HEIGHT&CHANNELS&", then floats row by row (doc/format.rst, "Dense
// reconstruction").
#include "io/images/readers.h"

#include "io/text.h"

#include <array>
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <optional>

namespace scanshade::images {

namespace {

using image_check::refuse;

/// Three numbers, and where the floats begin.
struct Header {
    std::array<std::uint64_t, 3> numbers{};
    std::size_t length = 0;
};

std::optional<Header> header_in(std::string_view bytes) {
    constexpr std::size_t most_digits = 9;
    Header header;
    for (std::uint64_t& each : header.numbers) {
        const std::string_view rest = bytes.substr(header.length, most_digits + 1);
        const std::size_t digits = rest.find('&');
        const auto value = digits == std::string_view::npos ? std::nullopt : whole_number(rest.substr(0, digits));
        if (!value)
            return std::nullopt;
        each = *value;
        header.length += digits + 1;
    }
    return header;
}

} // namespace

bool is_colmap_map(std::string_view start) { return header_in(start).has_value(); }

ImageFacts colmap_map_header(std::string_view bytes, const Path& file) {
    const auto header = header_in(bytes);
    if (!header)
        refuse(file, "no COLMAP map: expected WIDTH&HEIGHT&CHANNELS& at offset 0");
    const auto [width, height, channels] = header->numbers;
    if (channels < 1 || channels > 16)
        refuse(file, fmt::format("a COLMAP map of {} channels, expected 1 (depth) or 3 (normals)", channels));
    ImageFacts facts;
    facts.size = image_check::checked_size(width, height, file);
    facts.bits = 32;
    facts.channels = static_cast<int>(channels);
    facts.floats = true;
    return facts;
}

cv::Mat stored_colmap_map(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    static_assert(std::endian::native == std::endian::little);
    const std::size_t start = header_in(bytes)->length, found = bytes.size() - start;
    if (facts.channels != 1)
        refuse(file, fmt::format("a COLMAP map of {} channels, expected 1 (depth)", facts.channels));
    const std::uint64_t needed = std::uint64_t(facts.size.area()) * sizeof(float);
    if (found != needed)
        refuse(file, fmt::format("{}x{} floats are {} bytes from offset {} on, found {}", facts.size.width,
                                 facts.size.height, needed, start, found));
    cv::Mat1f image(facts.size);
    std::memcpy(image.data, bytes.data() + start, found);
    return image;
}

} // namespace scanshade::images
