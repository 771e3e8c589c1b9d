// Depth, colour and AO images from disk: decoded by the reader of their format, then metres or visibility.
#include "io/images/image_file.h"

#include "io/images/format.h"
#include "io/images/readers.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

std::string read_image_bytes(const fs::path& file) {
    constexpr std::size_t most_bytes = 0x7fffffff; // decoders count with 32 bits
    std::string bytes = read_at_most(most_bytes, file, "an image");
    if (bytes.empty())
        throw Error(file.string() + ": empty file (0 bytes), expected an image");
    return bytes;
}

void check_is_depth(std::string_view bytes, const ImageFacts& facts, const fs::path& file) {
    const auto refuse = [&](const std::string& found) {
        throw Error(fmt::format("{}: 16-bit or float depth expected, one channel; found {}", file.string(), found));
    };
    if (!facts.format)
        refuse("neither " + listed(depth_format_names(), "nor"));
    if (!facts.format->no_depth.empty())
        refuse(std::string(facts.format->no_depth));
    if (facts.channels != 1)
        refuse(fmt::format("{} with {} channels{}", facts.format->name, facts.channels,
                           facts.format->header == &images::exr_header
                               ? fmt::format(" ({})", images::exr_channels(bytes, file))
                               : ""));
    if (facts.bits != 16 && !(facts.floats && facts.bits == 32))
        refuse(fmt::format("{}-bit {}", facts.bits, facts.format->name));
}

cv::Mat read_as_stored(const std::string& bytes, const ImageFacts& facts, const fs::path& file) {
    cv::Mat image = facts.format->read_stored(bytes, facts, file);
    const int depth = facts.floats ? CV_32F : facts.bits == 16 ? CV_16U : CV_8U;
    if (image.size() != facts.size || image.type() != CV_MAKETYPE(depth, 1))
        throw Error(fmt::format("{}: decoded to something else than its header says", file.string()));
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

/// Metres of every integer. A division for each pixel would take ten times as long as a look into 256 KB.
const std::vector<float>& metres_of_integers(double units_per_metre) {
    thread_local double units = 0;
    thread_local std::vector<float> metres;
    if (metres.empty() || units != units_per_metre) {
        metres.resize(65536);
        for (std::size_t v = 0; v < metres.size(); ++v)
            metres[v] = v == 65535 ? 0.0F : static_cast<float>(static_cast<double>(v) / units_per_metre);
        units = units_per_metre;
    }
    return metres;
}

ImageFacts colour_facts(const std::string& bytes, const fs::path& file) {
    const ImageFacts facts = read_image_header(bytes, file);
    if (!facts.format)
        throw Error(fmt::format("{}: neither {}", file.string(), listed(colour_format_names(), "nor")));
    if (!facts.format->read_colour)
        throw Error(fmt::format("{}: {} of floats, expected a colour image of 8 or 16 bits", file.string(),
                                facts.format->name));
    return facts;
}

} // namespace

DepthEncoding arbitrary_encoding(const std::string& origin, double units_per_length) {
    DepthEncoding encoding{DepthEncoding::Kind::linear, units_per_length, "an arbitrary unit", origin};
    encoding.arbitrary = true;
    return encoding;
}

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

cv::Mat read_stored_depth(const fs::path& file) { return stored_depth_in(read_image_bytes(file), file); }

cv::Mat stored_depth_in(const std::string& bytes, const fs::path& file) {
    // Check the header first: an image that cannot be depth is refused for that reason, whatever else is wrong.
    const ImageFacts facts = read_image_header(bytes, file);
    check_is_depth(bytes, facts, file);
    return read_as_stored(bytes, facts, file);
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
            float* to = metres[y];
            for (int x = 0; x < stored.cols; ++x)
                to[x] = convert(from[x]);
        }
    };
    const double units = encoding.units_per_metre;
    if (!integers) {
        constexpr double background = 1e6; // of renderers: 1e10 where there is nothing
        each([&](float v) { return v > 0 && v / units < background ? static_cast<float>(v / units) : 0.0F; }, float());
    } else if (encoding.kind == Kind::linear) {
        const std::vector<float>& of = metres_of_integers(units);
        each([&](ushort v) { return of[v]; }, ushort());
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

cv::Mat3b read_colour(const fs::path& file) { return colour_in(read_image_bytes(file), file); }

cv::Mat3b colour_in(const std::string& bytes, const fs::path& file) {
    const ImageFacts facts = colour_facts(bytes, file);
    return facts.format->read_colour(bytes, facts, file);
}

StoredColour read_stored_colour(const fs::path& file) { return stored_colour_in(read_image_bytes(file), file); }

StoredColour stored_colour_in(const std::string& bytes, const fs::path& file) {
    const ImageFacts facts = colour_facts(bytes, file);
    const bool deep = facts.bits == 16 && facts.format->read_deep_colour;
    return {facts.format->read_colour(bytes, facts, file),
            deep ? facts.format->read_deep_colour(bytes, facts, file) : cv::Mat3w()};
}

cv::Mat1f read_ao(const fs::path& file) {
    const std::string bytes = read_image_bytes(file);
    const ImageFacts facts = read_image_header(bytes, file);
    if (!is_ao_map(facts))
        throw Error(
            fmt::format("{}: not an AO map: expected 8- or 16-bit grey PNG, or float TIFF or EXR; found {}-bit {} "
                        "with {} channels",
                        file.string(), facts.bits, name_of(facts.format), facts.channels));
    const cv::Mat image = read_as_stored(bytes, facts, file);
    if (image.depth() == CV_16U)
        return from_integers<ushort>(image);
    return image.depth() == CV_8U ? from_integers<uchar>(image) : cv::Mat1f(image);
}

} // namespace scanshade
