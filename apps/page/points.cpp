// Points as the page draws them. points.js reads what is written here.
#include "apps/page/points.h"

#include "ao/raycast/low_discrepancy.h"
#include "apps/json.h"
#include "apps/page/text.h"
#include "io/output_file.h"
#include "projection/base/indices_where.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <compare>
#include <cstdint>
#include <fmt/format.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/parallel_sort.h>

namespace scanshade::page {
namespace {

namespace fs = std::filesystem;

using Eigen::Vector3d;

struct Box {
    Vector3d low = Vector3d::Zero(), size = Vector3d::Zero();

    [[nodiscard]] bool holds(const Vector3d& point) const {
        return ((point - low).array() >= 0).all() && ((low + size - point).array() >= 0).all();
    }
    /// 0 .. 65535 along an axis.
    [[nodiscard]] std::uint16_t code(const Vector3d& point, Eigen::Index axis) const {
        const double share = size[axis] > 0 ? (point[axis] - low[axis]) / size[axis] : 0;
        return static_cast<std::uint16_t>(std::clamp(share, 0.0, 1.0) * 65535 + 0.5);
    }
};

/// Round everything but stray points: twice the extent of 99 of 100 points to either side, and no more than all.
Box box_of(std::span<const Vector3d> points) {
    constexpr std::size_t most_sampled = 100000;
    std::array<std::vector<double>, 3> sample;
    Vector3d least = Vector3d::Constant(std::numeric_limits<double>::infinity()), greatest = -least;
    const std::size_t step = std::max<std::size_t>(1, points.size() / most_sampled);
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (!points[i].allFinite())
            continue;
        least = least.cwiseMin(points[i]);
        greatest = greatest.cwiseMax(points[i]);
        if (i % step == 0)
            for (std::size_t axis = 0; axis < 3; ++axis)
                sample[axis].push_back(points[i][static_cast<Eigen::Index>(axis)]);
    }
    if (sample[0].empty())
        return least.allFinite() ? Box{least, greatest - least} : Box{};
    Box box;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
        auto& values = sample[static_cast<std::size_t>(axis)];
        const auto at = [&](double share) {
            const auto place =
                values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
            std::ranges::nth_element(values, place);
            return *place;
        };
        const double low = at(0.005), high = at(0.995), margin = 2 * (high - low);
        // An axis along which the sample has no extent keeps all.
        box.low[axis] = margin > 0 ? std::max(least[axis], low - margin) : least[axis];
        box.size[axis] = (margin > 0 ? std::min(greatest[axis], high + margin) : greatest[axis]) - box.low[axis];
    }
    return box;
}

/// The lower ten bits with two zeros between each.
std::uint32_t spread(std::uint32_t bits) {
    bits = (bits | bits << 16) & 0x030000ff;
    bits = (bits | bits << 8) & 0x0300f00f;
    bits = (bits | bits << 4) & 0x030c30c3;
    return (bits | bits << 2) & 0x09249249;
}

/// A point's place on the Z-order curve (Morton 1966) and its index. Neighbours on the curve are neighbours in space.
struct Place {
    std::uint32_t curve, index;

    auto operator<=>(const Place&) const = default; // NOLINT(modernize-use-nullptr)
};

/// The points in the box along the curve, at most about 2 `most` of them.
std::vector<Place> along_curve(const Points& cloud, const Box& box, std::size_t most, std::size_t& in_box) {
    const std::size_t step = std::max<std::size_t>(1, cloud.points.size() / (2 * std::max<std::size_t>(most, 1)));
    const std::vector<std::uint32_t> within = indices_where(
        cloud.points.size(), [&](std::size_t i) { return cloud.points[i].allFinite() && box.holds(cloud.points[i]); });
    in_box = within.size();
    const double scale = box.size.maxCoeff() > 0 ? 1023 / box.size.maxCoeff() : 0;
    std::vector<Place> places((within.size() + step - 1) / step);
    tbb::parallel_for(std::size_t(0), places.size(), [&](std::size_t i) {
        const std::uint32_t index = within[i * step];
        const auto cell = [&](Eigen::Index axis) {
            return spread(static_cast<std::uint32_t>((cloud.points[index][axis] - box.low[axis]) * scale));
        };
        places[i] = {cell(0) | cell(1) << 1 | cell(2) << 2, index};
    });
    tbb::parallel_sort(places);
    return places;
}

/// 0 .. count - 1 such that each beginning is spread evenly: the numbers with their bits reversed.
std::vector<std::uint32_t> even_order(std::size_t count) {
    const auto bits = static_cast<unsigned>(std::bit_width(count > 0 ? count - 1 : 0));
    return indices_where(
        count > 0 ? std::size_t(1) << bits : 0,
        [&](std::size_t i) {
            return static_cast<std::uint32_t>(bits_reversed(static_cast<std::uint32_t>(i)) >> 1 >> (31 - bits));
        },
        [&](std::uint32_t reversed) { return reversed < count; });
}

/// Differences of 16-bit numbers, folded so that small ones of either sign have a zero high byte, in two planes.
void append_planes(std::string& bytes, const std::vector<std::uint16_t>& values) {
    const std::size_t at = bytes.size(), count = values.size();
    bytes.resize(at + 2 * count);
    std::uint16_t before = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const auto apart = static_cast<std::int16_t>(static_cast<std::uint16_t>(values[i] - before));
        const auto folded = static_cast<std::uint16_t>(apart < 0 ? -2 * apart - 1 : 2 * apart);
        bytes[at + i] = static_cast<char>(folded);
        bytes[at + count + i] = static_cast<char>(folded >> 8);
        before = values[i];
    }
}

/// Differences of bytes, point by point.
template <class Value>
void append_differences(std::string& bytes, std::span<const std::uint32_t> chunk, Value&& value) {
    std::uint8_t before = 0;
    for (const std::uint32_t point : chunk) {
        const std::uint8_t now = value(point);
        bytes += static_cast<char>(now - before);
        before = now;
    }
}

/// 0 = none, 1 .. levels = 0 .. 1.
std::uint8_t share_code(float share, int levels) {
    return share == share
               ? static_cast<std::uint8_t>(std::clamp(share, 0.0F, 1.0F) * static_cast<float>(levels - 1) + 1.5F)
               : std::uint8_t(0);
}

/// The octahedron unfolded (Cigolle et al. 2014), a byte an axis. {0, 0} is no normal: all four corners are -z.
std::array<std::uint8_t, 2> normal_codes(const Eigen::Vector3f& normal) {
    const float sum = normal.cwiseAbs().sum();
    if (!(sum > 0 && std::isfinite(sum)))
        return {0, 0};
    float x = normal.x() / sum, y = normal.y() / sum;
    if (normal.z() < 0) {
        const float across = x;
        x = (1 - std::abs(y)) * (across < 0 ? -1.0F : 1.0F);
        y = (1 - std::abs(across)) * (y < 0 ? -1.0F : 1.0F);
    }
    const auto code = [](float value) { return static_cast<std::uint8_t>((value + 1) * 127.5F + 0.5F); };
    const std::array codes{code(x), code(y)};
    return codes == std::array<std::uint8_t, 2>{} ? std::array<std::uint8_t, 2>{255, 255} : codes;
}

/// How a field is stored: 0 = none, 1 .. 65535 = low .. high in even steps.
struct Scale {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    bool holes = false, whole = false;

    static constexpr double steps = 65534;
    /// 3e38 and the like mark what is not known, as in coordinates.
    [[nodiscard]] static bool is_known(double value) { return std::abs(value) <= 1e30; }
    void take(double value) {
        holes = holes || !is_known(value);
        low = is_known(value) ? std::min(low, value) : low;
        high = is_known(value) ? std::max(high, value) : high;
    }
    [[nodiscard]] bool known() const { return low <= high; }
    [[nodiscard]] double step() const { return whole && high - low <= steps ? 1 : (high - low) / steps; }
    /// Whether a code a point is needed.
    [[nodiscard]] bool varies() const { return holes || low < high; }
    [[nodiscard]] std::uint16_t code(double value) const {
        return is_known(value) ? static_cast<std::uint16_t>(1.5 + (low < high ? (value - low) / step() : 0))
                               : std::uint16_t(0);
    }
};

/// Of those fields that are written, over the points shown.
std::vector<Scale> scales_of(const Points& cloud, const std::vector<std::uint32_t>& shown) {
    std::vector<Scale> none(std::min(cloud.fields.size(), most_fields));
    for (std::size_t i = 0; i < none.size(); ++i)
        none[i].whole = cloud.fields[i].whole;
    if (none.empty())
        return none;
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, shown.size()), none,
        [&](const tbb::blocked_range<std::size_t>& range, std::vector<Scale> scales) {
            std::vector<double> values(cloud.fields.size());
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                cloud.read(shown[i], values);
                for (std::size_t k = 0; k < scales.size(); ++k)
                    scales[k].take(values[k]);
            }
            return scales;
        },
        [](std::vector<Scale> a, const std::vector<Scale>& b) {
            for (std::size_t k = 0; k < a.size(); ++k) {
                a[k].low = std::min(a[k].low, b[k].low), a[k].high = std::max(a[k].high, b[k].high);
                a[k].holes = a[k].holes || b[k].holes;
            }
            return a;
        });
}

/// Names and scales of the fields that have a value anywhere, for every chunk.
std::string fields_text(const Points& cloud, const std::vector<Scale>& scales) {
    json fields = json::array();
    for (std::size_t k = 0; k < scales.size(); ++k)
        if (scales[k].known())
            fields.push_back({{"name", cloud.fields[k].name},
                              {"low", scales[k].low},
                              {"high", scales[k].high},
                              {"step", scales[k].step()},
                              {"whole", scales[k].whole}});
    return for_script(json_line(fields));
}

/// The codes of these fields, one text each; empty where all points have `low`.
std::string codes_text(const Points& cloud, const std::vector<Scale>& scales, std::span<const std::uint32_t> chunk) {
    std::vector<std::vector<std::uint16_t>> codes(scales.size(), std::vector<std::uint16_t>(chunk.size()));
    std::vector<double> values(cloud.fields.size());
    for (std::size_t i = 0; i < chunk.size() && !scales.empty(); ++i) {
        cloud.read(chunk[i], values);
        for (std::size_t k = 0; k < scales.size(); ++k)
            codes[k][i] = scales[k].known() ? scales[k].code(values[k]) : std::uint16_t(0);
    }
    std::string text, bytes;
    for (std::size_t k = 0; k < scales.size(); ++k) {
        if (!scales[k].known())
            continue;
        bytes.clear();
        if (scales[k].varies())
            append_planes(bytes, codes[k]);
        text += fmt::format("{}\"{}\"", text.empty() ? "" : ",", bytes.empty() ? "" : packed(bytes));
    }
    return text;
}

/// The parts of a chunk; `chunk` holds indices of points, along the curve.
std::string parts_of(const Points& cloud, const Box& box, std::span<const std::uint32_t> chunk) {
    std::string bytes;
    std::vector<std::uint16_t> codes(chunk.size());
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
        std::ranges::transform(chunk, codes.begin(), [&](std::uint32_t i) { return box.code(cloud.points[i], axis); });
        append_planes(bytes, codes);
    }
    std::string text = fmt::format(",\"positions\":\"{}\"", packed(bytes));
    if (!cloud.colours.empty()) {
        bytes.clear(); // red and blue as differences to green, which mostly are the same for neighbours
        append_differences(bytes, chunk, [&](std::uint32_t i) { return cloud.colours[i][1]; });
        for (const int channel : {2, 0})
            append_differences(bytes, chunk, [&](std::uint32_t i) {
                return static_cast<std::uint8_t>(cloud.colours[i][channel] - cloud.colours[i][1]);
            });
        text += fmt::format(",\"colour\":\"{}\"", packed(bytes));
    }
    bytes.clear();
    append_differences(bytes, chunk, [&](std::uint32_t i) {
        return cloud.visibility.empty() ? std::uint8_t(0) : share_code(cloud.visibility[i], 128);
    });
    text += fmt::format(",\"ao\":\"{}\"", packed(bytes));
    if (!cloud.confidence.empty()) {
        bytes.clear();
        append_differences(bytes, chunk, [&](std::uint32_t i) { return share_code(cloud.confidence[i], 32); });
        text += fmt::format(",\"confidence\":\"{}\"", packed(bytes));
    }
    if (!cloud.normals.empty()) {
        bytes.clear();
        for (const std::size_t axis : {0, 1})
            append_differences(bytes, chunk, [&](std::uint32_t i) { return normal_codes(cloud.normals[i])[axis]; });
        text += fmt::format(",\"normal\":\"{}\"", packed(bytes));
    }
    return text;
}

/// The median distance between points that follow each other on the curve.
double spacing_of(const Points& cloud, const std::vector<std::uint32_t>& shown) {
    constexpr std::size_t most_pairs = 5000;
    std::vector<double> apart;
    const std::size_t step = std::max<std::size_t>(1, shown.size() / most_pairs);
    for (std::size_t i = 0; i + 1 < shown.size(); i += step)
        apart.push_back((cloud.points[shown[i + 1]] - cloud.points[shown[i]]).norm());
    if (apart.empty())
        return 0;
    const auto middle = apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2);
    std::ranges::nth_element(apart, middle);
    return *middle;
}

} // namespace

std::vector<fs::path> write_points(const fs::path& folder, const fs::path& stem, const Points& cloud,
                                   std::size_t most) {
    const Box box = box_of(cloud.points);
    std::size_t in_box = 0;
    std::vector<std::uint32_t> shown; // along the curve
    {
        const std::vector<Place> places = along_curve(cloud, box, most, in_box);
        shown.resize(std::min(places.size(), most));
        for (std::size_t i = 0; i < shown.size(); ++i)
            shown[i] = places[i * places.size() / shown.size()].index;
    }
    if (shown.empty())
        return {};
    const std::size_t finite =
        indices_where(cloud.points.size(), [&](std::size_t i) { return cloud.points[i].allFinite(); }).size();
    std::vector<std::uint32_t> order = even_order(shown.size());
    const std::size_t parts = (order.size() + points_in_a_chunk - 1) / points_in_a_chunk;
    const std::vector<Scale> scales = scales_of(cloud, shown);
    const std::string facts =
        fmt::format(",\"parts\":{},\"total\":{},\"of\":{},\"left_out\":{},\"spacing\":{:.5g},\"up\":[{}],"
                    "\"box\":[{},{},{},{},{},{}],\"fields\":{},\"more_fields\":{}",
                    parts, shown.size(), finite, finite - in_box, spacing_of(cloud, shown),
                    fmt::format("{:.6g},{:.6g},{:.6g}", cloud.up.x(), cloud.up.y(), cloud.up.z()), box.low.x(),
                    box.low.y(), box.low.z(), box.size.x(), box.size.y(), box.size.z(), fields_text(cloud, scales),
                    cloud.fields.size() - scales.size());
    std::vector<fs::path> files(parts);
    tbb::parallel_for(std::size_t(0), parts, [&](std::size_t part) {
        const auto begin = order.begin() + static_cast<std::ptrdiff_t>(part * points_in_a_chunk);
        const auto end = part + 1 < parts ? begin + points_in_a_chunk : order.end();
        std::sort(begin, end); // along the curve again: small differences
        std::vector<std::uint32_t> chunk(static_cast<std::size_t>(end - begin));
        std::transform(begin, end, chunk.begin(), [&](std::uint32_t place) { return shown[place]; });
        files[part] = fs::path(fmt::format("{}.{:03}.js", stem.string(), part));
        write_atomically(folder / files[part],
                         fmt::format("scanshade.points({{\"part\":{},\"count\":{}{}{},\"codes\":[{}]}})\n", part,
                                     chunk.size(), facts, parts_of(cloud, box, chunk),
                                     codes_text(cloud, scales, chunk)));
    });
    return files;
}

} // namespace scanshade::page
