// Where a scanner stood: what files of several scans say of each.
#pragma once

#include <cstddef>
#include <Eigen/Core>

namespace scanshade {

/// It recorded the points from number `first` on, up to the next station's.
struct Station {
    std::size_t first = 0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero(); ///< in the coordinates of the points
};

} // namespace scanshade
