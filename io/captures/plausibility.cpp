// Range and smoothness of a depth image, from a sample of its pixels.
#include "io/captures/plausibility.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

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

/// What renderers write where there is nothing: 1e10, or the largest number of half precision.
bool is_background(float z_m) { return (z_m >= 1e6F) | (z_m == 65504); }

/// The largest depth but backgrounds; 0 for none. Bits of positive floats are in the order of their values, and the
/// compiler finds the largest of many integers at once.
float largest_of(const cv::Mat1f& depth_m) {
    constexpr auto background = std::bit_cast<std::int32_t>(1e6F), largest_half = std::bit_cast<std::int32_t>(65504.0F);
    std::int32_t largest = 0;
    for (int v = 0; v < depth_m.rows; ++v) {
        const float* row = depth_m[v];
        for (int u = 0; u < depth_m.cols; ++u) {
            const auto bits = std::bit_cast<std::int32_t>(row[u]);
            const bool counts = (bits < background) & (bits != largest_half); // as is_background(); not NaN
            largest = std::max(largest, counts ? bits : 0);
        }
    }
    return std::bit_cast<float>(largest);
}

Statistics statistics_of(const cv::Mat1f& depth_m) {
    std::vector<float> sample;
    Statistics result = sampled(
        depth_m, [](float z) { return is_background(z) ? 0 : z; }, [&](float z) { sample.push_back(z); });
    result.largest_m = largest_of(depth_m);
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
    std::vector<int> order; // of the values that occur
    for (int value = 0; value < static_cast<int>(counts.size()); ++value)
        if (counts[static_cast<std::size_t>(value)] > 0)
            order.push_back(value);
    std::ranges::sort(order, {}, [&](int value) { return metres[value]; });
    std::size_t below = 0;
    for (const int value : order)
        if ((below += counts[static_cast<std::size_t>(value)]) > result.valid / 2) { // as median() takes it
            result.median_m = metres[value];
            break;
        }
    return result;
}

/// Which lines repeat the line before them, exactly.
struct Repeats {
    int every = 0;    ///< 2 after an enlargement to twice the size; 0 where no such pattern is
    double share = 0; ///< of the lines with content, if runs of equal ones are alike: 0.6 after 2.5 times the size
};

/// The share of lines that lie in runs of equal ones as long as those of an enlargement: its factor rounded down or up.
/// Surfaces across the axis of an ideal camera make long runs beside short ones.
double in_alike_runs(const std::vector<int>& runs, double factor) {
    double alike = 0, all = 0;
    for (const int run : runs) {
        alike += std::abs(run - factor) < 1 ? run : 0;
        all += run;
    }
    return all > 0 ? alike / all : 0;
}

/// Where all lines are alike, as of a wall seen by an ideal sensor, nothing was repeated.
Repeats repeats_of(const cv::Mat& lines) {
    constexpr int most = 4;
    constexpr double nearly_all = 0.9, hardly_any = 0.1, all = 0.95, mostly = 0.8;
    std::vector<bool> counts(static_cast<std::size_t>(lines.rows)), repeats(counts.size());
    double repeated_in_all = 0, of_all = 0;
    std::vector<int> runs;
    for (int v = 1; v < lines.rows; ++v) {
        counts[v] = 4 * cv::countNonZero(lines.row(v)) > lines.cols;
        repeats[v] = counts[v] && std::memcmp(lines.ptr(v), lines.ptr(v - 1),
                                              static_cast<std::size_t>(lines.cols) * lines.elemSize()) == 0;
        repeated_in_all += repeats[v];
        of_all += counts[v];
        if (repeats[v] && !runs.empty())
            ++runs.back();
        else if (counts[v])
            runs.push_back(1);
    }
    Repeats found;
    const double share = repeated_in_all / (of_all + 1); // the first line repeats none
    if (of_all > 4 * most && repeated_in_all < all * of_all && in_alike_runs(runs, 1 / (1 - share)) > mostly)
        found.share = share;
    for (int every = 2; every <= most && found.every == 0; ++every)
        for (int first = 0; first < every; ++first) {
            double repeated = 0, of = 0, others_repeated = 0, others = 0;
            for (int v = 1; v < lines.rows; ++v) {
                const bool one = v % every == first;
                (one ? of : others) += counts[v];
                (one ? repeated : others_repeated) += repeats[v];
            }
            if (of > most && repeated > nearly_all * of && others_repeated < hardly_any * others) {
                found.every = every;
                break;
            }
        }
    return found;
}

const char* ordinal(int every) { return every == 2 ? "second" : every == 3 ? "third" : "fourth"; }

/// An image that was enlarged by copying pixels repeats rows and columns alike: between the copies are steps, which
/// occlude. Rows alone are a fault.
void check_repeats(const cv::Mat& image, Findings& findings) {
    constexpr double least_share = 0.3, alike = 1.25;
    const Repeats rows = repeats_of(image);
    cv::Mat some, transposed; // parts of the columns are enough, and quicker
    const int stride = std::max(1, image.rows / 60);
    for (int v = 0; v < image.rows; v += stride)
        some.push_back(image.row(v));
    cv::transpose(some, transposed);
    const Repeats columns = repeats_of(transposed);
    const double high = 1 / (1 - rows.share), wide = 1 / (1 - columns.share);
    const double share = std::min(rows.share, columns.share);
    const bool enlarged = share > least_share && std::max(high, wide) < alike * std::min(high, wide);
    add_finding(findings, Check::enlarged_image, share, least_share, enlarged, [&] {
        return fmt::format("pixels are copies of their neighbours, as of an image that was enlarged {:.2g} times: the "
                           "steps between them occlude. Reduce it and its camera to about {}x{}, without "
                           "interpolation.",
                           (high + wide) / 2, std::lround(image.cols / wide), std::lround(image.rows / high));
    });
    must_not(findings, Check::repeated_lines, !enlarged && rows.every != columns.every, [&] {
        return fmt::format("every {} {} repeats the one before it, and {} do not: the image was stretched, or lines "
                           "were lost.",
                           ordinal(std::max(rows.every, columns.every)), rows.every > columns.every ? "row" : "column",
                           rows.every > columns.every ? "columns" : "rows");
    });
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

/// "With --depth-scale 1000 the median is 3.22 m.": of floats in millimetres or centimetres.
std::string what_scales_give(float median_m, const DepthEncoding& encoding) {
    constexpr double nearest_m = 0.3, farthest_m = 20;
    for (const double scale : {1000.0, 100.0})
        if (const double metres = static_cast<double>(median_m) * encoding.units_per_metre / scale;
            scale != encoding.units_per_metre && metres > nearest_m && metres < farthest_m)
            return fmt::format(" With --depth-scale {} the median is {:.2f} m.", scale, metres);
    return {};
}

/// The largest number that nearly all stored values are multiples of; 1 where too few differ to tell.
int common_divisor(const cv::Mat& stored) {
    constexpr std::size_t enough = 50;
    constexpr int largest = 257;       // 8 bits widened to 16
    constexpr double nearly_all = 0.9; // beyond 8 m, SUN RGB-D's rotated bits end in odd ones
    std::vector<char> there(65536);
    for (int v = 0; v < stored.rows; v += 3) {
        const auto* row = stored.ptr<std::uint16_t>(v);
        for (int u = 0; u < stored.cols; u += 3)
            there[row[u]] = 1;
    }
    there[0] = there[65535] = 0; // holes
    std::vector<int> values;
    for (int value = 0; value < 65536; ++value)
        if (there[static_cast<std::size_t>(value)] != 0)
            values.push_back(value);
    if (values.size() < enough)
        return 1;
    const auto wanted = static_cast<std::ptrdiff_t>(nearly_all * static_cast<double>(values.size()));
    const auto divides_most = [&, most_others = std::ssize(values) - wanted](int divisor) {
        std::ptrdiff_t others = 0; // soon too many, of most divisors
        return std::ranges::none_of(values, [&](int value) { return (others += value % divisor != 0) > most_others; });
    };
    int divisor = largest;
    while (!divides_most(divisor))
        --divisor;
    return divisor;
}

/// Sensors record steps of a millimetre, or finer ones. Multiples show that the values are in a finer unit than is
/// assumed (a sensor's millimetres stored as TUM does: 5), or rotated bits (SUN RGB-D: 8).
void check_multiples(const cv::Mat& stored, const DepthEncoding& encoding, Findings& findings) {
    constexpr double largest_mm = 1.5;
    if ((encoding.stated && !encoding.by_hand) || stored.type() != CV_16UC1 ||
        encoding.kind != DepthEncoding::Kind::linear)
        return;
    const int divisor = common_divisor(stored);
    const double step_mm = divisor > 1 ? 1000 * divisor / encoding.units_per_metre : 0;
    at_most(findings, Check::depth_multiples, step_mm, largest_mm, [&] {
        return fmt::format("nearly all depths are multiples of {:.2g} mm with encoding {} ({}), which is probably "
                           "wrong.{}",
                           step_mm, encoding.name, encoding.origin, what_others_give(stored, encoding));
    });
}

/// From next to zero to the largest number: depth that was stretched from its smallest to its largest value.
template <class Pixel>
bool is_stretched(const cv::Mat_<Pixel>& stored, double whole, double nearly_all) {
    constexpr double hardly_any = 0.01;
    const auto largest = static_cast<Pixel>(whole);
    const bool largest_counts = nearly_all == 1; // the largest integer marks holes in other files
    std::size_t others = 0;
    Pixel least = largest, most = 0;
    for (int v = 0; v < stored.rows; ++v) { // without branches, which noise makes unforeseeable
        const Pixel* row = stored[v];
        int others_here = 0;
        for (int u = 0; u < stored.cols; ++u) {
            const Pixel value = row[u], known = value > 0 ? value : largest;
            const bool is_other = (value > 0) & (value < largest);
            const Pixel counted = is_other | largest_counts ? value : Pixel(0);
            others_here += is_other;
            least = known < least ? known : least;
            most = counted > most ? counted : most;
        }
        others += static_cast<std::size_t>(others_here);
    }
    return others >= 100 && least < hardly_any * whole && most >= nearly_all * whole && most <= whole;
}

/// Whether the largest number is exactly 1, and few pixels hold it: a frame was divided by its largest depth.
bool is_divided(const cv::Mat1f& stored, float largest) {
    constexpr int some = 1000; // one pixel in so many; a wall at one metre has more
    return largest == 1 && some * cv::countNonZero(stored == 1) < stored.rows * stored.cols;
}

/// `largest`: of the stored numbers, if they are floats.
bool is_stretched(const cv::Mat& stored, float largest) {
    return stored.type() == CV_16UC1   ? is_stretched(cv::Mat1w(stored), 65535, 0.98)
           : stored.type() == CV_32FC1 ? is_stretched(cv::Mat1f(stored), 1, 1) || is_divided(stored, largest)
                                       : false;
}

/// Whether a person gave a unit that recordings usually have, which is as often wrong as an assumed one. Another number
/// shows that they know better: that of a car's lidar, or of a renderer.
bool is_usual(const DepthEncoding& encoding, const cv::Mat& stored) {
    const double units = encoding.units_per_metre;
    return encoding.by_hand && (stored.type() != CV_16UC1 || encoding.kind != DepthEncoding::Kind::linear ||
                                units == 1000 || units == 5000);
}

/// `image`: depths of any kind, 0 = hole.
Findings findings_about(const Statistics& depth, const cv::Mat& image, const cv::Mat& stored,
                        const DepthEncoding& encoding) {
    constexpr float nearest_median_m = 0.05F, farthest_median_m = 200, farthest_m = 1000;
    // If nobody named the encoding, but the layout or custom did, depth beyond an indoor sensor's range is worth a
    // warning, too. Floats may be of streets and halls; in centimetres or millimetres they are beyond these as well.
    constexpr float assumed_farthest_median_m = 12, floats_farthest_median_m = 40;
    constexpr float most_jumps = 0.2F;
    if (depth.valid == 0) {
        if (depth.largest_m > 0)
            return {}; // a few pixels between those sampled
        return {{Check::no_depth, 1, 0.5, "no valid depth in this frame: every pixel is a hole."}};
    }
    Findings findings;
    if (encoding.arbitrary) { // any range may be right, and noise is no sign of another unit
        at_most(findings, Check::depth_jumps, depth.jumps, most_jumps, [&] {
            return fmt::format("{:.0f} % of neighbouring depths differ by more than a fifth, which is noise rather "
                               "than surfaces.",
                               100 * depth.jumps);
        });
        return findings;
    }
    const bool assumed = !encoding.stated;
    const float farthest_likely_m = !assumed && !is_usual(encoding, stored) ? farthest_median_m
                                    : stored.type() == CV_16UC1             ? assumed_farthest_median_m
                                                                            : floats_farthest_median_m;
    const std::string stated = fmt::format("encoding {} ({})", encoding.name, encoding.origin);
    at_most(findings, Check::depth_jumps, depth.jumps, most_jumps, [&] {
        return fmt::format("{:.0f} % of neighbouring depths differ by more than a fifth, which is noise rather than "
                           "surfaces; {} is probably wrong.{}",
                           100 * depth.jumps, stated, what_others_give(stored, encoding));
    });
    // In units of the limit: 1 = as near, or as far, as is plausible.
    const float range =
        std::max({nearest_median_m / depth.median_m, depth.median_m / farthest_likely_m, depth.largest_m / farthest_m});
    add_finding(findings, Check::median_depth, range, 1, range > 1 && !any_doubt(findings), [&] {
        return fmt::format("a median depth of {:.3g} m and a largest of {:.3g} m are implausible with {}.{}",
                           depth.median_m, depth.largest_m, stated,
                           stored.type() == CV_16UC1 ? what_others_give(stored, encoding)
                                                     : what_scales_give(depth.median_m, encoding));
    });
    if (!any_doubt(findings))
        check_multiples(stored, encoding, findings);
    const auto largest = static_cast<float>(static_cast<double>(depth.largest_m) * encoding.units_per_metre);
    if (!any_doubt(findings) && assumed)
        must_not(findings, Check::stretched_depth, is_stretched(stored, largest), [&] {
            return fmt::format("values fill the whole range of the file's numbers, as of depth stretched for looking "
                               "at: they are no lengths, whatever {} says.",
                               stated);
        });
    check_repeats(image, findings);
    return findings;
}

/// The least and the largest of negative numbers, where there are no positive ones but backgrounds; else nothing.
std::optional<std::pair<float, float>> all_negative(const cv::Mat1f& stored) {
    float least = 0, nearest = std::numeric_limits<float>::lowest();
    for (const float value : stored) {
        if (value > 0 && std::isfinite(value) && !is_background(value))
            return std::nullopt;
        if (!(value < 0 && std::isfinite(value)))
            continue;
        least = std::min(least, value);
        nearest = std::max(nearest, value);
    }
    return least < 0 ? std::optional(std::pair(least, nearest)) : std::nullopt;
}

} // namespace

cv::Mat looking_along_z(const cv::Mat& stored, std::vector<std::string>& warnings) {
    const auto range = stored.type() == CV_32FC1 ? all_negative(cv::Mat1f(stored)) : std::nullopt;
    if (!range || range->first == range->second)
        return stored;
    warnings.push_back(fmt::format("all depths are negative ({:.3g} .. {:.3g}), as z of cameras that look along -z "
                                   "(OpenGL): taken without their signs.",
                                   range->first, range->second));
    return -stored;
}

DepthTable depth_table(const DepthEncoding& encoding) {
    cv::Mat1w values(1, 1 << 16);
    std::iota(values.begin(), values.end(), ushort(0));
    return depth_in_metres(values, encoding);
}

Findings findings_about(const cv::Mat1f& depth_m, const cv::Mat& stored, const DepthEncoding& encoding) {
    return findings_about(statistics_of(depth_m), depth_m, stored, encoding);
}

Findings findings_about(const cv::Mat1w& stored, const DepthTable& table, float largest_m,
                        const DepthEncoding& encoding) {
    Statistics depth = statistics_of(stored, table);
    depth.largest_m = largest_m;
    return findings_about(depth, stored, stored, encoding);
}

} // namespace scanshade
