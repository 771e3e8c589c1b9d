// Depth and colour images from disk: container checked first, decoded by OpenCV (PGM, PFM, PCLZF and grey PNG here),
// then metres.
#include "io/images/image_file.h"

#include "io/images/image_check.h"
#include "io/images/pclzf.h"
#include "io/images/png_input.h"
#include "io/text.h"
#include "projection/error.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <limits>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "byte orders below are written for little-endian machines");

namespace {

std::string read_image_bytes(const fs::path& file) {
    constexpr std::size_t most_bytes = 0x7fffffff; // decoders count with 32 bits
    std::string bytes = read_at_most(most_bytes, file, "an image");
    if (bytes.empty())
        throw Error(file.string() + ": empty file (0 bytes), expected an image");
    return bytes;
}

cv::Mat decode(const std::string& bytes, const fs::path& file, int flags) {
    cv::Mat image;
    try {
        const cv::Mat view(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
        image = cv::imdecode(view, flags);
    } catch (const cv::Exception& failure) {
        throw Error(fmt::format("{}: cannot be decoded: {}", file.string(), failure.err));
    }
    if (image.empty())
        throw Error(fmt::format("{}: cannot be decoded: damaged or not an image", file.string()));
    return image;
}

cv::Mat decode_grey(const std::string& bytes, const ImageFacts& facts, const fs::path& file) {
    cv::Mat image = facts.format == ImageFormat::png ? decoded_grey_png(bytes) : cv::Mat();
    return image.empty() ? decode(bytes, file, cv::IMREAD_UNCHANGED) : image;
}

void check_is_depth(const ImageFacts& facts, const fs::path& file) {
    const auto refuse = [&](const std::string& found) {
        throw Error(fmt::format("{}: 16-bit or float depth expected, one channel; found {}", file.string(), found));
    };
    const auto format = facts.format;
    const std::string name(format_name(format));
    if (format == ImageFormat::unknown)
        refuse("neither PNG, PGM, TIFF, EXR, PFM nor PCLZF");
    if (format == ImageFormat::jpeg)
        refuse("JPEG, which is 8-bit and lossy and cannot hold depth");
    if (format == ImageFormat::other_netpbm)
        refuse("a Netpbm kind other than binary grey (P5)");
    if (facts.channels != 1)
        refuse(fmt::format("{} with {} channels", name, facts.channels));
    if (facts.bits != 16 && !(facts.floats && facts.bits == 32))
        refuse(fmt::format("{}-bit {}", facts.bits, name));
}

cv::Mat1w unpack_pgm(std::string_view bytes, const ImageFacts& facts) {
    cv::Mat1w image(facts.size);
    const auto* from = reinterpret_cast<const unsigned char*>(bytes.data()) + facts.pixels_at;
    for (auto& value : image) {
        value = static_cast<ushort>(from[0] << 8 | from[1]); // Netpbm: most significant byte first
        from += 2;
    }
    return image;
}

cv::Mat1f unpack_pfm(std::string_view bytes, const ImageFacts& facts) {
    cv::Mat1f image(facts.size);
    const std::size_t row_bytes = static_cast<std::size_t>(facts.size.width) * sizeof(float);
    for (int y = 0; y < facts.size.height; ++y) { // PFM starts with the bottom row
        const auto file_row = static_cast<std::size_t>(facts.size.height - 1 - y);
        std::memcpy(image[y], bytes.data() + facts.pixels_at + file_row * row_bytes, row_bytes);
    }
    if (facts.big_endian)
        for (auto& value : image)
            value = std::bit_cast<float>(__builtin_bswap32(std::bit_cast<std::uint32_t>(value)));
    return image;
}

template <class Integer>
cv::Mat1f from_integers(const cv::Mat_<Integer>& image) {
    constexpr float steps = std::numeric_limits<Integer>::max() - 1;
    constexpr float no_surface = std::numeric_limits<float>::quiet_NaN();
    cv::Mat1f visibility(image.size());
    for (int y = 0; y < image.rows; ++y)
        for (int x = 0; x < image.cols; ++x)
            visibility(y, x) = image(y, x) == 0 ? no_surface : static_cast<float>(image(y, x) - 1) / steps;
    return visibility;
}

} // namespace

DepthEncoding depth_encoding(const std::string& text, const std::string& origin) {
    using Kind = DepthEncoding::Kind;
    if (text == "mm")
        return {Kind::linear, 1000, text, origin};
    if (text == "tum")
        return {Kind::linear, 5000, text, origin};
    if (text == "m")
        return {Kind::linear, 1, text, origin};
    if (text == "sun")
        return {Kind::sun_rotated, 1000, text, origin};
    if (text == "nyu")
        return {Kind::nyu_disparity, 1, text, origin};
    const auto units = number(text);
    if (!units || !std::isfinite(*units) || *units <= 0)
        throw Misuse(
            fmt::format("{}: {}: expected mm (1000 units per metre), tum (5000), sun, nyu, m (float files in metres), "
                        "or a positive number of units per metre",
                        origin, in_quotes(text)));
    return {Kind::linear, *units, text, origin};
}

cv::Mat read_stored_depth(const fs::path& file) {
    const std::string bytes = read_image_bytes(file);
    // The header speaks first: what cannot be depth is refused for that, whatever else is wrong with it.
    check_is_depth(read_image_header(bytes, file), file);
    const ImageFacts facts = check_image(bytes, file);
    if (facts.format == ImageFormat::pgm)
        return unpack_pgm(bytes, facts);
    if (facts.format == ImageFormat::pfm)
        return unpack_pfm(bytes, facts);
    if (facts.format == ImageFormat::pclzf)
        return decoded_pclzf(bytes, facts, file);
    const cv::Mat image = decode_grey(bytes, facts, file);
    if (image.size() != facts.size || (image.type() != CV_16UC1 && image.type() != CV_32FC1))
        throw Error(fmt::format("{}: decoded to something else than its header says", file.string()));
    return image;
}

cv::Mat1f depth_in_metres(const cv::Mat& stored, const DepthEncoding& encoding) {
    using Kind = DepthEncoding::Kind;
    const bool integers = stored.type() == CV_16UC1;
    if (!integers && stored.type() != CV_32FC1)
        throw Error("depth is neither 16-bit integers nor floats");
    if (integers && encoding.name == "m")
        throw Error(fmt::format("depth encoding \"m\" ({}) is for float files; this one holds 16-bit integers",
                                encoding.origin));
    const bool for_integers = encoding.kind != Kind::linear || encoding.name == "mm" || encoding.name == "tum";
    if (!integers && for_integers)
        throw Error(fmt::format("depth encoding \"{}\" ({}) is for 16-bit integers; this file holds floats",
                                encoding.name, encoding.origin));

    cv::Mat1f metres(stored.size());
    const auto each = [&](auto&& convert, auto sample) {
        using Sample = decltype(sample);
        for (int y = 0; y < stored.rows; ++y) {
            const auto* from = stored.ptr<Sample>(y);
            for (int x = 0; x < stored.cols; ++x)
                metres(y, x) = convert(from[x]);
        }
    };
    const double units = encoding.units_per_metre;
    if (!integers) {
        each([&](float v) { return v > 0 && std::isfinite(v) ? static_cast<float>(v / units) : 0.0F; }, float());
    } else if (encoding.kind == Kind::linear) {
        each([&](ushort v) { return v == 65535 ? 0.0F : static_cast<float>(v / units); }, ushort());
    } else if (encoding.kind == Kind::sun_rotated) {
        each(
            [](ushort v) {
                const auto millimetres = static_cast<ushort>(v >> 3 | v << 13);
                return millimetres == 65535 ? 0.0F : static_cast<float>(millimetres / 1000.0);
            },
            ushort());
    } else {
        each(
            [](ushort v) {
                const int disparity = static_cast<ushort>(v >> 8 | v << 8);
                return disparity < 1092 ? static_cast<float>(351.3 / (1092.5 - disparity)) : 0.0F;
            },
            ushort());
    }
    return metres;
}

cv::Mat3b read_colour(const fs::path& file) {
    const std::string bytes = read_image_bytes(file);
    const ImageFacts facts = check_image(bytes, file);
    if (facts.format == ImageFormat::unknown)
        throw Error(file.string() + ": neither PNG, JPEG, TIFF, EXR, BMP, WebP, PCLZF nor Netpbm");
    if (facts.format == ImageFormat::pclzf && facts.channels != 3)
        throw Error(file.string() + ": PCLZF depth, expected a colour image");
    if (facts.format == ImageFormat::pclzf)
        return decoded_pclzf(bytes, facts, file);
    // The orientation tag of a photo would turn the colour away from its depth.
    const cv::Mat image = decode(bytes, file, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
    if (image.type() != CV_8UC3)
        throw Error(file.string() + ": floats, expected a colour image of 8 or 16 bits");
    return image;
}

cv::Mat1f read_ao(const fs::path& file) {
    const std::string bytes = read_image_bytes(file);
    const ImageFacts facts = check_image(bytes, file);
    const bool png = facts.format == ImageFormat::png && facts.channels == 1 && (facts.bits == 8 || facts.bits == 16);
    const bool floats = facts.floats && facts.channels == 1 && facts.format != ImageFormat::pfm;
    if (!png && !floats)
        throw Error(
            fmt::format("{}: not an AO map: expected 8- or 16-bit grey PNG, or float TIFF or EXR; found {}-bit {} "
                        "with {} channels",
                        file.string(), facts.bits, format_name(facts.format), facts.channels));
    const cv::Mat image = decode_grey(bytes, facts, file);
    if (image.type() == CV_16UC1)
        return from_integers<ushort>(image);
    if (image.type() == CV_8UC1)
        return from_integers<uchar>(image);
    if (image.type() == CV_32FC1)
        return image;
    throw Error(file.string() + ": AO map cannot be decoded");
}

} // namespace scanshade
