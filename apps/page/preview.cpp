// A frame as the page shows it. frames.js reads what is written here.
#include "apps/page/preview.h"

#include "apps/page/text.h"
#include "io/images/jpeg_output.h"

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
        : step(std::max(1, (std::max(whole.width, whole.height) + map_side - 1) / map_side)), first(step / 2),
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

/// Differences between neighbours, so that surfaces become small numbers.
std::string differences(const std::vector<std::uint8_t>& values) {
    std::string bytes(values.size(), '\0');
    std::uint8_t before = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        bytes[i] = static_cast<char>(values[i] - before);
        before = values[i];
    }
    return bytes;
}

/// 0 = none, 1 .. levels = 0 .. 1.
template <class Pixel, class ToShare>
std::string shares(const cv::Mat_<Pixel>& map, const Sampling& sampling, int levels, ToShare&& to_share) {
    std::vector<std::uint8_t> values;
    values.reserve(static_cast<std::size_t>(sampling.size.area()));
    each_sample(map, sampling, [&](Pixel value) {
        const float share = to_share(value); // a NaN stays one
        values.push_back(share == share ? static_cast<std::uint8_t>(
                                              std::clamp(share, 0.0F, 1.0F) * static_cast<float>(levels - 1) + 1.5F)
                                        : std::uint8_t(0));
    });
    return packed(differences(values));
}

/// Depth as differences of shortened floats, whose order is that of their bits; holes are 0. Two planes: low bytes,
/// high bytes.
std::string packed_depth(const cv::Mat1f& z_m, const Sampling& sampling) {
    const auto count = static_cast<std::size_t>(sampling.size.area());
    std::string planes(2 * count, '\0');
    std::int32_t before = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(1.0F) >> dropped_mantissa_bits);
    std::size_t i = 0;
    each_sample(z_m, sampling, [&](float z) {
        std::uint32_t stored = 0;
        if (z > 0 && z < std::numeric_limits<float>::max()) {
            const auto bits = static_cast<std::int32_t>(std::bit_cast<std::uint32_t>(z) >> dropped_mantissa_bits);
            const std::int32_t apart = std::clamp(bits - before, -32766, 32766);
            before += apart;
            stored = static_cast<std::uint32_t>(apart < 0 ? -2 * apart - 1 : 2 * apart) + 1;
        }
        planes[i] = static_cast<char>(stored);
        planes[count + i++] = static_cast<char>(stored >> 8);
    });
    return packed(planes);
}

cv::Mat3b small(const cv::Mat3b& picture) {
    const int longer = std::max(picture.cols, picture.rows);
    if (longer <= colour_side)
        return picture;
    cv::Mat3b result;
    const double scale = static_cast<double>(colour_side) / longer;
    cv::resize(picture, result, {}, scale, scale, cv::INTER_AREA);
    return result;
}

/// The smallest and largest depth of the sample; {0, 0} where there is none.
std::pair<float, float> range_of(const cv::Mat1f& z_m, const Sampling& sampling) {
    std::vector<float> known;
    known.reserve(static_cast<std::size_t>(sampling.size.area()));
    each_sample(z_m, sampling, [&](float z) {
        if (z > 0)
            known.push_back(z);
    });
    if (known.empty())
        return {0.0F, 0.0F};
    const auto at = [&](std::size_t percent) {
        const auto place = known.begin() + static_cast<std::ptrdiff_t>((known.size() - 1) * percent / 100);
        std::ranges::nth_element(known, place);
        return *place;
    };
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
    if (!preview.z_m.empty()) {
        const auto [near, far] = range_of(preview.z_m, sampling);
        text +=
            fmt::format(",\"range\":[{:.5g},{:.5g}],\"depth\":\"{}\"", near, far, packed_depth(preview.z_m, sampling));
    }
    const auto itself = [](float share) { return share; };
    if (!preview.visibility.empty())
        text += fmt::format(",\"ao\":\"{}\"", shares(preview.visibility, sampling, 128, itself));
    if (!preview.reference.empty())
        text += fmt::format(",\"reference\":\"{}\"", shares(preview.reference, sampling, 128, itself));
    if (!preview.confidence_map.empty())
        text += fmt::format(",\"confidence\":\"{}\"", shares(preview.confidence_map, sampling, 32, [](uchar code) {
                                return code == 0 ? std::numeric_limits<float>::quiet_NaN()
                                                 : static_cast<float>(code - 1) / 254;
                            }));
    else if (!preview.confidence.empty())
        text += fmt::format(",\"confidence\":\"{}\"", shares(preview.confidence, sampling, 32, itself));
    if (!preview.colour.empty()) {
        constexpr int quality = 80;
        text += fmt::format(",\"fits\":{},\"colour\":\"{}\"", preview.colour_fits,
                            base64(encoded_jpeg(small(preview.colour), quality)));
    }
    return text + "})\n";
}

} // namespace scanshade::page
