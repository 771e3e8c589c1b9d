// Outlines: where depth breaks off, colour usually does, too. What ties a colour camera to the depth camera beside it.
#pragma once

#include "projection/calibration/model.h"

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace scanshade::calibration {

/// The last point of a surface before a depth edge. The edge itself lies a little farther out: half a pixel, and what
/// the sensor frays off.
struct OutlinePoint {
    Eigen::Vector3d in_depth;      ///< depth camera space, metres
    Eigen::Vector2d outward;       ///< unit, in the image, from near to far
    Eigen::Vector3d one_px_beyond; ///< that way on the same surface: metres per pixel of the depth image

    [[nodiscard]] Eigen::Vector3d edge(double gap_px) const { return in_depth + gap_px * one_px_beyond; }
};
/// Of every other pixel whose surface goes on evenly to one side and ends on the other, with something at least 8 %
/// farther behind (and maybe a structured-light sensor's shadow between); at most `most`, evenly chosen.
[[nodiscard]] std::vector<OutlinePoint> outline_of(const cv::Mat1f& depth_m, const Camera& camera,
                                                   std::size_t most = 400);

/// Where a colour image changes: 255 on edges (Canny 1986), the direction of steepest change, unit, and how steep.
struct ColourEdges {
    cv::Mat1b edges;
    cv::Mat2f across;
    cv::Mat1f steepness;
};
[[nodiscard]] ColourEdges colour_edges_of(const cv::Mat1b& grey);

/// A point of an outline, and the colour edge that it should lie on.
struct OutlinePair {
    OutlinePoint point;
    Eigen::Vector2d on_edge, across; ///< pixels, to fractions of one; unit
};
/// For each outline point whose edge the model puts into the colour image, the nearest colour edge of much the same
/// direction within `reach_px` along the outline's normal; points without one are left out.
[[nodiscard]] std::vector<OutlinePair> paired(const std::vector<OutlinePoint>& outline, double gap_px,
                                              const ColourEdges& edges, const Model& colour, double reach_px);

/// The place of a colour camera whose tracks are explained by `tracked`, so far as outlines tell it: tracks hardly tell
/// a shift from a turn, and the nearest edge is often another one, so that places all around `first` are looked at, the
/// camera each time turned so that things at the usual depth stay where `tracked` has them, or up to a few pixels
/// aside.
[[nodiscard]] Model placed_by_outlines(const std::vector<std::vector<OutlinePoint>>& outlines,
                                       const std::vector<ColourEdges>& edges, const Model& tracked, const Model& first);

} // namespace scanshade::calibration
