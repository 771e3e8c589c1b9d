#include "apps/doubts/coordinate_steps.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace scanshade {
namespace {

/// Values along one axis: how many differ, and by how much neighbouring ones do; 0 where hardly any repeat.
struct Axis {
    std::size_t distinct = 0;
    double step = 0;
    bool single_precision = false;
};

Axis along(std::span<const Eigen::Vector3d> points, std::size_t stride, int axis) {
    constexpr std::size_t least_repeated = 3; // points to a value
    constexpr double flat = 0.9;              // share of the points at one value: a plane and strays
    std::vector<double> values;
    for (std::size_t i = 0; i < points.size(); i += stride)
        if (points[i].allFinite())
            values.push_back(points[i][axis]);
    const std::size_t count = values.size();
    std::ranges::sort(values);
    std::size_t most_alike = 0, first = 0;
    for (std::size_t i = 0; i < count; ++i) {
        if (values[i] != values[first])
            first = i;
        most_alike = std::max(most_alike, i - first + 1);
    }
    values.erase(std::unique(values.begin(), values.end()), values.end());
    Axis found{.distinct = values.size()};
    if (values.size() < 3 || least_repeated * values.size() > count ||
        static_cast<double>(most_alike) > flat * static_cast<double>(count))
        return found;
    std::vector<double> gaps;
    for (std::size_t i = 1; i < values.size(); ++i)
        gaps.push_back(values[i] - values[i - 1]);
    const auto largest = static_cast<float>(std::max(std::abs(values.front()), std::abs(values.back())));
    const double last_bit = static_cast<double>(std::nextafter(largest, std::numeric_limits<float>::infinity())) -
                            static_cast<double>(largest);
    found.step = median(std::move(gaps));
    found.single_precision = std::abs(found.step - last_bit) < 0.01 * last_bit;
    return found;
}

} // namespace

std::optional<CoordinateSteps> coarse_steps(std::span<const Eigen::Vector3d> points, double spacing) {
    constexpr std::size_t enough = 1000, most = 100000;
    constexpr double coarse = 0.5;    // in spacings
    constexpr double very_coarse = 4; // no profile scanner's
    constexpr double by_precision = 0.3;
    constexpr double most_in_cell = 1.5; // of a grid's cells, which hold one point each
    if (points.size() < enough || !(spacing > 0) || !std::isfinite(spacing))
        return std::nullopt;
    const std::size_t stride = (points.size() + most - 1) / most;
    std::array<Axis, 3> axes;
    for (int axis = 0; axis < 3; ++axis)
        axes[static_cast<std::size_t>(axis)] = along(points, stride, axis);
    const auto stepped =
        static_cast<int>(std::ranges::count_if(axes, [&](const Axis& a) { return a.step > coarse * spacing; }));
    double cells = 1;
    for (const Axis& axis : axes)
        if (axis.step > coarse * spacing)
            cells *= static_cast<double>(axis.distinct);
    const bool one_a_cell = static_cast<double>(points.size()) / static_cast<double>(stride) <= most_in_cell * cells;
    const bool grid_of_heights = stepped == 2 && one_a_cell;
    const auto largest = std::ranges::max_element(axes, {}, &Axis::step);
    const bool precision = largest->single_precision && largest->step > by_precision * spacing;
    if (grid_of_heights ||
        !(stepped == 3 || (stepped == 2 && !one_a_cell) || largest->step > very_coarse * spacing || precision))
        return std::nullopt;
    constexpr double alike = 0.01;
    const bool in_all = std::ranges::all_of(
        axes, [&](const Axis& axis) { return std::abs(axis.step - largest->step) < alike * largest->step; });
    return CoordinateSteps{static_cast<int>(largest - axes.begin()), largest->step, largest->single_precision, in_all};
}

} // namespace scanshade
