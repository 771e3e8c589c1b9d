#include "projection/pixel_cloud.h"

#include "projection/base/comb.h"
#include "projection/base/line_fit.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

namespace scanshade {
namespace {

constexpr std::size_t fewest_points = 1000;

struct Rays {
    std::vector<double> x, y; ///< at z = 1 or, flipped, -1
    bool flipped = false;
};

/// Nothing where points lie before and behind the origin.
std::optional<Rays> rays_of(std::span<const Eigen::Vector3d> points) {
    Rays rays;
    for (const Eigen::Vector3d& point : points) {
        if (!point.allFinite() || point.isZero())
            continue;
        const bool behind = point.z() < 0;
        if (point.z() == 0 || (!rays.x.empty() && behind != rays.flipped))
            return std::nullopt;
        rays.flipped = behind;
        rays.x.push_back(point.x() / std::abs(point.z()));
        rays.y.push_back((behind ? -point.y() : point.y()) / std::abs(point.z()));
    }
    return rays.x.size() >= fewest_points ? std::optional(std::move(rays)) : std::nullopt;
}

/// Of the steps from each point to the next, what most steps along rows are, and what those across them are where a row
/// ends. 0 where the points come in no such rows.
struct Pitches {
    double x = 0, y = 0;
};
Pitches pitches_along(const std::vector<double>& along, const std::vector<double>& across) {
    constexpr double in_row = 0.2, next_row = 20;
    std::vector<double> steps, sideways;
    for (std::size_t i = 1; i < along.size(); ++i) {
        steps.push_back(std::abs(along[i] - along[i - 1]));
        sideways.push_back(std::abs(across[i] - across[i - 1]));
    }
    const double step = median(steps);
    if (!(median(sideways) < in_row * step))
        return {};
    std::vector<double> ends;
    for (std::size_t i = 0; i < steps.size(); ++i)
        if (steps[i] > next_row * step)
            ends.push_back(sideways[i]);
    return {step, ends.empty() ? 0 : median(std::move(ends))};
}

/// Row by row or column by column.
Pitches pitches(const Rays& rays) {
    const Pitches rows = pitches_along(rays.x, rays.y);
    if (rows.x > 0)
        return rows;
    const Pitches columns = pitches_along(rays.y, rays.x);
    return {columns.y, columns.x};
}

/// By some of the points, side by side, so that other clouds cost next to nothing.
bool comes_in_rows(std::span<const Eigen::Vector3d> points) {
    constexpr std::size_t places = 32, run = 128;
    if (points.size() < fewest_points)
        return false;
    std::vector<Eigen::Vector3d> some;
    for (std::size_t place = 0; place < places; ++place)
        for (const Eigen::Vector3d& point : points.subspan(place * (points.size() - run) / (places - 1), run))
            some.push_back(point);
    const std::optional<Rays> rays = rays_of(some);
    if (!rays)
        return false;
    const Pitches found = pitches(*rays);
    return found.x > 0 || found.y > 0;
}

/// Pixels by tangents along one axis.
struct Axis {
    Line line; ///< pixel = slope * tangent + offset; the first pixel is 0
    double squares = 0;
    int pixels = 0;

    [[nodiscard]] int pixel(double tangent) const { return static_cast<int>(std::lround(line.at(tangent))); }
};

/// The number of pixels per unit of tangent, near a guess, at which most tangents are at the same place in their pixel.
/// Nothing where they are anywhere.
std::optional<Comb> comb_of(const std::vector<double>& tangents, double guess, double extent) {
    constexpr std::size_t sample = 2048;
    constexpr double search = 0.1, fine = 0.15, alike = 0.8;
    std::vector<double> some;
    for (std::size_t i = 0; i < sample; ++i) { // even steps would meet every tenth column only
        const double turns = static_cast<double>(i) * (std::numbers::phi - 1);
        some.push_back(
            tangents[static_cast<std::size_t>((turns - std::floor(turns)) * static_cast<double>(tangents.size()))]);
    }
    Comb best;
    const double step = fine / extent;
    for (double per_unit = (1 - search) * guess; per_unit <= (1 + search) * guess; per_unit += step)
        if (const Comb comb = comb_at(some, per_unit); comb.alike > best.alike)
            best = comb;
    return best.alike > alike ? std::optional(best) : std::nullopt;
}

std::optional<Axis> axis_of(const std::vector<double>& tangents, double pitch) {
    constexpr int largest = 16384, smallest = 16;
    const auto [low, high] = std::ranges::minmax(tangents);
    if (!(pitch > 0) || !(high > low) || (high - low) / pitch > largest)
        return std::nullopt;
    const std::optional<Comb> comb = comb_of(tangents, 1 / pitch, high - low);
    if (!comb)
        return std::nullopt;
    Axis axis{.line = {comb->per_unit, -comb->place}};
    for (int round = 0; round < 2; ++round) {
        LineFit fit;
        for (const double tangent : tangents)
            fit.add(tangent, axis.pixel(tangent));
        if (!fit.determined())
            return std::nullopt;
        axis.line = fit.line();
    }
    if (!(axis.line.slope > 0))
        return std::nullopt;
    axis.line.offset -= axis.pixel(low);
    axis.pixels = axis.pixel(high) + 1;
    for (const double tangent : tangents)
        axis.squares += std::pow(axis.line.residual(tangent, axis.pixel(tangent)), 2);
    return axis.pixels >= smallest && axis.pixels <= largest ? std::optional(axis) : std::nullopt;
}

/// Whether hardly two points share a pixel, and most have another beside them.
bool are_pixels(const Rays& rays, const Axis& u, const Axis& v) {
    constexpr double most_shared = 0.001, fewest_beside = 0.8;
    constexpr std::size_t most_pixels = 50; // per point: an image that is nearly all holes is none
    const std::size_t pixels = static_cast<std::size_t>(u.pixels) * static_cast<std::size_t>(v.pixels);
    if (pixels > most_pixels * rays.x.size())
        return false;
    std::vector<std::uint32_t> taken(pixels);
    const auto at = [&](std::size_t i) {
        return static_cast<std::size_t>(v.pixel(rays.y[i])) * static_cast<std::size_t>(u.pixels) +
               static_cast<std::size_t>(u.pixel(rays.x[i]));
    };
    std::size_t shared = 0, beside = 0;
    for (std::size_t i = 0; i < rays.x.size(); ++i)
        shared += taken[at(i)]++ > 0;
    for (std::size_t i = 0; i < rays.x.size(); ++i)
        beside += at(i) + 1 < taken.size() && taken[at(i) + 1] > 0;
    const auto all = static_cast<double>(rays.x.size());
    return static_cast<double>(shared) <= most_shared * all && static_cast<double>(beside) >= fewest_beside * all;
}

} // namespace

double middle_depth(const Cloud& cloud) {
    constexpr std::size_t enough = 1 << 16;
    std::vector<double> some;
    for (std::size_t i = 0; i < cloud.points.size(); i += std::max<std::size_t>(1, cloud.points.size() / enough))
        if (const Eigen::Vector3d& point = cloud.points[i]; point.allFinite() && point.z() != 0)
            some.push_back(std::abs(point.z()));
    return median(std::move(some), 0);
}

std::optional<PixelCloud> pixel_cloud(const Cloud& cloud) {
    constexpr double worst_rms_px = 0.2; // 0.29 of points anywhere
    if (cloud.organised())
        return std::nullopt;
    if (!comes_in_rows(cloud.points))
        return std::nullopt;
    const std::optional<Rays> rays = rays_of(cloud.points);
    if (!rays)
        return std::nullopt;
    const auto [pitch_x, pitch_y] = pitches(*rays);
    const std::optional<Axis> u = axis_of(rays->x, pitch_x), v = u ? axis_of(rays->y, pitch_y) : std::nullopt;
    if (!v || !are_pixels(*rays, *u, *v))
        return std::nullopt;
    const auto points = static_cast<double>(rays->x.size());
    const double rms_px = std::sqrt((u->squares + v->squares) / points);
    if (!(rms_px <= worst_rms_px))
        return std::nullopt;
    return PixelCloud{{{u->line.slope, v->line.slope, u->line.offset, v->line.offset, {u->pixels, v->pixels}},
                       rms_px,
                       static_cast<int>(rays->x.size())},
                      rays->flipped};
}

} // namespace scanshade
