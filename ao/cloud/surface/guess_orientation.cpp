// The orientation of a cloud's normals, guessed from where its points can be seen.
#include "ao/cloud/surface/cloud_surface.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>
#include <fmt/format.h>
#include <limits>
#include <numbers>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr std::size_t enough_to_judge = 200000;

/// Of these, so many that tell enough.
std::vector<Vector3d> some_of(std::span<const Vector3d> points) {
    const std::size_t step = std::max<std::size_t>(1, points.size() / enough_to_judge);
    std::vector<Vector3d> some;
    for (std::size_t i = 0; i < points.size(); i += step)
        if (points[i].allFinite())
            some.push_back(points[i]);
    return some;
}

/// Measures of a cloud as seen from one position.
struct ViewFrom {
    double seen_first = 0;  ///< share of points with nothing clearly in front of them
    double off_centre = 0;  ///< distance of the middle from the position / the cloud's radius
    double range_ratio = 1; ///< far points' distance / near points' distance (95 % and 5 %)
};

/// A cloud in polar coordinates about a position, without points at the position itself.
class PolarView {
  public:
    PolarView(const Vector3d& position, std::span<const Vector3d> points) : seen_(points.size()) {
        tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
            const Vector3d point = points[i] - position;
            const double range = point.norm();
            seen_[i] = {point, range, std::atan2(point.y(), point.x()) / (2 * std::numbers::pi) + 0.5,
                        std::acos(std::clamp(point.z() / range, -1.0, 1.0)) / std::numbers::pi};
        });
        std::erase_if(seen_, [](const Seen& seen) { return !(seen.range > 0); });
        if (seen_.empty())
            return;
        Vector3d sum = Vector3d::Zero();
        for (const Seen& seen : seen_)
            sum += seen.point;
        const auto count = static_cast<double>(seen_.size());
        const Vector3d middle = sum / count;
        double radius2 = 0;
        for (const Seen& seen : seen_)
            radius2 += (seen.point - middle).squaredNorm();
        radius_ = std::sqrt(radius2 / count);
        off_centre_ = radius_ > 0 ? middle.norm() / radius_ : 0;
        std::vector<double> ranges(seen_.size());
        std::transform(seen_.begin(), seen_.end(), ranges.begin(), [](const Seen& seen) { return seen.range; });
        const double near = quantile(ranges, 0.05);
        range_ratio_ = quantile(ranges, 0.95) / near;
    }

    /// In cells that hold two points or more; nothing where hardly any points, or fewer than `fewest`, are in such
    /// cells.
    [[nodiscard]] std::optional<ViewFrom> in_cells(double cell_degrees, std::size_t fewest) const {
        const auto columns = static_cast<int>(360 / cell_degrees), rows = static_cast<int>(180 / cell_degrees);
        struct Direction {
            float nearest = std::numeric_limits<float>::infinity();
            int points = 0;
        };
        std::vector<Direction> cells(static_cast<std::size_t>(columns * rows));
        const auto cell = [=](const Seen& seen) {
            return static_cast<std::size_t>(std::min(static_cast<int>(seen.tilt * rows), rows - 1) * columns +
                                            std::min(static_cast<int>(seen.turn * columns), columns - 1));
        };
        for (const Seen& seen : seen_) {
            Direction& here = cells[cell(seen)];
            here.nearest = std::min(here.nearest, static_cast<float>(seen.range));
            ++here.points;
        }
        std::size_t first = 0, judged = 0;
        for (const Seen& seen : seen_)
            if (const Direction& here = cells[cell(seen)]; here.points > 1) {
                // More means a second surface. The back of a small thing far away is hardly farther than its front.
                const auto nearest = static_cast<double>(here.nearest);
                first += seen.range <= nearest + std::min(0.25 * nearest, 0.5 * radius_);
                ++judged;
            }
        if (10 * judged < seen_.size() || judged < fewest)
            return std::nullopt;
        return ViewFrom{static_cast<double>(first) / static_cast<double>(judged), off_centre_, range_ratio_};
    }

  private:
    struct Seen {
        Vector3d point; ///< from the position
        double range, turn, tilt;
    };
    std::vector<Seen> seen_;
    double radius_ = 0, off_centre_ = 0, range_ratio_ = 1;
};

/// In the smallest cells that tell. Wider ones hold near and far surfaces of the same view, and a few points in them
/// are seen first from anywhere.
ViewFrom view_from(const Vector3d& position, std::span<const Vector3d> points) {
    const PolarView polar(position, points);
    for (const double degrees : {0.5, 1.0, 1.5})
        if (const std::optional<ViewFrom> view = polar.in_cells(degrees, degrees > 0.5 ? 1000 : 1))
            return *view;
    return {};
}

/// Share of the points that are seen from straight above, in cells of about four.
double seen_from_above(std::span<const Vector3d> points) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& point : points)
        box.extend(point);
    const std::size_t count = points.size();
    if (count == 0 || !(box.sizes().x() > 0) || !(box.sizes().y() > 0))
        return 0;
    const double side = std::sqrt(4 * box.sizes().x() * box.sizes().y() / static_cast<double>(count));
    const auto columns = static_cast<std::size_t>(box.sizes().x() / side) + 1;
    const auto rows = static_cast<std::size_t>(box.sizes().y() / side) + 1;
    if (columns * rows > 4 * enough_to_judge) // a cloud as thin as a wall
        return 0;
    std::vector<double> top(columns * rows, -std::numeric_limits<double>::infinity());
    const auto cell = [&](const Vector3d& p) {
        return static_cast<std::size_t>((p.y() - box.min().y()) / side) * columns +
               static_cast<std::size_t>((p.x() - box.min().x()) / side);
    };
    for (const Vector3d& point : points)
        top[cell(point)] = std::max(top[cell(point)], point.z());
    std::size_t seen = 0;
    for (const Vector3d& point : points)
        seen += point.z() > top[cell(point)] - 3 * side;
    return static_cast<double>(seen) / static_cast<double>(count);
}

} // namespace

NormalOrientation guessed_orientation(std::span<const Vector3d> all, const std::optional<Vector3d>& recorded,
                                      bool z_up) {
    const std::vector<Vector3d> points = some_of(all);
    constexpr double nearly_all = 0.975, clearly_off = 0.5, many_ranges = 3;
    constexpr double too_far = 20; // radii of the cloud: from so far off, few points hide others anyway
    constexpr double most = 0.85;
    if (recorded)
        if (const ViewFrom view = view_from(*recorded, points); view.seen_first >= most && view.off_centre < too_far)
            return {NormalOrientation::Kind::viewpoint, *recorded,
                    fmt::format("the recorded viewpoint, from where {:.0f} % of the points are seen first",
                                100 * view.seen_first)};
    const ViewFrom view = view_from(Vector3d::Zero(), points);
    if (view.seen_first >= nearly_all && view.off_centre < too_far &&
        (view.off_centre > clearly_off || view.range_ratio > many_ranges))
        return {NormalOrientation::Kind::viewpoint, Vector3d::Zero(),
                fmt::format("the origin of the coordinates, from where {:.0f} % of the points are seen first",
                            100 * view.seen_first)};
    // Surveyors' formats have z up: what a plane scans, plants over ground among it, is seen from above.
    constexpr double scanned_from_above = 0.4;
    if (const double above = seen_from_above(points); above >= (z_up ? scanned_from_above : most))
        return {NormalOrientation::Kind::terrain, Vector3d::UnitZ(),
                fmt::format("up along z, as of terrain: {:.0f} % of the points have nothing above them", 100 * above)};
    return {};
}

} // namespace scanshade
