// A frame as the page shows it. frames.js reads what is written here.
#include "apps/page/preview.h"

#include "apps/page/text.h"
#include "io/images/jpeg_output.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>
#include <limits>
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

/// Calls take(value) for the sampled pixels, row by row.
template <class Pixel, class Take>
void each_sample(const cv::Mat_<Pixel>& map, const Sampling& sampling, Take&& take) {
    for (int v = 0; v < sampling.size.height; ++v) {
        const Pixel* row = map[sampling.first + v * sampling.step] + sampling.first;
        for (int u = 0; u < sampling.size.width; ++u)
            take(row[u * sampling.step]);
    }
}

/// A map of shares as differences between neighbours, so that surfaces become small numbers: 0 = none, 1 .. levels =
/// 0 .. 1.
template <class Pixel, class ToShare>
void append_shares(std::string& bytes, const cv::Mat_<Pixel>& map, const Sampling& sampling, int levels,
                   ToShare&& to_share) {
    std::size_t i = bytes.size();
    bytes.resize(i + static_cast<std::size_t>(sampling.size.area()));
    const auto steps = static_cast<float>(levels - 1);
    std::uint8_t before = 0;
    each_sample(map, sampling, [&](Pixel value) {
        const float share = to_share(value); // a NaN stays one
        const auto code =
            share == share ? static_cast<std::uint8_t>(static_cast<int>(std::clamp(share, 0.0F, 1.0F) * steps + 1.5F))
                           : std::uint8_t(0);
        bytes[i++] = static_cast<char>(code - before);
        before = code;
    });
}

/// Depth as differences of shortened floats, whose order is that of their bits; holes are 0. Two planes: low bytes,
/// high bytes.
void append_depth(std::string& bytes, const cv::Mat1f& z_m, const Sampling& sampling) {
    const auto count = static_cast<std::size_t>(sampling.size.area());
    std::size_t i = bytes.size();
    bytes.resize(i + 2 * count);
    auto before = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(1.0F) >> dropped_mantissa_bits);
    each_sample(z_m, sampling, [&](float z) {
        std::uint32_t stored = 0;
        if (z > 0 && z < std::numeric_limits<float>::max()) {
            const auto bits = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(z) >> dropped_mantissa_bits);
            const std::int32_t apart = std::clamp(bits - before, -32766, 32766);
            before += apart;
            stored = static_cast<std::uint32_t>(apart < 0 ? -2 * apart - 1 : 2 * apart) + 1;
        }
        bytes[i] = static_cast<char>(stored);
        bytes[count + i++] = static_cast<char>(stored >> 8);
    });
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
std::pair<float, float> range_of(const cv::Mat1f& z_m, const Sampling& sampling) {
    constexpr int most_looked_at = 4000;
    std::vector<float> known;
    const int step = std::max(1, sampling.size.area() / most_looked_at);
    int i = 0;
    each_sample(z_m, sampling, [&](float z) {
        if (i++ % step == 0 && z > 0)
            known.push_back(z);
    });
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
        const auto [near, far] = range_of(preview.z_m, sampling);
        text += fmt::format(",\"range\":[{:.5g},{:.5g}]", near, far);
        append_depth(bytes, preview.z_m, sampling);
        add("depth");
    }
    const auto itself = [](float share) { return share; };
    if (!preview.visibility.empty()) {
        append_shares(bytes, preview.visibility, sampling, 128, itself);
        add("ao");
    }
    if (!preview.reference.empty()) {
        append_shares(bytes, preview.reference, sampling, 128, itself);
        add("reference");
    }
    if (!preview.confidence_map.empty() || !preview.confidence.empty()) {
        if (preview.confidence_map.empty())
            append_shares(bytes, preview.confidence, sampling, 32, itself);
        else
            append_shares(bytes, preview.confidence_map, sampling, 32, [](uchar code) {
                return code == 0 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(code - 1) / 254;
            });
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
