#include "projection/sensor/depth_ends.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace scanshade {
namespace {

constexpr int every_px = 3; // every third pixel of every third row is plenty

/// How many of the sampled pixels hold a depth.
struct Level {
    float z_m = 0;
    std::size_t count = 0;
};

bool piles_up(std::size_t count, std::size_t valid) {
    constexpr std::size_t fewest = 30;
    constexpr double least_share = 0.005;
    return count >= fewest && static_cast<double>(count) > least_share * static_cast<double>(valid);
}

std::vector<Level> levels_of(std::vector<float> depths) {
    std::ranges::sort(depths);
    std::vector<Level> levels;
    for (const float z : depths) {
        if (levels.empty() || levels.back().z_m != z)
            levels.push_back({z, 0});
        ++levels.back().count;
    }
    return levels;
}

/// The first of `levels`, which go from one end inwards.
std::optional<DepthEnd> end_of(const std::vector<Level>& levels, std::size_t valid) {
    constexpr std::size_t by_neighbour = 20, neighbours = 4;
    constexpr double stray = 0.002; // share of pixels in between, as at edges
    constexpr float apart = 1.25F;
    const Level& first = levels.front();
    if (!piles_up(first.count, valid))
        return std::nullopt;
    std::size_t inside = 0;
    for (std::size_t i = 1; i < levels.size(); ++i) {
        if (i <= neighbours && by_neighbour * levels[i].count > first.count)
            return std::nullopt;
        inside += levels[i].count;
        if (i < neighbours || static_cast<double>(inside) < stray * static_cast<double>(valid))
            continue;
        const auto [near, far] = std::minmax(first.z_m, levels[i].z_m);
        return DepthEnd{first.z_m, static_cast<double>(first.count) / static_cast<double>(valid), far > apart * near};
    }
    return std::nullopt; // hardly any others
}

/// The median second difference over this many pixels, of depth, where values differ at all, but not by an edge; 0 if
/// hardly any do.
float median_bend(const cv::Mat1f& z_m, int lag) {
    constexpr std::size_t enough = 100;
    constexpr float edge = 0.05F;
    std::vector<float> bends;
    for (int v = 0; v < z_m.rows; v += every_px) {
        const float* row = z_m[v];
        for (int u = lag; u + lag < z_m.cols; u += every_px) {
            const float a = row[u - lag], z = row[u], b = row[u + lag];
            if (a > 0 && z > 0 && b > 0 && !(a == z && z == b) && std::max(std::abs(a - z), std::abs(b - z)) < edge * z)
                bends.push_back(std::abs(a + b - 2 * z) / z);
        }
    }
    return bends.size() > enough ? median(std::move(bends)) : 0;
}

/// Whether values vary as a noisy sensor's do. Noise bends as much over a few pixels as over many; surfaces, whose
/// second differences grow with the square of the distance, do not.
bool is_noisy(const cv::Mat1f& z_m) {
    constexpr float least = 0.002F; // of depth
    constexpr float alike = 0.4F;
    const float few = median_bend(z_m, 2);
    return few > least && few > alike * median_bend(z_m, 6);
}

/// Numbers that programs write for "nothing": next to zero, 10, 20, 50, 100 ... metres, and the largest of 12 .. 16
/// bits of millimetres.
bool is_customary_mark(float z_m) {
    constexpr double alike = 1e-5;
    constexpr float next_to_zero = 0.05F;
    if (z_m < next_to_zero)
        return true;
    const auto is = [&](double value) { return std::abs(static_cast<double>(z_m) - value) < alike * value; };
    for (double power = 10; power <= 1e6; power *= 10)
        for (const int digit : {1, 2, 5})
            if (is(digit * power))
                return true;
    for (int bits = 12; bits <= 16; ++bits)
        if (std::abs(static_cast<double>(z_m) - ((1 << bits) - 1) / 1000.0) < 0.0011) // or the one before
            return true;
    return false;
}

/// Whether the pixels that hold this depth end raggedly, as where noise decides which are cut off: by the share of
/// those at the border that touch others on more than one side. Walls and tables have edges.
bool is_ragged(const cv::Mat1f& z_m, float value) {
    constexpr double least = 0.15; // 0.25 .. 0.5 of ranges cut off, 0.03 of walls
    std::size_t border = 0, ragged = 0;
    for (int v = 1; v + 1 < z_m.rows; ++v)
        for (int u = 1; u + 1 < z_m.cols; ++u) {
            if (z_m(v, u) != value)
                continue;
            int others = 0;
            for (const float next : {z_m(v, u - 1), z_m(v, u + 1), z_m(v - 1, u), z_m(v + 1, u)})
                others += next > 0 && next != value;
            border += others > 0;
            ragged += others > 1;
        }
    return static_cast<double>(ragged) > least * static_cast<double>(border);
}

} // namespace

DepthEnds depth_ends(const cv::Mat1f& z_m) {
    constexpr double least_share_cut = 0.02, much = 0.05;
    std::vector<float> depths;
    for (int v = 0; v < z_m.rows; v += every_px)
        for (int u = 0; u < z_m.cols; u += every_px)
            if (z_m(v, u) > 0)
                depths.push_back(z_m(v, u));
    const std::size_t valid = depths.size();
    if (valid == 0)
        return {};
    const auto [low, high] = std::ranges::minmax(depths);
    if (!piles_up(static_cast<std::size_t>(std::ranges::count(depths, low)), valid) &&
        !piles_up(static_cast<std::size_t>(std::ranges::count(depths, high)), valid))
        return {};
    std::vector<Level> levels = levels_of(std::move(depths));
    DepthEnds ends;
    ends.nearest = end_of(levels, valid);
    std::ranges::reverse(levels);
    ends.farthest = end_of(levels, valid);
    for (std::optional<DepthEnd>* end : {&ends.nearest, &ends.farthest})
        if (*end && !(((*end)->apart || (*end)->share > much) && is_customary_mark((*end)->z_m)) &&
            ((!(*end)->apart && (*end)->share < least_share_cut) || !is_noisy(z_m) || !is_ragged(z_m, (*end)->z_m)))
            end->reset();
    return ends;
}

} // namespace scanshade
