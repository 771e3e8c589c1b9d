// The Netpbm family (netpbm.sourceforge.net/doc): PBM, PGM and PPM as text and as bytes, PAM; and PFM.
#include "io/images/readers.h"

#include "io/text.h"

#include <algorithm>
#include <bit>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace scanshade::images {

namespace {

using image_check::refuse;

/// One word of a header or of samples as text; '#' starts a comment. Moves `at` behind the word.
std::string_view next_word(std::string_view bytes, std::size_t& at) {
    while (at < bytes.size() && (std::isspace(static_cast<unsigned char>(bytes[at])) || bytes[at] == '#'))
        at = bytes[at] == '#' ? std::min(bytes.find('\n', at), bytes.size()) : at + 1;
    const std::size_t start = at;
    while (at < bytes.size() && !std::isspace(static_cast<unsigned char>(bytes[at])))
        ++at;
    return bytes.substr(start, at - start);
}

std::uint64_t next_number(std::string_view bytes, std::size_t& at, const Path& file, std::string_view what) {
    const auto word = next_word(bytes, at);
    const auto value = whole_number(word);
    if (!value || *value > UINT32_MAX)
        refuse(file, fmt::format("header's {} is {}, expected a whole number", what, in_quotes(word)));
    return *value;
}

struct Header {
    ImageFacts facts;
    char kind = 0;           ///< the digit of P1 to P7, f or F
    unsigned maxval = 1;     ///< integers only
    bool big_endian = false; ///< PFM
    std::size_t samples_at = 0;

    [[nodiscard]] bool text() const { return kind >= '1' && kind <= '3'; }
    [[nodiscard]] bool one_bit() const { return kind == '1' || kind == '4'; }
};

unsigned checked_maxval(std::uint64_t maxval, const Path& file) {
    if (maxval == 0 || maxval > 65535)
        refuse(file, fmt::format("maxval {} in the header, expected 1 .. 65535", maxval));
    return static_cast<unsigned>(maxval);
}

/// PAM's lines: a name and a value each.
void take_pam_lines(std::string_view bytes, std::size_t& at, const Path& file, Header& header) {
    std::uint64_t width = 0, height = 0, channels = 0;
    for (std::string_view name = next_word(bytes, at); name != "ENDHDR"; name = next_word(bytes, at)) {
        if (name == "WIDTH")
            width = next_number(bytes, at, file, "width");
        else if (name == "HEIGHT")
            height = next_number(bytes, at, file, "height");
        else if (name == "DEPTH")
            channels = next_number(bytes, at, file, "depth");
        else if (name == "MAXVAL")
            header.maxval = checked_maxval(next_number(bytes, at, file, "maxval"), file);
        else if (name == "TUPLTYPE")
            (void)next_word(bytes, at);
        else
            refuse(file, fmt::format("PAM header holds {}, expected WIDTH, HEIGHT, DEPTH, MAXVAL, TUPLTYPE or ENDHDR",
                                     in_quotes(name)));
    }
    if (channels < 1 || channels > 4)
        refuse(file, fmt::format("PAM of {} channels, expected 1 to 4", channels));
    header.facts.size = image_check::checked_size(width, height, file);
    header.facts.channels = static_cast<int>(channels);
}

Header header_of(std::string_view bytes, const Path& file) {
    Header header;
    header.kind = bytes[1];
    std::size_t at = 2;
    if (header.kind == '7') {
        take_pam_lines(bytes, at, file, header);
    } else {
        const auto width = next_number(bytes, at, file, "width");
        const auto height = next_number(bytes, at, file, "height");
        header.facts.size = image_check::checked_size(width, height, file);
        header.facts.channels = header.kind == '3' || header.kind == '6' || header.kind == 'F' ? 3 : 1;
    }
    if (header.kind == 'f' || header.kind == 'F') {
        const auto word = next_word(bytes, at);
        const auto scale = number(word);
        if (!scale || !std::isfinite(*scale) || *scale == 0)
            refuse(file, fmt::format("PFM scale is {}, expected a number other than 0", in_quotes(word)));
        header.big_endian = *scale > 0; // its size is a hint of units (Debevec's PFM description) and has no effect
        header.facts.floats = true;
        header.facts.bits = 32;
    } else {
        if (!header.one_bit() && header.kind != '7')
            header.maxval = checked_maxval(next_number(bytes, at, file, "maxval"), file);
        header.facts.bits = header.maxval > 255 ? 16 : 8;
    }
    header.samples_at = std::min(at + 1, bytes.size()); // exactly one white space follows
    return header;
}

/// The samples, of which there must be exactly as many as the header says.
std::string_view samples_of(std::string_view bytes, const Header& header, const Path& file) {
    const ImageFacts& facts = header.facts;
    const auto width = static_cast<std::uint64_t>(facts.size.width),
               height = static_cast<std::uint64_t>(facts.size.height);
    const std::uint64_t row =
        header.one_bit() ? (width + 7) / 8 : width * static_cast<unsigned>(facts.channels * facts.bits / 8);
    const std::string_view samples = bytes.substr(header.samples_at);
    if (samples.size() != row * height)
        refuse(file, fmt::format("{}x{} at {} bits needs {} bytes of samples, found {}", width, height,
                                 header.one_bit() ? 1 : facts.bits, row * height, samples.size()));
    return samples;
}

cv::Mat unpacked_bytes(std::string_view samples, const ImageFacts& facts) {
    cv::Mat image(facts.size, CV_MAKETYPE(facts.bits == 16 ? CV_16U : CV_8U, facts.channels));
    if (facts.bits == 8) {
        std::memcpy(image.data, samples.data(), samples.size());
        return image;
    }
    const auto* from = reinterpret_cast<const unsigned char*>(samples.data());
    auto* to = image.ptr<ushort>();
    for (std::size_t i = 0; i < samples.size() / 2; ++i)
        to[i] = static_cast<ushort>(from[2 * i] << 8 | from[2 * i + 1]); // most significant byte first
    return image;
}

/// PBM: 1 is black.
cv::Mat unpacked_bits(std::string_view samples, cv::Size size) {
    cv::Mat1b image(size);
    const std::size_t row_bytes = samples.size() / static_cast<std::size_t>(size.height);
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            const auto at = static_cast<std::size_t>(y) * row_bytes + static_cast<std::size_t>(x) / 8;
            image(y, x) = static_cast<unsigned char>(samples[at]) >> (7 - x % 8) & 1 ? 0 : 255;
        }
    return image;
}

/// A sample of 0 .. maxval as one of 0 .. 255; of 16 bits the upper byte, as with all other formats.
uchar as_byte(std::uint64_t sample, unsigned maxval) {
    if (maxval == 65535)
        return static_cast<uchar>(sample >> 8);
    return static_cast<uchar>(std::min<std::uint64_t>(sample, maxval) * 255 / maxval);
}

/// Numbers as text, brought to 0 .. 255; PBM's need no blanks between them.
cv::Mat unpacked_text(std::string_view bytes, const Header& header, const Path& file) {
    const ImageFacts& facts = header.facts;
    if (static_cast<std::uint64_t>(facts.size.area()) * static_cast<unsigned>(facts.channels) > bytes.size())
        refuse(file, fmt::format("{} bytes of text cannot become {}x{} pixels", bytes.size(), facts.size.width,
                                 facts.size.height));
    cv::Mat image(facts.size, CV_MAKETYPE(CV_8U, facts.channels));
    std::size_t at = header.samples_at;
    const auto next_bit = [&]() -> std::string_view {
        while (at < bytes.size() && std::isspace(static_cast<unsigned char>(bytes[at])))
            ++at;
        return bytes.substr(std::min(at++, bytes.size()), 1);
    };
    for (std::size_t i = 0; i < image.total() * image.elemSize(); ++i) {
        const auto word = header.one_bit() ? next_bit() : next_word(bytes, at);
        const auto value = whole_number(word);
        if (!value || *value > header.maxval)
            refuse(file, fmt::format("sample {} is {}, expected 0 .. {}", i + 1, in_quotes(word), header.maxval));
        const uchar grey = as_byte(*value, header.maxval);
        image.data[i] = header.one_bit() ? 255 - grey : grey;
    }
    return image;
}

} // namespace

ImageFacts netpbm_header(std::string_view bytes, const Path& file) { return header_of(bytes, file).facts; }

cv::Mat stored_pgm(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    return unpacked_bytes(samples_of(bytes, header_of(bytes, file), file), facts);
}

cv::Mat stored_pfm(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const Header header = header_of(bytes, file);
    const std::string_view samples = samples_of(bytes, header, file);
    cv::Mat1f image(facts.size);
    const std::size_t row_bytes = static_cast<std::size_t>(facts.size.width) * sizeof(float);
    for (int y = 0; y < facts.size.height; ++y) { // PFM starts with the bottom row
        const auto file_row = static_cast<std::size_t>(facts.size.height - 1 - y);
        std::memcpy(image[y], samples.data() + file_row * row_bytes, row_bytes);
    }
    if (header.big_endian)
        for (auto& value : image)
            value = std::bit_cast<float>(__builtin_bswap32(std::bit_cast<std::uint32_t>(value)));
    return image;
}

cv::Mat3b colour_netpbm(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const Header header = header_of(bytes, file);
    cv::Mat image = header.text()      ? unpacked_text(bytes, header, file)
                    : header.one_bit() ? unpacked_bits(samples_of(bytes, header, file), facts.size)
                                       : unpacked_bytes(samples_of(bytes, header, file), facts);
    if (!header.text() && !header.one_bit() && header.maxval != 255) {
        cv::Mat bytes_of(image.size(), CV_MAKETYPE(CV_8U, image.channels()));
        const auto convert = [&](const auto* from) {
            std::transform(from, from + image.total() * static_cast<std::size_t>(image.channels()), bytes_of.data,
                           [&](auto sample) { return as_byte(sample, header.maxval); });
        };
        image.depth() == CV_16U ? convert(image.ptr<ushort>()) : convert(image.ptr<uchar>());
        image = bytes_of;
    }
    if (image.channels() == 2) // grey and how opaque it is
        cv::extractChannel(image, image, 0);
    cv::cvtColor(image, image,
                 image.channels() == 1   ? cv::COLOR_GRAY2BGR
                 : image.channels() == 3 ? cv::COLOR_RGB2BGR
                                         : cv::COLOR_RGBA2BGR);
    return image;
}

cv::Mat3w deep_netpbm(std::string_view bytes, const ImageFacts& facts, const Path& file) {
    const Header header = header_of(bytes, file);
    if (header.text() || header.one_bit() || header.maxval != 65535)
        return {};
    cv::Mat image = unpacked_bytes(samples_of(bytes, header, file), facts);
    if (image.channels() == 2) // grey and how opaque it is
        cv::extractChannel(image, image, 0);
    cv::cvtColor(image, image,
                 image.channels() == 1   ? cv::COLOR_GRAY2BGR
                 : image.channels() == 3 ? cv::COLOR_RGB2BGR
                                         : cv::COLOR_RGBA2BGR);
    return image;
}

} // namespace scanshade::images
