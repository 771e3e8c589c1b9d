// Counts depth edges on colour edges, and on the same edges translated.
#include "projection/calibration/recording/agreement.h"

#include "projection/calibration/recording/residuals.h"

#include <cmath>

namespace scanshade::calibration {
namespace {

constexpr int translations = 24;

/// Evenly in all directions (steps of the golden angle), at growing distance.
Eigen::Vector2d translation_px(int index) {
    constexpr double golden_angle = 2.399963, nearest_px = 16, farthest_px = 48;
    const double length = nearest_px + (farthest_px - nearest_px) * index / (translations - 1);
    return length * Eigen::Vector2d(std::cos(golden_angle * index), std::sin(golden_angle * index));
}

/// The outlines in depth camera space at the time of the colour image.
std::vector<OutlinePoint> outline_at_colour_time(const SequenceFrame& frame, const Camera& depth_camera,
                                                 const Model& colour) {
    std::vector<OutlinePoint> outline = outline_of(frame.depth_m, depth_camera);
    for (OutlinePoint& point : outline)
        moved_by_camera_motion(frame.motion, colour[time_offset] + frame.colour_later_s, point.in_depth.data());
    return outline;
}

} // namespace

OutlineAgreement outline_agreement(const std::vector<SequenceFrame>& frames, const Camera& depth_camera,
                                   const Model& colour, double gap_px) {
    constexpr double reach_px = 2;
    OutlineAgreement all;
    double hits = 0;
    std::array<double, translations> by_chance{};
    for (const SequenceFrame& frame : frames) {
        const std::vector<OutlinePoint> outline = outline_at_colour_time(frame, depth_camera, colour);
        const ColourEdges edges = colour_edges_of(frame.grey);
        const auto hit = [&](const Model& model) {
            return static_cast<double>(paired(outline, gap_px, edges, model, reach_px).size());
        };
        all.points += outline.size();
        hits += hit(colour);
        for (int i = 0; i < translations; ++i) {
            Model translated = colour;
            translated[cx] += translation_px(i).x();
            translated[cy] += translation_px(i).y();
            by_chance[i] += hit(translated);
        }
    }
    if (all.points == 0)
        return all;
    const auto count = static_cast<double>(all.points);
    all.share = hits / count;
    double squares = 0;
    for (const double found : by_chance)
        all.by_chance += found / count / translations;
    for (const double found : by_chance)
        squares += std::pow(found / count - all.by_chance, 2);
    all.chance_sigma = std::sqrt(squares / (translations - 1));
    return all;
}

} // namespace scanshade::calibration
