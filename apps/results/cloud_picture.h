// A picture of a cloud without a camera: two views that show different parts of it.
#pragma once

#include "ao/base/method.h"
#include "projection/frame.h"

#include <opencv2/core.hpp>
#include <optional>

namespace scanshade {

/// A view is a row: colours times visibility on the left, visibility alone on the right; a panorama has one above the
/// other. Without colours, points are clay lit from the eye. Points without a value are a dim blue.
/// - With a viewpoint: what the scanner saw, as a perspective or a panorama; and the cloud obliquely from outside.
/// - Terrain: obliquely from outside, and from straight above.
/// - Rooms: a panorama from the middle; and obliquely from above, without the ceiling and the walls in front.
/// - Others: the two sides that show most fronts of surfaces.
/// `viewpoint` is the recorded one; else the origin counts where all normals face it. Frames come from quantiles, so
/// stray points do not matter; both sides of surfaces are drawn. At most `most_drawn` points are drawn.
[[nodiscard]] cv::Mat3b cloud_picture(const Cloud& cloud, const PointVisibility& found,
                                      const std::optional<Eigen::Vector3d>& viewpoint, double strength);

/// The direction that these pictures take for up.
[[nodiscard]] Eigen::Vector3d up_of(const Cloud& cloud, const PointVisibility& found,
                                    const std::optional<Eigen::Vector3d>& viewpoint);

constexpr std::size_t most_drawn = 400000;

} // namespace scanshade
