// Finds depth edges and colour edges, and pairs them.
#include "projection/calibration/recording/edges.h"

#include "projection/base/statistics.h"
#include "projection/calibration/recording/geometry.h"
#include "projection/calibration/solve.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <tbb/parallel_for.h>

namespace scanshade::calibration {
namespace {

/// Projects a point of the depth camera's space into the colour image; none behind the camera or outside the image.
std::optional<Eigen::Vector2d> colour_pixel(const Model& colour, const Eigen::Vector3d& in_depth) {
    Eigen::Vector3d in_colour;
    transform_point(colour.values.data() + rotation_x, in_depth.data(), in_colour.data());
    if (in_colour.z() <= 0.05)
        return std::nullopt;
    Eigen::Vector2d pixel;
    pixel_of(colour.lens, colour.values.data(), in_colour.data(), pixel.data());
    const bool inside =
        pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < colour.size.width - 1 && pixel.y() < colour.size.height - 1;
    return inside ? std::optional(pixel) : std::nullopt;
}

/// The nearest edge pixel along a line through a pixel, in both directions.
std::optional<cv::Point> edge_along(const ColourEdges& edges, const Eigen::Vector2d& from,
                                    const Eigen::Vector2d& direction, double reach_px) {
    constexpr double step_px = 0.5, same_direction = 0.85; // cosine of 32 degrees
    for (double away = 0; away <= reach_px; away += step_px)
        for (const double side : {1.0, -1.0}) {
            const Eigen::Vector2d at = from + side * away * direction;
            const cv::Point pixel(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y())));
            if (!cv::Rect({}, edges.edges.size()).contains(pixel) || !edges.edges(pixel))
                continue;
            const cv::Vec2f across = edges.across(pixel);
            if (std::abs(across[0] * direction.x() + across[1] * direction.y()) > same_direction)
                return pixel;
        }
    return std::nullopt;
}

/// The direction in which a pixel's surface ends, with another surface farther behind; none where it does not.
std::optional<Eigen::Vector2d> outward_at(const cv::Mat1f& depth_m, int u, int v) {
    constexpr double farther = 1.08, flat = 1.02;
    constexpr int longest_shadow = 30; // of a Kinect's projector, pixels
    const float near = depth_m(v, u);
    if (!(near > 0))
        return std::nullopt;
    Eigen::Vector2d outward = Eigen::Vector2d::Zero();
    for (int dv = -2; dv <= 2; ++dv)
        for (int du = -2; du <= 2; ++du)
            if (const float z = depth_m(v + dv, u + du); !(z > 0) || z > farther * near)
                outward += Eigen::Vector2d(du, dv);
    if (outward.norm() < 3)
        return std::nullopt;
    outward.normalize();
    const auto depth_along = [&](double steps) {
        const cv::Point at(u + static_cast<int>(std::lround(steps * outward.x())),
                           v + static_cast<int>(std::lround(steps * outward.y())));
        return cv::Rect({}, depth_m.size()).contains(at) ? depth_m(at) : 0.0F;
    };
    if (depth_along(-3) > flat * near || depth_along(-3) < near / flat)
        return std::nullopt; // no smooth surface
    for (double steps = 1.5; steps < longest_shadow; ++steps)
        if (const float behind = depth_along(steps); behind > 0)
            return behind > farther * near ? std::optional(outward) : std::nullopt;
    return std::nullopt;
}

OutlinePoint outline_point(const Camera& camera, const Eigen::Vector2d& pixel, double z_m,
                           const Eigen::Vector2d& outward) {
    const Eigen::Vector3d here = z_m * ray_of(camera, pixel);
    return {here, outward, z_m * ray_of(camera, pixel + outward) - here};
}

/// The steepest position near an edge pixel, across the edge: the peak of a parabola through three values.
Eigen::Vector2d steepest(const ColourEdges& edges, const cv::Point& pixel) {
    const cv::Vec2f across = edges.across(pixel);
    const auto at = [&](float away) {
        cv::Mat1f value;
        cv::getRectSubPix(
            edges.steepness, {1, 1},
            {static_cast<float>(pixel.x) + away * across[0], static_cast<float>(pixel.y) + away * across[1]}, value);
        return static_cast<double>(value(0, 0));
    };
    const double before = at(-1), here = at(0), after = at(1), bend = before - 2 * here + after;
    const double peak = bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
    return Eigen::Vector2d(pixel.x, pixel.y) + peak * Eigen::Vector2d(across[0], across[1]);
}

} // namespace

std::vector<OutlinePoint> outline_of(const cv::Mat1f& depth_m, const Camera& camera, std::size_t most) {
    constexpr int margin = 4;
    std::vector<OutlinePoint> all;
    for (int v = margin; v < depth_m.rows - margin; v += 2)
        for (int u = margin; u < depth_m.cols - margin; u += 2)
            if (const auto outward = outward_at(depth_m, u, v))
                all.push_back(outline_point(camera, {u, v}, depth_m(v, u), *outward));
    if (all.size() <= most)
        return all;
    std::vector<OutlinePoint> chosen;
    for (std::size_t i = 0; i < most; ++i)
        chosen.push_back(all[i * all.size() / most]);
    return chosen;
}

ColourEdges colour_edges_of(const cv::Mat1b& grey) {
    cv::Mat1b smooth, edges;
    cv::GaussianBlur(grey, smooth, {5, 5}, 1.2);
    cv::Canny(smooth, edges, 25, 60);
    cv::Mat1f du, dv;
    cv::Sobel(smooth, du, CV_32F, 1, 0);
    cv::Sobel(smooth, dv, CV_32F, 0, 1);
    cv::Mat2f across(grey.size(), cv::Vec2f());
    cv::Mat1f steepness(grey.size());
    for (int v = 0; v < grey.rows; ++v)
        for (int u = 0; u < grey.cols; ++u)
            if (const float length = steepness(v, u) = std::hypot(du(v, u), dv(v, u)); length > 0)
                across(v, u) = {du(v, u) / length, dv(v, u) / length};
    return {edges, across, steepness};
}

std::vector<OutlinePair> paired(const std::vector<OutlinePoint>& outline, double gap_px, const ColourEdges& edges,
                                const Model& colour, double reach_px) {
    std::vector<OutlinePair> pairs;
    for (const OutlinePoint& point : outline) {
        const auto pixel = colour_pixel(colour, point.edge(gap_px));
        if (!pixel)
            continue;
        if (const auto edge = edge_along(edges, *pixel, point.outward, reach_px)) {
            const cv::Vec2f across = edges.across(*edge);
            pairs.push_back({point, steepest(edges, *edge), {across[0], across[1]}});
        }
    }
    return pairs;
}

namespace {

/// Counts how many outline points of all frames lie on edges.
class OutlineCount {
  public:
    OutlineCount(const std::vector<std::vector<OutlinePoint>>& outlines, const std::vector<ColourEdges>& edges) {
        std::vector<FramePoint> all;
        for (std::size_t i = 0; i < outlines.size(); ++i)
            for (const OutlinePoint& point : outlines[i])
                all.push_back({point.edge(expected_gap_px), point.outward, &edges[i]});
        constexpr std::size_t enough = 800;
        const std::size_t step = std::max<std::size_t>(1, all.size() / enough);
        std::vector<double> depths;
        for (std::size_t i = 0; i < all.size(); i += step) {
            points_.push_back(all[i]);
            depths.push_back(all[i].in_depth.z());
        }
        median_depth_m_ = median(depths);
    }
    [[nodiscard]] double median_depth_m() const { return median_depth_m_; }
    /// A point on an edge counts 1, a point `reach_px` away from one 0.
    [[nodiscard]] double operator()(const Model& colour, double reach_px) const {
        double sum = 0;
        for (const FramePoint& point : points_)
            if (const auto pixel = colour_pixel(colour, point.in_depth))
                if (const auto edge = edge_along(*point.edges, *pixel, point.outward, reach_px))
                    sum += std::max(0.0, 1 - (Eigen::Vector2d(edge->x, edge->y) - *pixel).norm() / reach_px);
        return sum;
    }

  private:
    struct FramePoint {
        Eigen::Vector3d in_depth;
        Eigen::Vector2d outward;
        const ColourEdges* edges;
    };
    std::vector<FramePoint> points_;
    double median_depth_m_ = 1;
};

/// A step of the search: x and y of the translation, metres, then the movement of points at the median depth, pixels.
using Offset = Eigen::Vector4d;

Model offset_extrinsics(const Model& tracked, const Model& first, double median_depth_m, const Offset& by) {
    Eigen::Isometry3d extrinsics = pose_from_parameters(tracked.values.data() + rotation_x);
    const Eigen::Vector3d translation =
        pose_from_parameters(first.values.data() + rotation_x).translation() + Eigen::Vector3d(by[0], by[1], 0);
    const Eigen::Vector3d by_m = translation - extrinsics.translation();
    const Eigen::Vector2d rotation = by.tail<2>() / tracked[f] - by_m.head<2>() / median_depth_m;
    extrinsics.linear() = Eigen::AngleAxisd(rotation.x(), Eigen::Vector3d::UnitY()) *
                          Eigen::AngleAxisd(-rotation.y(), Eigen::Vector3d::UnitX()) * extrinsics.linear();
    extrinsics.translation() = translation;
    Model model = tracked;
    to_pose_parameters(extrinsics, model.values.data() + rotation_x);
    return model;
}

} // namespace

Model extrinsics_from_outlines(const std::vector<std::vector<OutlinePoint>>& outlines,
                               const std::vector<ColourEdges>& edges, const Model& tracked, const Model& first) {
    const OutlineCount count(outlines, edges);
    struct Best {
        Offset offset = Offset::Zero();
        double count = -1;
    } best;
    const auto search_around = [&](const Offset& centre, const Offset& step, const Eigen::Vector4i& steps,
                                   double reach_px) {
        std::vector<Best> all;
        Eigen::Vector4i index;
        for (index[0] = -steps[0]; index[0] <= steps[0]; ++index[0])
            for (index[1] = -steps[1]; index[1] <= steps[1]; ++index[1])
                for (index[2] = -steps[2]; index[2] <= steps[2]; ++index[2])
                    for (index[3] = -steps[3]; index[3] <= steps[3]; ++index[3])
                        all.push_back({centre + index.cast<double>().cwiseProduct(step)});
        tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
            all[i].count = count(offset_extrinsics(tracked, first, count.median_depth_m(), all[i].offset), reach_px);
        });
        best =
            *std::max_element(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.count < b.count; });
    };
    search_around(Offset::Zero(), {0.02, 0.02, 6, 6}, {4, 1, 4, 4}, 10);
    search_around(best.offset, {0.01, 0.01, 3, 3}, {1, 1, 1, 1}, 6);
    search_around(best.offset, {0.005, 0.005, 1.5, 1.5}, {1, 1, 1, 1}, 4);
    return offset_extrinsics(tracked, first, count.median_depth_m(), best.offset);
}

} // namespace scanshade::calibration
