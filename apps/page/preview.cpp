// A frame as the page shows it. frames.js reads what is written here.
#include "apps/page/preview.h"

#include "apps/page/text.h"
#include "io/images/jpeg_output.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <fmt/format.h>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace scanshade::page {
namespace {

/// Every n-th pixel, from the middle of the first n.
struct Sampling {
    int step = 1, first = 0;
    cv::Size size;

    explicit Sampling(cv::Size whole)
        : step(std::max(1, (std::max(whole.width, whole.height) + map_side - 1) / map_side)),
          first(std::min(step / 2, std::min(whole.width, whole.height) - 1)),
          size((whole.width - first + step - 1) / step, (whole.height - first + step - 1) / step) {}
};

/// The sampled pixels, row by row.
template <class Pixel>
std::vector<Pixel> sampled(const cv::Mat_<Pixel>& map, const Sampling& sampling) {
    std::vector<Pixel> values(static_cast<std::size_t>(sampling.size.area()));
    Pixel* to = values.data();
    for (int v = 0; v < sampling.size.height; ++v) {
        const Pixel* row = map[sampling.first + v * sampling.step] + sampling.first;
        for (int u = 0; u < sampling.size.width; ++u)
            *to++ = row[u * sampling.step];
    }
    return values;
}

/// Codes as differences between neighbours, so that surfaces become small numbers.
void append_differences(std::string& bytes, const std::vector<std::uint8_t>& codes) {
    const std::size_t at = bytes.size();
    bytes.resize(at + codes.size());
    std::adjacent_difference(codes.begin(), codes.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at),
                             [](std::uint8_t code, std::uint8_t before) { return static_cast<char>(code - before); });
}

/// 0 = none, 1 .. levels = 0 .. 1.
void append_shares(std::string& bytes, const std::vector<float>& shares, int levels) {
    const auto steps = static_cast<float>(levels - 1);
    std::vector<std::uint8_t> codes(shares.size());
    std::ranges::transform(shares, codes.begin(), [&](float share) {
        const float known = share == share ? 1.0F : 0.0F; // no branch: many values at once
        return static_cast<std::uint8_t>(
            static_cast<int>(known * (std::min(std::max(share, 0.0F), 1.0F) * steps + 1.5F)));
    });
    append_differences(bytes, codes);
}

/// The same of a map in 8 bits: 0 = none, 1 .. 255 = 0 .. 1.
void append_shares(std::string& bytes, std::vector<std::uint8_t> codes, int levels) {
    std::array<std::uint8_t, 256> coarser{};
    for (std::size_t code = 1; code < coarser.size(); ++code)
        coarser[code] =
            static_cast<std::uint8_t>(static_cast<float>(code - 1) / 254 * static_cast<float>(levels - 1) + 1.5F);
    for (std::uint8_t& code : codes)
        code = coarser[code];
    append_differences(bytes, codes);
}

/// Depth as differences of shortened floats, whose order is that of their bits; holes are 0. Two planes: low bytes,
/// high bytes.
void append_depth(std::string& bytes, const std::vector<float>& depths_m) {
    std::size_t i = bytes.size();
    bytes.resize(i + 2 * depths_m.size());
    auto before = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(1.0F) >> dropped_mantissa_bits);
    for (const float z : depths_m) {
        std::uint32_t stored = 0;
        if (z > 0 && z < std::numeric_limits<float>::max()) {
            const auto bits = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(z) >> dropped_mantissa_bits);
            const std::int32_t apart = std::clamp(bits - before, -32766, 32766);
            before += apart;
            stored = static_cast<std::uint32_t>(apart * 2 ^ apart >> 31) + 1; // small for both signs, without a branch
        }
        bytes[i] = static_cast<char>(stored);
        bytes[depths_m.size() + i++] = static_cast<char>(stored >> 8);
    }
}

cv::Mat3b small(const cv::Mat3b& picture) {
    const int longer = std::max(picture.cols, picture.rows);
    if (longer <= colour_side)
        return picture;
    cv::Mat3b result;
    const double scale = static_cast<double>(colour_side) / longer;
    cv::resize(picture, result,
               {std::max(1, cvRound(picture.cols * scale)), std::max(1, cvRound(picture.rows * scale))}, 0, 0,
               cv::INTER_AREA);
    return result;
}

/// The depths below which 1 % and 99 % of some thousand pixels lie; {0, 0} where there is none.
std::pair<float, float> range_of(const std::vector<float>& depths_m) {
    constexpr std::size_t most_looked_at = 4000;
    std::vector<float> known;
    const std::size_t step = std::max<std::size_t>(1, depths_m.size() / most_looked_at);
    for (std::size_t i = 0; i < depths_m.size(); i += step)
        if (depths_m[i] > 0)
            known.push_back(depths_m[i]);
    if (known.empty())
        return {0.0F, 0.0F};
    const auto at = [&](std::size_t percent) { return ranked(known, (known.size() - 1) * percent / 100); };
    const float near = at(1);
    return {near, at(99)};
}

} // namespace

std::string preview_script(const Preview& preview) {
    const cv::Size whole = preview.visibility.empty() ? preview.z_m.size() : preview.visibility.size();
    const Sampling sampling(whole);
    std::string text = fmt::format("scanshade.preview({{\"size\":[{},{}],\"step\":{},\"first\":{},\"whole\":[{},{}]",
                                   sampling.size.width, sampling.size.height, sampling.step, sampling.first,
                                   whole.width, whole.height);
    const Pinhole& camera = preview.camera;
    if (camera.fx != 0)
        text += fmt::format(",\"camera\":[{:.7g},{:.7g},{:.7g},{:.7g}]", camera.fx, camera.fy, camera.cx, camera.cy);
    // All maps are one stream: beginning a stream takes as long as packing some thousand bytes.
    std::string maps, bytes;
    const auto add = [&](std::string_view name) { maps += fmt::format("{}\"{}\"", maps.empty() ? "" : ",", name); };
    if (!preview.z_m.empty()) {
        const std::vector<float> depths_m = sampled(preview.z_m, sampling);
        const auto [near, far] = range_of(depths_m);
        text += fmt::format(",\"range\":[{:.5g},{:.5g}]", near, far);
        if (!preview.unit.empty())
            text += fmt::format(",\"unit\":\"{}\"", preview.unit);
        append_depth(bytes, depths_m);
        add("depth");
    }
    if (!preview.visibility.empty()) {
        append_shares(bytes, sampled(preview.visibility, sampling), 128);
        add("ao");
    }
    if (!preview.reference.empty()) {
        append_shares(bytes, sampled(preview.reference, sampling), 128);
        add("reference");
    }
    if (!preview.confidence_map.empty() || !preview.confidence.empty()) {
        if (preview.confidence_map.empty())
            append_shares(bytes, sampled(preview.confidence, sampling), 32);
        else
            append_shares(bytes, sampled(preview.confidence_map, sampling), 32);
        add("confidence");
    }
    text += fmt::format(",\"maps\":[{}],\"bytes\":\"{}\"", maps, packed(bytes));
    if (!preview.colour.empty()) {
        constexpr int quality = 80;
        text += fmt::format(",\"fits\":{},\"colour\":\"{}\"", preview.colour_fits,
                            base64(encoded_jpeg(small(preview.colour), quality)));
    }
    return text + "})\n";
}

} // namespace scanshade::page
