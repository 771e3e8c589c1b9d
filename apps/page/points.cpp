// Points as the page draws them. points.js reads what is written here.
#include "apps/page/points.h"

#include "apps/json.h"
#include "apps/page/octree.h"
#include "apps/page/text.h"
#include "io/output_file.h"
#include "projection/base/indices_where.h"

#include <algorithm>
#include <array>
#include <cmath>
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

    /// Of the octree's cube: a little longer than the box, since many points of a regular grid lie exactly in its
    /// middle, where rounding would decide on which side they are.
    [[nodiscard]] double edge() const { return 1.001 * size.maxCoeff(); }
    [[nodiscard]] bool holds(const Vector3d& point) const {
        return ((point - low).array() >= 0).all() && ((low + size - point).array() >= 0).all();
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

/// The places of the points in the box along the curve, evenly chosen where there are more than `most`. The cube of the
/// curve begins at the box's lower corner.
std::vector<CurvePlace> along_curve(const Points& cloud, const Box& box, std::size_t most, std::size_t& in_box) {
    const std::vector<std::uint32_t> within = indices_where(
        cloud.points.size(), [&](std::size_t i) { return cloud.points[i].allFinite() && box.holds(cloud.points[i]); });
    in_box = within.size();
    most = std::min(std::max<std::size_t>(most, 1), within.size());
    const std::size_t step = most > 0 ? std::max<std::size_t>(1, cloud.points.size() / (2 * most)) : 1;
    constexpr std::uint32_t cells = 1U << octree_bits;
    const double scale = box.edge() > 0 ? cells / box.edge() : 0;
    std::vector<CurvePlace> places((within.size() + step - 1) / step);
    tbb::parallel_for(std::size_t(0), places.size(), [&](std::size_t i) {
        const std::uint32_t index = within[i * step];
        std::array<std::uint32_t, 3> cell{};
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const auto along = static_cast<Eigen::Index>(axis);
            cell[axis] =
                std::min(static_cast<std::uint32_t>((cloud.points[index][along] - box.low[along]) * scale), cells - 1);
        }
        places[i] = {curve_of(cell), index};
    });
    tbb::parallel_sort(places);
    const std::size_t shown = std::min(places.size(), most);
    for (std::size_t i = 0; i < shown; ++i)
        places[i] = places[i * places.size() / shown];
    places.resize(shown);
    return places;
}

/// Differences of numbers of 16 or 24 bits, folded so that small ones of either sign have zero high bytes, in planes of
/// bytes, low ones first.
void append_planes(std::string& bytes, const std::vector<std::uint32_t>& values, int planes = 2) {
    const std::size_t at = bytes.size(), count = values.size();
    bytes.resize(at + static_cast<std::size_t>(planes) * count);
    const int unused = 32 - 8 * planes;
    std::uint32_t before = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const auto apart = static_cast<std::int32_t>((values[i] - before) << unused) >> unused;
        const auto folded = static_cast<std::uint32_t>(apart < 0 ? -2 * apart - 1 : 2 * apart);
        for (int plane = 0; plane < planes; ++plane)
            bytes[at + static_cast<std::size_t>(plane) * count + i] = static_cast<char>(folded >> (8 * plane));
        before = values[i];
    }
}

/// Differences of bytes, point by point.
template <class Value>
void append_differences(std::string& bytes, std::span<const CurvePlace> chunk, Value&& value) {
    std::uint8_t before = 0;
    for (const CurvePlace& place : chunk) {
        const std::uint8_t now = value(place.index);
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
    std::vector<std::uint64_t> counts = {}; ///< of the values 0 .. 255, where there is room for them

    static constexpr double steps = 65534;
    /// 3e38 and the like mark what is not known, as in coordinates.
    [[nodiscard]] static bool is_known(double value) { return std::abs(value) <= 1e30; }
    void take(double value) {
        holes = holes || !is_known(value);
        low = is_known(value) ? std::min(low, value) : low;
        high = is_known(value) ? std::max(high, value) : high;
        if (!counts.empty() && value >= 0 && value < static_cast<double>(counts.size()))
            ++counts[static_cast<std::size_t>(value)];
    }
    void join(const Scale& other) {
        low = std::min(low, other.low), high = std::max(high, other.high);
        holes = holes || other.holes;
        for (std::size_t i = 0; i < counts.size(); ++i)
            counts[i] += other.counts[i];
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
std::vector<Scale> scales_of(const Points& cloud, std::span<const CurvePlace> shown) {
    std::vector<Scale> none(std::min(cloud.fields.size(), most_fields));
    for (std::size_t i = 0; i < none.size(); ++i) {
        none[i].whole = cloud.fields[i].whole;
        none[i].counts.resize(none[i].whole ? 256 : 0);
    }
    if (none.empty())
        return none;
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, shown.size()), none,
        [&](const tbb::blocked_range<std::size_t>& range, std::vector<Scale> scales) {
            std::vector<double> values(cloud.fields.size());
            for (std::size_t i = range.begin(); i < range.end(); ++i) {
                cloud.read(shown[i].index, values);
                for (std::size_t k = 0; k < scales.size(); ++k)
                    scales[k].take(values[k]);
            }
            return scales;
        },
        [](std::vector<Scale> a, const std::vector<Scale>& b) {
            for (std::size_t k = 0; k < a.size(); ++k)
                a[k].join(b[k]);
            return a;
        });
}

/// Names and scales of the fields that have a value anywhere, and how many points have each value of 0 .. 255.
json fields_json(const Points& cloud, const std::vector<Scale>& scales) {
    json fields = json::array();
    for (std::size_t k = 0; k < scales.size(); ++k) {
        const Scale& scale = scales[k];
        if (!scale.known())
            continue;
        fields.push_back({{"name", cloud.fields[k].name},
                          {"low", scale.low},
                          {"high", scale.high},
                          {"step", scale.step()},
                          {"whole", scale.whole}});
        if (!scale.whole || scale.low < 0 || scale.high > 255)
            continue;
        for (std::size_t value = 0; value < scale.counts.size(); ++value)
            if (scale.counts[value] > 0)
                fields.back()["counts"].push_back({value, scale.counts[value]});
    }
    return fields;
}

/// The codes of these fields, one text each; empty where all points have `low`.
std::string codes_text(const Points& cloud, const std::vector<Scale>& scales, std::span<const CurvePlace> chunk) {
    std::vector<std::vector<std::uint32_t>> codes(scales.size(), std::vector<std::uint32_t>(chunk.size()));
    std::vector<double> values(cloud.fields.size());
    for (std::size_t i = 0; i < chunk.size() && !scales.empty(); ++i) {
        cloud.read(chunk[i].index, values);
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

/// Bits along an axis of the node's box: 16 in the deepest nodes, and equal steps in all, as far as the curve's bits
/// go.
int bits_of(const OctreeNode& node, const Octree& tree) {
    return std::min(octree_bits, 16 + tree.deepest()) - node.level;
}

/// The positions in a node's box, as whole numbers of `bits` bits.
std::string positions_text(std::span<const CurvePlace> chunk, int level, int bits) {
    std::string bytes;
    std::vector<std::uint32_t> codes(chunk.size());
    for (std::size_t axis = 0; axis < 3; ++axis) {
        std::ranges::transform(chunk, codes.begin(), [&](const CurvePlace& place) {
            return cell_of(place.curve)[axis] >> (octree_bits - level - bits) & ((1U << bits) - 1);
        });
        append_planes(bytes, codes, bits > 16 ? 3 : 2);
    }
    return packed(bytes);
}

/// What points have besides their positions.
std::string parts_of(const Points& cloud, std::span<const CurvePlace> chunk) {
    std::string bytes, text;
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

/// The octree for the page: of each node its parent's number, octant, count and spacing.
json tree_json(const Octree& tree) {
    json nodes = json::array();
    for (const OctreeNode& node : tree.nodes)
        nodes.push_back({node.parent, node.octant, node.count, std::stod(fmt::format("{:.4g}", node.spacing))});
    return nodes;
}

} // namespace

std::vector<fs::path> write_points(const fs::path& folder, const fs::path& stem, const Points& cloud,
                                   std::size_t most) {
    const Box box = box_of(cloud.points);
    std::size_t in_box = 0;
    const std::vector<CurvePlace> places = along_curve(cloud, box, most, in_box);
    if (places.empty())
        return {};
    const std::size_t finite =
        indices_where(cloud.points.size(), [&](std::size_t i) { return cloud.points[i].allFinite(); }).size();
    const Octree tree = octree_of(places, box.edge(), [&](std::uint32_t a, std::uint32_t b) {
        return (cloud.points[a] - cloud.points[b]).norm();
    });
    const std::vector<Scale> scales = scales_of(cloud, places);
    const json facts{{"tree", tree_json(tree)},
                     {"total", places.size()},
                     {"of", finite},
                     {"left_out", finite - in_box},
                     {"up", {cloud.up.x(), cloud.up.y(), cloud.up.z()}},
                     {"cube", {box.low.x(), box.low.y(), box.low.z(), box.edge()}},
                     {"fields", fields_json(cloud, scales)},
                     {"more_fields", cloud.fields.size() - scales.size()}};
    std::vector<fs::path> files(tree.nodes.size());
    for (std::size_t part = 0; part < files.size(); ++part)
        files[part] = fmt::format("{}.{:03}.js", stem.string(), part);
    const auto write = [&](std::size_t part) {
        const OctreeNode& node = tree.nodes[part];
        const std::vector<CurvePlace> chunk = tree.own(node, places);
        const int bits = bits_of(node, tree);
        write_atomically(folder / files[part],
                         fmt::format("scanshade.points({{\"part\":{},\"count\":{},\"bits\":{}{},\"positions\":\"{}\"{},"
                                     "\"codes\":[{}]}})\n",
                                     part, chunk.size(), bits,
                                     part == 0 ? ",\"facts\":" + for_script(json_line(facts)) : "",
                                     positions_text(chunk, node.level, bits), parts_of(cloud, chunk),
                                     codes_text(cloud, scales, chunk)));
    };
    try {
        tbb::parallel_for(std::size_t(1), files.size(), write);
        write(0); // where the first file is, all are
    } catch (...) {
        for (const fs::path& file : files) {
            std::error_code gone_already;
            fs::remove(folder / file, gone_already);
        }
        throw;
    }
    return files;
}

} // namespace scanshade::page
