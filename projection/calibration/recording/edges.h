// Outlines: depth edges usually are colour edges, too. They tie a secondary colour camera to the depth camera.
#pragma once

#include "projection/calibration/model.h"

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace scanshade::calibration {

/// The last point of a surface before a depth edge. The edge itself lies farther out: half a pixel, and what the sensor
/// loses at edges.
struct OutlinePoint {
    Eigen::Vector3d in_depth;      ///< depth camera space, metres
    Eigen::Vector2d outward;       ///< unit, in the image, from near to far
    Eigen::Vector3d one_px_beyond; ///< in that direction on the same surface: metres per pixel of the depth image

    [[nodiscard]] Eigen::Vector3d edge(double gap_px) const { return in_depth + gap_px * one_px_beyond; }
};
/// Every other pixel is tested. Its surface must continue smoothly on one side and end on the other, with another
/// surface at least 8 % farther behind; a structured-light sensor's shadow may lie between. At most `most` points,
/// evenly chosen.
[[nodiscard]] std::vector<OutlinePoint> outline_of(const cv::Mat1f& depth_m, const Camera& camera,
                                                   std::size_t most = 400);

/// Edges of a colour image: 255 on edges (Canny 1986), the unit direction of the gradient, and its length.
struct ColourEdges {
    cv::Mat1b edges;
    cv::Mat2f across;
    cv::Mat1f steepness;
};
[[nodiscard]] ColourEdges colour_edges_of(const cv::Mat1b& grey);

/// A point of an outline, and the colour edge that it should lie on.
struct OutlinePair {
    OutlinePoint point;
    Eigen::Vector2d on_edge, across; ///< subpixel position; unit normal of the edge
};
/// Projects each outline point's edge into the colour image, and finds the nearest colour edge of a similar direction
/// within `reach_px` along the outline's normal. Points without one are left out.
[[nodiscard]] std::vector<OutlinePair> paired(const std::vector<OutlinePoint>& outline, double gap_px,
                                              const ColourEdges& edges, const Model& colour, double reach_px);

/// The extrinsics of a colour camera that explain both its tracks (as `tracked` does) and most outlines. Tracks hardly
/// distinguish a translation from a rotation, and the nearest edge is often a wrong one. So a grid of translations
/// around `first` is searched. Each is compensated by a rotation: points at the median depth stay within a few pixels
/// of where `tracked` projects them.
[[nodiscard]] Model extrinsics_from_outlines(const std::vector<std::vector<OutlinePoint>>& outlines,
                                             const std::vector<ColourEdges>& edges, const Model& tracked,
                                             const Model& first);

} // namespace scanshade::calibration
