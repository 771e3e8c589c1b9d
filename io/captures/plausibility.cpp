// Range and smoothness of a depth image, from a sample of its pixels.
#include "io/captures/plausibility.h"

#include "projection/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <numeric>

namespace scanshade {

namespace {

struct Statistics {
    std::size_t valid = 0;
    float median_m = 0, largest_m = 0;
    double jumps = 0; ///< share of neighbouring valid pixels whose depths differ by more than a fifth
};

/// Of every third row and column: enough to judge by, and quick. `metres` converts a pixel; `keep` gets each valid one.
template <class Pixel, class Metres, class Keep>
Statistics sampled(const cv::Mat_<Pixel>& image, const Metres& metres, const Keep& keep) {
    Statistics result;
    std::size_t neighbours = 0, jumps = 0;
    for (int y = 0; y < image.rows; y += 3) {
        const Pixel* row = image[y];
        for (int x = 0; x < image.cols; x += 3) {
            const float z = metres(row[x]);
            if (z <= 0)
                continue;
            ++result.valid;
            keep(row[x]);
            const float next = x + 1 < image.cols ? metres(row[x + 1]) : 0;
            if (next <= 0)
                continue;
            ++neighbours;
            jumps += std::abs(z - next) > 0.2F * std::min(z, next);
        }
    }
    if (neighbours > 100)
        result.jumps = static_cast<double>(jumps) / static_cast<double>(neighbours);
    return result;
}

Statistics statistics_of(const cv::Mat1f& depth_m) {
    std::vector<float> sample;
    Statistics result = sampled(
        depth_m, [](float z) { return z; }, [&](float z) { sample.push_back(z); });
    double largest_m = 0;
    cv::minMaxIdx(depth_m, nullptr, &largest_m);
    result.largest_m = static_cast<float>(largest_m);
    if (!sample.empty())
        result.median_m = median(std::move(sample));
    return result;
}

/// The same but for the largest depth.
Statistics statistics_of(const cv::Mat1w& stored, const DepthTable& table) {
    const float* metres = table[0];
    std::vector<std::size_t> counts(table.total());
    Statistics result = sampled(
        stored, [&](ushort value) { return metres[value]; }, [&](ushort value) { ++counts[value]; });
    std::vector<int> order(table.total());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::sort(order, {}, [&](int value) { return metres[value]; });
    std::size_t below = 0;
    for (const int value : order)
        if ((below += counts[static_cast<std::size_t>(value)]) > result.valid / 2) { // as median() takes it
            result.median_m = metres[value];
            break;
        }
    return result;
}

/// "mm: 2.10 m, tum: 0.42 m": the median under each preset for integers but the one in use.
std::string what_others_give(const cv::Mat& stored, const DepthEncoding& encoding) {
    std::vector<std::string> parts;
    for (const char* name : {"mm", "tum", "sun", "nyu"}) {
        if (encoding.name == name || stored.type() != CV_16UC1)
            continue;
        const Statistics other = statistics_of(cv::Mat1w(stored), depth_table(depth_encoding(name, "")));
        if (other.valid == 0)
            parts.push_back(fmt::format("{} no depth at all", name));
        else
            parts.push_back(
                fmt::format("{} a median of {:.2f} m{}", name, other.median_m, other.jumps > 0.2 ? " (noise)" : ""));
    }
    if (parts.empty())
        return {};
    return fmt::format(" With --depth-scale the other encodings give: {}.", fmt::join(parts, ", "));
}

std::vector<std::string> doubts_about(const Statistics& depth, const cv::Mat& stored, const DepthEncoding& encoding) {
    constexpr float nearest_median_m = 0.05F, farthest_median_m = 200, farthest_m = 1000;
    // If nobody named the encoding, depth beyond an indoor sensor's range is worth a warning, too.
    constexpr float assumed_farthest_median_m = 12;
    if (depth.valid == 0) {
        if (depth.largest_m > 0)
            return {}; // a few pixels between those sampled
        return {"no valid depth in this frame: every pixel is a hole."};
    }
    const bool assumed = encoding.origin.starts_with("assumed");
    const float farthest_likely_m = assumed ? assumed_farthest_median_m : farthest_median_m;
    const std::string stated = fmt::format("encoding {} ({})", encoding.name, encoding.origin);
    std::vector<std::string> doubts;
    if (depth.jumps > 0.2)
        doubts.push_back(fmt::format(
            "{:.0f} % of neighbouring depths differ by more than a fifth, which is noise rather than surfaces; "
            "{} is probably wrong.{}",
            100 * depth.jumps, stated, what_others_give(stored, encoding)));
    else if (depth.median_m < nearest_median_m || depth.median_m > farthest_likely_m || depth.largest_m > farthest_m)
        doubts.push_back(fmt::format("a median depth of {:.3g} m and a largest of {:.3g} m are implausible with {}.{}",
                                     depth.median_m, depth.largest_m, stated, what_others_give(stored, encoding)));
    return doubts;
}

} // namespace

DepthTable depth_table(const DepthEncoding& encoding) {
    cv::Mat1w values(1, 1 << 16);
    std::iota(values.begin(), values.end(), ushort(0));
    return depth_in_metres(values, encoding);
}

std::vector<std::string> doubts_about(const cv::Mat1f& depth_m, const cv::Mat& stored, const DepthEncoding& encoding) {
    return doubts_about(statistics_of(depth_m), stored, encoding);
}

std::vector<std::string> doubts_about(const cv::Mat1w& stored, const DepthTable& table, float largest_m,
                                      const DepthEncoding& encoding) {
    Statistics depth = statistics_of(stored, table);
    depth.largest_m = largest_m;
    return doubts_about(depth, stored, encoding);
}

} // namespace scanshade
