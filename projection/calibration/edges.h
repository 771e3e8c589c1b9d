// Outlines: where depth breaks off, colour usually does, too. What ties a colour camera to the depth camera beside it.
#pragma once

#include "projection/calibration/model.h"

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace scanshade::calibration {

/// A point on the near side of a depth edge.
struct OutlinePoint {
    Eigen::Vector3d in_depth; ///< depth camera space, metres
    Eigen::Vector2d outward;  ///< unit, in the image, from near to far
};
/// Of every other pixel whose surface goes on evenly to one side and ends on the other, with something at least 8 %
/// farther behind (and maybe a structured-light sensor's shadow between); at most `most`, evenly chosen.
[[nodiscard]] std::vector<OutlinePoint> outline_of(const cv::Mat1f& depth_m, const Camera& camera,
                                                   std::size_t most = 400);

/// Where a colour image changes: 255 on edges (Canny 1986), and the direction of steepest change, unit.
struct ColourEdges {
    cv::Mat1b edges;
    cv::Mat2f across;
};
[[nodiscard]] ColourEdges colour_edges_of(const cv::Mat1b& grey);

/// A point of an outline, and the colour edge that it should lie on.
struct OutlinePair {
    Eigen::Vector3d in_depth;
    Eigen::Vector2d on_edge, across; ///< pixels; unit
};
/// For each outline point that the model puts into the colour image, the nearest colour edge of much the same direction
/// within `reach_px` along the outline's normal; points without one are left out.
[[nodiscard]] std::vector<OutlinePair> paired(const std::vector<OutlinePoint>& outline, const ColourEdges& edges,
                                              const Model& colour, double reach_px);

/// How far outlines lie from colour edges under a model, pixels: the median over all frames' points, those without an
/// edge within `reach_px` counting as that far.
[[nodiscard]] double outline_miss_px(const std::vector<std::vector<OutlinePoint>>& outlines,
                                     const std::vector<ColourEdges>& edges, const Model& colour, double reach_px = 20);

} // namespace scanshade::calibration
