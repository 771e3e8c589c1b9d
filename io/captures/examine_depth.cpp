// A look at a depth image of integers: how often each value occurs, instead of an image in metres.
#include "io/captures/loading.h"

#include "io/captures/plausibility.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cstdint>

namespace scanshade {

namespace {

/// How many pixels have each value. In four tables, by turns: equal neighbours would wait for each other's sums.
std::vector<std::uint32_t> counts_of(const cv::Mat1w& stored) {
    constexpr std::size_t values = 1 << 16;
    std::vector<std::uint32_t> counts(4 * values);
    std::uint32_t *a = counts.data(), *b = a + values, *c = b + values, *d = c + values;
    for (int y = 0; y < stored.rows; ++y) {
        const ushort* row = stored[y];
        int x = 0;
        for (; x + 4 <= stored.cols; x += 4) {
            ++a[row[x]];
            ++b[row[x + 1]];
            ++c[row[x + 2]];
            ++d[row[x + 3]];
        }
        for (; x < stored.cols; ++x)
            ++a[row[x]];
    }
    for (std::size_t value = 0; value < values; ++value)
        a[value] += b[value] + c[value] + d[value];
    counts.resize(values);
    return counts;
}

} // namespace

void examine_depth(const Capture& capture, const CaptureEntry& entry, ExaminedFrame& examined) {
    const cv::Mat stored = stored_depth_of(entry);
    examined.depth_size = stored.size();
    if (stored.type() != CV_16UC1 || !entry.confidence.empty()) {
        load_depth(capture, entry, stored, examined.frame, true);
        return;
    }
    take_camera(capture, entry, stored.size(), examined.frame);
    const DepthEncoding encoding = encoding_of(capture, entry);
    DepthTable metres = during(entry.depth, [&] { return depth_table(encoding); });
    const std::vector<std::uint32_t> counts = counts_of(stored);
    float largest_m = 0;
    for (int value = 0; value < metres.cols; ++value)
        if (counts[static_cast<std::size_t>(value)] > 0)
            largest_m = std::max(largest_m, metres(value));
    examined.frame.findings = findings_about(stored, metres, largest_m, encoding);
    correct(metres, capture.depth_correction);
    for (int value = 0; value < metres.cols; ++value)
        if (const std::uint32_t count = counts[static_cast<std::size_t>(value)]; count > 0 && metres(value) != 0)
            examined.levels.push_back({metres(value), count});
    std::ranges::sort(examined.levels, {}, &DepthLevel::z_m);
    if (capture.guessed_beyond_m > 0) {
        double beyond = 0, all = 0;
        for (const DepthLevel& level : examined.levels) {
            all += level.count;
            beyond += level.z_m > capture.guessed_beyond_m ? level.count : 0;
        }
        tell_guesses(capture, beyond, all, examined.frame);
    }
    if (!entry.colour.empty())
        load_colour(capture, entry, stored.size(), examined.frame);
}

} // namespace scanshade
