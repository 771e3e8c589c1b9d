// Clouds of simple shapes, and the measures that tests of clouds take.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <Eigen/Core>
#include <numbers>
#include <numeric>
#include <vector>

namespace scanshade::tests {

using Points = std::vector<Eigen::Vector3d>;

/// Random numbers that are the same on every machine.
class Dice {
  public:
    explicit Dice(std::uint64_t seed = 42) : state_(seed) {}
    /// 0 .. 1
    double roll() {
        return static_cast<double>((state_ = state_ * 6364136223846793005ULL + 1442695040888963407ULL) >> 11) * 0x1p-53;
    }
    /// Of a normal distribution with sigma 1 (Box and Muller 1958).
    double gauss() { return std::sqrt(-2 * std::log(1 - roll())) * std::cos(2 * std::numbers::pi * roll()); }

  private:
    std::uint64_t state_;
};

/// A square of side 2 about the origin in the plane z = 0, with noise across it.
inline Points square(std::size_t count, double sigma = 0) {
    Dice dice;
    Points points(count);
    for (Eigen::Vector3d& p : points) {
        p = {2 * dice.roll() - 1, 2 * dice.roll() - 1, 0};
        if (sigma > 0)
            p.z() = sigma * dice.gauss();
    }
    return points;
}

/// Floor z = 0 and wall x = 0, each 2 wide; the scanner stands in the corner's opening.
inline Points corner(std::size_t count, double sigma = 0) {
    Dice dice;
    Points points(count);
    for (std::size_t i = 0; i < count; ++i) {
        const double along = 2 * dice.roll(), away = 2 * dice.roll(), off = sigma > 0 ? sigma * dice.gauss() : 0;
        points[i] = i % 2 ? Eigen::Vector3d(away, along, off) : Eigen::Vector3d(off, along, away);
    }
    return points;
}

/// Of radius 1, evenly spread.
inline Points sphere(std::size_t count, const Eigen::Vector3d& centre) {
    Points points;
    for (std::size_t i = 0; i < count; ++i) {
        const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(count);
        const double turn = static_cast<double>(i) * std::numbers::pi * (3 - std::sqrt(5.0)),
                     across = std::sqrt(1 - z * z);
        points.push_back(centre + Eigen::Vector3d(across * std::cos(turn), across * std::sin(turn), z));
    }
    return points;
}

inline double mean(const std::vector<float>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// Over the values that both have.
inline double rms_between(const std::vector<float>& a, const std::vector<float>& b) {
    double squares = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
        if (!std::isnan(a[i]) && !std::isnan(b[i])) {
            squares += std::pow(static_cast<double>(a[i]) - static_cast<double>(b[i]), 2);
            ++count;
        }
    return std::sqrt(squares / static_cast<double>(count));
}

} // namespace scanshade::tests
