// Cuts depth images into cells, grows planes from them, and weights the cells by depth.
#include "projection/calibration/recording/plane_cells.h"

#include "projection/base/error.h"
#include "projection/base/statistics.h"
#include "projection/calibration/recording/geometry.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>

namespace scanshade::calibration {
namespace {

constexpr int cells_across = 40;        ///< of the image's width: cells of 16 pixels for a Kinect
constexpr double same_direction = 0.98; ///< cosine of 11 degrees
constexpr double same_plane = 0.015;    ///< of the depth
constexpr int least_cells = 6;          ///< of a plane in one frame

/// The plane 1/z = a + b du + c dv about a pixel, fitted to recorded depths. None where the surface is not smooth.
std::optional<Eigen::Vector3d> inverse_depth_plane(const cv::Mat1f& depth_m) {
    constexpr double least_seen = 0.9, smooth = 0.01; // shares of the pixels, of the depth
    const double middle_u = (depth_m.cols - 1) / 2.0, middle_v = (depth_m.rows - 1) / 2.0;
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double squares = 0;
    int seen = 0;
    for (int v = 0; v < depth_m.rows; ++v)
        for (int u = 0; u < depth_m.cols; ++u)
            if (const double z = depth_m(v, u); z > 0) {
                const Eigen::Vector3d row(1, u - middle_u, v - middle_v);
                normal += row * row.transpose();
                right += row / z;
                squares += 1 / (z * z);
                ++seen;
            }
    if (seen < least_seen * static_cast<double>(depth_m.total()))
        return std::nullopt;
    const Eigen::Vector3d plane = normal.ldlt().solve(right);
    const double rms = std::sqrt(std::max(0.0, (squares - plane.dot(right)) / seen)); // of 1/z
    return plane(0) > 0 && rms < smooth * plane(0) ? std::optional(plane) : std::nullopt;
}

double depth_sigma_m(double z_m) { return 0.0012 + 0.0019 * z_m * z_m; } // the order of Nguyen 2012

std::vector<PlaneCell> cells_of(const PlaneObservations& all, int frame, const Model& first) {
    const cv::Mat1f& depth_m = all.frames[frame].depth_m;
    const Camera camera = camera_of(first);
    const int side = std::max(4, depth_m.cols / cells_across);
    const Eigen::Isometry3d to_world = all.pose(frame);
    std::vector<PlaneCell> cells;
    for (int row = 0; (row + 1) * side <= depth_m.rows; ++row)
        for (int column = 0; (column + 1) * side <= depth_m.cols; ++column) {
            const auto plane = inverse_depth_plane(depth_m(cv::Rect(column * side, row * side, side, side)));
            if (!plane)
                continue;
            PlaneCell cell{.frame = frame,
                           .index = {column, row},
                           .pixel = {column * side + (side - 1) / 2.0, row * side + (side - 1) / 2.0},
                           .depth_m = 1 / (*plane)(0),
                           .in_world = {},
                           .normal = {}};
            const Eigen::Vector3d ray = ray_of(camera, cell.pixel);
            // 1/z = a + b du + c dv is q . (x, y, 1) = 1/z in directions x, y, or q . point = 1.
            const double across = (*plane)(1) * first[f], down = (*plane)(2) * first[f] * first[aspect];
            const Eigen::Vector3d q(across, down, (*plane)(0) - across * ray.x() - down * ray.y());
            cell.in_world = to_world * (corrected_m(first, cell.depth_m) * ray);
            cell.normal = to_world.linear() * q.normalized();
            cells.push_back(cell);
        }
    return cells;
}

/// Joins neighbouring cells of one plane. A group joins the plane of an earlier frame that it lies on, if both are
/// close.
void add_frame(PlaneObservations& all, int frame, const Model& first) {
    const std::vector<PlaneCell> cells = cells_of(all, frame, first);
    cv::Mat1i cell_at(all.frames[frame].depth_m.rows, cells_across + 1, -1); // index of each position's cell, -1 = none
    for (std::size_t i = 0; i < cells.size(); ++i)
        cell_at(cells[i].index) = static_cast<int>(i);
    std::vector<bool> taken(cells.size());
    const Eigen::Vector3d centre = all.pose(frame).translation();
    const auto fits = [](const ScenePlane& plane, const PlaneCell& cell, double tolerance) {
        return plane.normal.dot(cell.normal) > same_direction &&
               std::abs(plane.normal.dot(cell.in_world - plane.point)) < tolerance * cell.depth_m;
    };
    for (std::size_t seed = 0; seed < cells.size(); ++seed) {
        if (taken[seed])
            continue;
        ScenePlane group{centre, cells[seed].in_world, cells[seed].normal, {}};
        std::vector<std::size_t> open = {seed};
        taken[seed] = true;
        while (!open.empty()) {
            const PlaneCell& cell = cells[open.back()];
            open.pop_back();
            group.cells.push_back(cell);
            const auto count = static_cast<double>(group.cells.size());
            group.point += (cell.in_world - group.point) / count;
            group.normal = (group.normal * (count - 1) + cell.normal).normalized();
            for (const cv::Point step : {cv::Point(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
                const cv::Point neighbour = cell.index + step;
                if (neighbour.x < 0 || neighbour.y < 0 || neighbour.x >= cell_at.cols || neighbour.y >= cell_at.rows ||
                    cell_at(neighbour) < 0)
                    continue;
                const auto next = static_cast<std::size_t>(cell_at(neighbour));
                if (!taken[next] && fits(group, cells[next], same_plane)) {
                    taken[next] = true;
                    open.push_back(next);
                }
            }
        }
        if (static_cast<int>(group.cells.size()) < least_cells)
            continue;
        const auto near = [&](const ScenePlane& plane) { // two tables of one height are not one plane
            constexpr double reach_m = 0.5;
            return std::any_of(plane.cells.begin(), plane.cells.end(),
                               [&](const PlaneCell& cell) { return (cell.in_world - group.point).norm() < reach_m; });
        };
        const PlaneCell middle{.frame = frame,
                               .index = {},
                               .pixel = {},
                               .depth_m = group.cells.front().depth_m,
                               .in_world = group.point,
                               .normal = group.normal};
        const auto known = std::find_if(all.planes.begin(), all.planes.end(), [&](const ScenePlane& plane) {
            return all.linked && fits(plane, middle, 2 * same_plane) && near(plane);
        });
        if (known == all.planes.end())
            all.planes.push_back(std::move(group));
        else
            known->cells.insert(known->cells.end(), group.cells.begin(), group.cells.end());
    }
}

/// Sigma grows with depth; residuals are millimetres at the median depth. Cells at a grazing angle are left out,
/// because a slight rotation moves them far along the ray.
void weight_by_depth(PlaneObservations& all, const Model& first) {
    constexpr double flattest = 0.2; // cosine of 78 degrees
    std::vector<double> depths;
    for (const ScenePlane& plane : all.planes)
        for (const PlaneCell& cell : plane.cells)
            depths.push_back(cell.depth_m);
    const double median_m = median(depths);
    const Camera camera = camera_of(first);
    for (ScenePlane& plane : all.planes) {
        for (PlaneCell& cell : plane.cells)
            cell.weight = 1000 * depth_sigma_m(median_m) / depth_sigma_m(cell.depth_m);
        std::erase_if(plane.cells, [&](const PlaneCell& cell) {
            const Eigen::Vector3d ray = all.pose(cell.frame).linear() * ray_of(camera, cell.pixel);
            return std::abs(plane.normal.dot(ray.normalized())) < flattest;
        });
    }
    all.remove_small_planes();
}

/// Keeps every nth cell of each plane: about 2000 are enough.
void thin_out(PlaneObservations& all) {
    constexpr std::size_t enough = 2000;
    const std::size_t step = (all.cells() + enough - 1) / enough;
    for (ScenePlane& plane : all.planes) {
        std::vector<PlaneCell> kept;
        for (std::size_t i = 0; i < plane.cells.size(); i += step)
            kept.push_back(plane.cells[i]);
        plane.cells = std::move(kept);
    }
    all.remove_small_planes();
}

} // namespace

std::size_t PlaneObservations::cells() const {
    std::size_t sum = 0;
    for (const ScenePlane& plane : planes)
        sum += plane.cells.size();
    return sum;
}

void PlaneObservations::remove_small_planes() {
    std::erase_if(planes, [](const ScenePlane& plane) { return static_cast<int>(plane.cells.size()) < least_cells; });
}

PlaneObservations find_planes(std::vector<PlaneFrame> frames, const Model& first) {
    PlaneObservations all{.frames = std::move(frames), .planes = {}, .weights = {}};
    all.weights.assign(all.frames.size(), 1.0);
    all.linked =
        std::all_of(all.frames.begin(), all.frames.end(), [](const auto& frame) { return frame.world_from_camera; });
    for (std::size_t i = 0; i < all.frames.size(); ++i)
        add_frame(all, static_cast<int>(i), first);
    if (all.planes.empty())
        throw Error("nothing in the depth images is plane enough to determine their camera");
    weight_by_depth(all, first);
    thin_out(all);
    return all;
}

} // namespace scanshade::calibration
