#include "ao/horizon/tables.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace scanshade::horizon {

namespace {

constexpr double two_pi = 2 * std::numbers::pi;

/// Up to this distance, the surface is looked at in the middle of squares, too. Within a square the slope is
/// h0 / t + b + c t and may be largest between its ends, by c times the square of their distance over 4 t at most.
constexpr double near_cells = 2;

/// A ray in units of cells: x to the east, y to the south.
class Path {
  public:
    Path(double azimuth, double scale, std::ptrdiff_t stride)
        : x_(std::sin(azimuth)), y_(-std::cos(azimuth)), scale_(scale), stride_(stride) {}

    /// The square between two distances.
    [[nodiscard]] std::ptrdiff_t corner(double t0, double t1) const {
        const double t = (t0 + t1) / 2;
        return cell(std::floor(x_ * t), std::floor(y_ * t));
    }
    [[nodiscard]] std::ptrdiff_t cell(double x, double y) const {
        return static_cast<std::ptrdiff_t>(y) * stride_ + static_cast<std::ptrdiff_t>(x);
    }

    /// The slope in the direction of the ray at its very beginning.
    [[nodiscard]] Sample limit() const {
        Sample sample;
        sample.a = x_ > 0 ? 1 : -1;
        sample.b = y_ > 0 ? stride_ : -stride_;
        sample.weight_a = static_cast<float>(std::abs(x_) * scale_);
        sample.weight_b = static_cast<float>(std::abs(y_) * scale_);
        return sample;
    }
    /// Where the ray crosses column `x`, between two rows.
    [[nodiscard]] Sample at_column(int x) const {
        const auto [row, share] = split(y_ * (x / x_));
        return at(x / x_, cell(x, row), cell(x, share > 0 ? row + 1 : row), share);
    }
    [[nodiscard]] Sample at_row(int y) const {
        const auto [column, share] = split(x_ * (y / y_));
        return at(y / y_, cell(column, y), cell(share > 0 ? column + 1 : column, y), share);
    }
    [[nodiscard]] InnerSample inside(double t, std::ptrdiff_t corner) const {
        const double x = x_ * t - std::floor(x_ * t), y = y_ * t - std::floor(y_ * t), unit = scale_ / t;
        return {corner,
                static_cast<float>((1 - x) * (1 - y) * unit),
                static_cast<float>(x * (1 - y) * unit),
                static_cast<float>((1 - x) * y * unit),
                static_cast<float>(x * y * unit),
                static_cast<float>(t)};
    }
    [[nodiscard]] double x() const { return x_; }
    [[nodiscard]] double y() const { return y_; }

  private:
    /// A whole number and the rest; a crossing of both lines at one point has no rest.
    static std::pair<double, double> split(double value) {
        constexpr double least = 1e-9;
        const double nearest = std::nearbyint(value);
        return std::abs(value - nearest) < least ? std::pair(nearest, 0.0)
                                                 : std::pair(std::floor(value), value - std::floor(value));
    }
    [[nodiscard]] Sample at(double t, std::ptrdiff_t a, std::ptrdiff_t b, double share) const {
        Sample sample;
        sample.a = a, sample.b = b;
        sample.weight_a = static_cast<float>((1 - share) * scale_ / t);
        sample.weight_b = static_cast<float>(share * scale_ / t);
        sample.t = static_cast<float>(t);
        return sample;
    }

    double x_, y_, scale_;
    std::ptrdiff_t stride_;
};

struct Crossing {
    double t;
    Sample sample;
};

/// All crossings with lines of the grid between two distances, in order.
std::vector<Crossing> crossings_of(const Path& path, double from, double radius) {
    std::vector<Crossing> found;
    const auto add = [&](double step, const auto& sample_at) {
        const int sign = step > 0 ? 1 : -1;
        for (int i = 1; i / std::abs(step) <= radius; ++i)
            if (const double t = i / std::abs(step); t > from)
                found.push_back({t, sample_at(sign * i)});
    };
    add(path.x(), [&](int x) { return path.at_column(x); });
    add(path.y(), [&](int y) { return path.at_row(y); });
    std::ranges::stable_sort(found, {}, &Crossing::t);
    return found;
}

Ray ray_of(double azimuth, double radius, double from, double scale, std::ptrdiff_t stride) {
    const Path path(azimuth, scale, stride);
    Ray ray;
    ray.azimuth = azimuth;
    ray.stride = stride;
    ray.east = static_cast<float>(path.x()), ray.north = static_cast<float>(-path.y());
    const std::vector<Crossing> crossings = crossings_of(path, from, radius);
    std::vector<double> distances;
    if (from == 0) {
        ray.samples.push_back(path.limit());
        distances.push_back(0);
    }
    for (const Crossing& crossing : crossings) {
        ray.samples.push_back(crossing.sample);
        distances.push_back(crossing.t);
    }
    for (std::size_t i = 0; i < distances.size(); ++i) {
        const double before = i > 0 ? distances[i - 1] : from;
        const double behind = i + 1 < distances.size() ? distances[i + 1] : radius;
        // At the very beginning and end of the search both are the one square that the ray is in.
        Sample& sample = ray.samples[i];
        sample.behind = behind > distances[i] ? path.corner(distances[i], behind) : path.corner(before, distances[i]);
        sample.before = before < distances[i] ? path.corner(before, distances[i]) : sample.behind;
        // Two lines crossed at one point have no square between them.
        constexpr double least = 1e-6;
        const double middle = (distances[i] + behind) / 2;
        if (distances[i] > 0 && distances[i] < near_cells && behind - distances[i] > least)
            ray.inner.push_back(path.inside(middle, sample.behind));
    }
    const double last = distances.empty() ? from : distances.back();
    const double first = distances.empty() ? radius : distances.front();
    if (from > 0)
        ray.inner.insert(ray.inner.begin(), path.inside(from, path.corner(from, first)));
    if (radius > last)
        ray.inner.push_back(path.inside(radius, path.corner(last, radius)));
    for (std::size_t i = 0; i < ray.samples.size(); ++i)
        ray.steps.push_back({false, i, ray.samples[i].t});
    for (std::size_t i = 0; i < ray.inner.size(); ++i)
        ray.steps.push_back({true, i, ray.inner[i].t});
    std::ranges::stable_sort(ray.steps, {}, &Step::t);
    return ray;
}

} // namespace

std::vector<Ray> rays_of(int directions, double radius, double from, double scale, std::ptrdiff_t stride) {
    std::vector<Ray> rays;
    for (int k = 0; k < directions; ++k)
        rays.push_back(ray_of((k + 0.5) * two_pi / directions, radius, from, scale, stride));
    return rays;
}

std::vector<std::vector<Offset>> rvt_offsets(int directions, int radius, int from, std::ptrdiff_t stride) {
    std::vector<std::vector<Offset>> all;
    for (int i = 0; i < directions; ++i) {
        // As RVT rounds: ties at multiples of 30 degrees follow the last bit of these products.
        const double angle = two_pi / directions * i, c = std::cos(angle), s = std::sin(angle);
        std::set<std::pair<int, int>> seen;
        std::vector<Offset> offsets;
        for (int k = 0; k / 3.0 + from <= radius; ++k) {
            const double r = k / 3.0 + from;
            const int up = static_cast<int>(std::nearbyint(r * c)), left = static_cast<int>(std::nearbyint(r * s));
            if (seen.emplace(up, left).second)
                offsets.push_back({-up * stride - left, static_cast<float>(1 / std::hypot(up, left))});
        }
        all.push_back(std::move(offsets));
    }
    return all;
}

int least_distance(double radius, Noise noise) {
    static constexpr std::array shares{0.0, 0.1, 0.2, 0.4};
    return std::max(1, static_cast<int>(std::nearbyint(radius * shares[static_cast<std::size_t>(noise)])));
}

} // namespace scanshade::horizon
