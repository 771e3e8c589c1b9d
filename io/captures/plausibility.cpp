// Range and smoothness of a depth image, from a sample of its pixels.
#include "io/captures/plausibility.h"

#include "projection/statistics.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade {

namespace {

struct Statistics {
    std::size_t valid = 0;
    float median_m = 0, largest_m = 0;
    double jumps = 0; ///< share of neighbouring valid pixels whose depths differ by more than a fifth
};

/// The largest value of every pixel, the rest of every third row and column: enough to judge by, and quick.
Statistics statistics_of(const cv::Mat1f& depth_m) {
    Statistics result;
    double largest_m = 0;
    cv::minMaxIdx(depth_m, nullptr, &largest_m);
    result.largest_m = static_cast<float>(largest_m);
    std::vector<float> sample;
    std::size_t neighbours = 0, jumps = 0;
    for (int y = 0; y < depth_m.rows; y += 3) {
        const float* row = depth_m[y];
        for (int x = 0; x < depth_m.cols; x += 3) {
            if (row[x] <= 0)
                continue;
            sample.push_back(row[x]);
            if (x + 1 >= depth_m.cols || row[x + 1] <= 0)
                continue;
            ++neighbours;
            jumps += std::abs(row[x] - row[x + 1]) > 0.2F * std::min(row[x], row[x + 1]);
        }
    }
    result.valid = sample.size();
    if (sample.empty())
        return result;
    result.median_m = median(std::move(sample));
    if (neighbours > 100)
        result.jumps = static_cast<double>(jumps) / static_cast<double>(neighbours);
    return result;
}

/// "mm: 2.10 m, tum: 0.42 m": the median under each preset for integers but the one in use.
std::string what_others_give(const cv::Mat& stored, const DepthEncoding& encoding) {
    std::vector<std::string> parts;
    for (const char* name : {"mm", "tum", "sun", "nyu"}) {
        if (encoding.name == name || stored.type() != CV_16UC1)
            continue;
        const Statistics other = statistics_of(depth_in_metres(stored, depth_encoding(name, "")));
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

} // namespace

std::vector<std::string> doubts_about(const cv::Mat1f& depth_m, const cv::Mat& stored, const DepthEncoding& encoding) {
    constexpr float nearest_median_m = 0.05F, farthest_median_m = 200, farthest_m = 1000;
    // If nobody named the encoding, depth beyond an indoor sensor's range is worth a warning, too.
    constexpr float assumed_farthest_median_m = 12;
    const Statistics depth = statistics_of(depth_m);
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

} // namespace scanshade
