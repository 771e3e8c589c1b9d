// A part of a cloud whose points pass by, chosen by a hash of their numbers: the same however the points are ordered in
// blocks.
#pragma once

#include "projection/base/hash.h"

#include <algorithm>
#include <cstdint>
#include <Eigen/Core>
#include <vector>

namespace scanshade {

/// Holds the points with the lowest hashes.
class CloudSample {
  public:
    struct Point {
        std::uint32_t number, hash;
        Eigen::Vector3d point;
        Eigen::Vector3f normal;
    };
    /// Of `all` points.
    CloudSample(std::size_t enough, std::size_t all) : enough_(enough) { points_.reserve(std::min(all, most())); }

    void add(std::uint32_t number, const Eigen::Vector3d& point, const Eigen::Vector3f& normal) {
        const std::uint32_t by = hash(number);
        ++seen_;
        if (by >= below_)
            return;
        points_.push_back({number, by, point, normal});
        if (points_.size() >= most())
            thin();
    }
    /// Points that passed by.
    [[nodiscard]] std::size_t seen() const { return seen_; }
    /// The sample, by number. A point is in it if its hash is below below().
    [[nodiscard]] const std::vector<Point>& by_number() {
        if (points_.size() > enough_)
            thin();
        std::sort(points_.begin(), points_.end(), [](const Point& a, const Point& b) { return a.number < b.number; });
        return points_;
    }
    [[nodiscard]] std::uint64_t below() const { return below_; }

  private:
    [[nodiscard]] std::size_t most() const { return enough_ + enough_ / 2; } ///< in memory
    void thin() {
        const auto place = points_.begin() + static_cast<std::ptrdiff_t>(enough_);
        std::nth_element(points_.begin(), place, points_.end(),
                         [](const Point& a, const Point& b) { return a.hash < b.hash; });
        below_ = place->hash;
        std::erase_if(points_, [&](const Point& each) { return each.hash >= below_; });
    }

    std::size_t enough_, seen_ = 0;
    std::uint64_t below_ = std::uint64_t(1) << 32;
    std::vector<Point> points_;
};

} // namespace scanshade
