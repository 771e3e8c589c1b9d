// Depth edges counted on colour edges, and on the same edges shifted aside.
#include "projection/calibration/recording/agreement.h"

#include "projection/calibration/recording/residuals.h"

#include <cmath>

namespace scanshade::calibration {
namespace {

constexpr int shifts = 24;

/// Evenly in all directions (steps of the golden angle), at growing distance.
Eigen::Vector2d shift_px(int index) {
    constexpr double golden_angle = 2.399963, nearest_px = 16, farthest_px = 48;
    const double length = nearest_px + (farthest_px - nearest_px) * index / (shifts - 1);
    return length * Eigen::Vector2d(std::cos(golden_angle * index), std::sin(golden_angle * index));
}

/// Where the camera sees outlines when the colour image is taken.
std::vector<OutlinePoint> outline_then(const SequenceFrame& frame, const Camera& depth_camera, const Model& colour) {
    std::vector<OutlinePoint> outline = outline_of(frame.depth_m, depth_camera);
    for (OutlinePoint& point : outline)
        seen_later(frame.motion, colour[time_offset] + frame.colour_later_s, point.in_depth.data());
    return outline;
}

} // namespace

OutlineAgreement outline_agreement(const std::vector<SequenceFrame>& frames, const Camera& depth_camera,
                                   const Model& colour, double gap_px) {
    constexpr double reach_px = 2;
    OutlineAgreement all;
    double hits = 0;
    std::array<double, shifts> by_chance{};
    for (const SequenceFrame& frame : frames) {
        const std::vector<OutlinePoint> outline = outline_then(frame, depth_camera, colour);
        const ColourEdges edges = colour_edges_of(frame.grey);
        const auto hit = [&](const Model& model) {
            return static_cast<double>(paired(outline, gap_px, edges, model, reach_px).size());
        };
        all.points += outline.size();
        hits += hit(colour);
        for (int i = 0; i < shifts; ++i) {
            Model aside = colour;
            aside[cx] += shift_px(i).x();
            aside[cy] += shift_px(i).y();
            by_chance[i] += hit(aside);
        }
    }
    if (all.points == 0)
        return all;
    const auto count = static_cast<double>(all.points);
    all.share = hits / count;
    double squares = 0;
    for (const double found : by_chance)
        all.by_chance += found / count / shifts;
    for (const double found : by_chance)
        squares += std::pow(found / count - all.by_chance, 2);
    all.chance_sigma = std::sqrt(squares / (shifts - 1));
    return all;
}

} // namespace scanshade::calibration
