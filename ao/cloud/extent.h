// Where a cloud lies, and which of its points are strays.
#pragma once

#include "ao/cloud/surface/cloud_surface.h"

#include <Eigen/Core>
#include <span>
#include <vector>

namespace scanshade {

/// The position and size of a cloud, whatever lies far from it.
struct Extent {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(); ///< the median along each axis
    double size = 0; ///< the diagonal of the box that holds all but the lowest and highest hundredth along each axis
    double farthest = 0; ///< from the centre: what lies beyond is not part of the cloud
};

/// Of a sample of the points, which must be finite. Points whose sixth neighbour in the sample is farther from them
/// than a tenth of their distance from the centre are left out. Beyond 98 % of the rest, the first that lies more than
/// twice as far from the centre as the one before ends the cloud.
[[nodiscard]] Extent extent_of(std::span<const Eigen::Vector3d> sample);

/// Takes the discs of strays within the surface, so that they occlude nothing: points whose sixth neighbour is four
/// times farther than those neighbours' own. Returns the indices of lonely ones, for which nothing tells a surface.
/// Their sixth neighbour is farther than 8 spacings and a tenth of their distance from the centre.
std::vector<std::uint32_t> drop_strays(CloudSurface& surface, const Eigen::Vector3d& centre, double spacing);

} // namespace scanshade
