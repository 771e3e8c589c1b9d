// Planes found in depth images: smooth cells, grouped within a frame, joined with what frames before saw.
#include "projection/calibration/recording/overlap.h"
#include "projection/calibration/recording/plane_adjustment.h"
#include "projection/error.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <fmt/format.h>

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

} // namespace

Planes::Planes(std::vector<PlaneFrame> frames, const Model& first)
    : frames_(std::move(frames)), weights_(frames_.size(), 1.0) {
    linked_ = std::all_of(frames_.begin(), frames_.end(), [](const auto& frame) { return frame.world_from_camera; });
    for (std::size_t i = 0; i < frames_.size(); ++i)
        add_frame(static_cast<int>(i), first);
    if (planes_.empty())
        throw Error("nothing in the depth images is plane enough to tell their camera");
    weigh_by_depth(first);
    thin_out();
    prune(first);
    if (planes_.empty())
        throw Error("no plane stays one: the poses, the depth unit or the camera are far off");
}

std::vector<Planes::Cell> Planes::cells_of(int frame, const Model& first) const {
    const cv::Mat1f& depth_m = frames_[frame].depth_m;
    const Camera camera = camera_of(first);
    const int side = std::max(4, depth_m.cols / cells_across);
    const Eigen::Isometry3d to_world = pose(frame);
    std::vector<Cell> cells;
    for (int row = 0; (row + 1) * side <= depth_m.rows; ++row)
        for (int column = 0; (column + 1) * side <= depth_m.cols; ++column) {
            const auto plane = inverse_depth_plane(depth_m(cv::Rect(column * side, row * side, side, side)));
            if (!plane)
                continue;
            Cell cell{.frame = frame,
                      .place = {column, row},
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

/// Neighbouring cells of one plane go together; what lies on a plane known from frames before, near where it was seen,
/// joins it.
void Planes::add_frame(int frame, const Model& first) {
    const std::vector<Cell> cells = cells_of(frame, first);
    cv::Mat1i index(frames_[frame].depth_m.rows, cells_across + 1, -1); // of the cell at each place
    for (std::size_t i = 0; i < cells.size(); ++i)
        index(cells[i].place) = static_cast<int>(i);
    std::vector<bool> taken(cells.size());
    const Eigen::Vector3d centre = pose(frame).translation();
    const auto fits = [](const Plane& plane, const Cell& cell, double tolerance) {
        return plane.normal.dot(cell.normal) > same_direction &&
               std::abs(plane.normal.dot(cell.in_world - plane.point)) < tolerance * cell.depth_m;
    };
    for (std::size_t seed = 0; seed < cells.size(); ++seed) {
        if (taken[seed])
            continue;
        Plane group{centre, cells[seed].in_world, cells[seed].normal, {}};
        std::vector<std::size_t> open = {seed};
        taken[seed] = true;
        while (!open.empty()) {
            const Cell& cell = cells[open.back()];
            open.pop_back();
            group.cells.push_back(cell);
            const auto count = static_cast<double>(group.cells.size());
            group.point += (cell.in_world - group.point) / count;
            group.normal = (group.normal * (count - 1) + cell.normal).normalized();
            for (const cv::Point step : {cv::Point(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
                const cv::Point place = cell.place + step;
                if (place.x < 0 || place.y < 0 || place.x >= index.cols || place.y >= index.rows || index(place) < 0)
                    continue;
                const auto next = static_cast<std::size_t>(index(place));
                if (!taken[next] && fits(group, cells[next], same_plane)) {
                    taken[next] = true;
                    open.push_back(next);
                }
            }
        }
        if (static_cast<int>(group.cells.size()) < least_cells)
            continue;
        const auto near = [&](const Plane& plane) { // two tables of one height are not one plane
            constexpr double reach_m = 0.5;
            return std::any_of(plane.cells.begin(), plane.cells.end(),
                               [&](const Cell& cell) { return (cell.in_world - group.point).norm() < reach_m; });
        };
        const Cell middle{.frame = frame,
                          .place = {},
                          .pixel = {},
                          .depth_m = group.cells.front().depth_m,
                          .in_world = group.point,
                          .normal = group.normal};
        const auto known = std::find_if(planes_.begin(), planes_.end(), [&](const Plane& plane) {
            return linked_ && fits(plane, middle, 2 * same_plane) && near(plane);
        });
        if (known == planes_.end())
            planes_.push_back(std::move(group));
        else
            known->cells.insert(known->cells.end(), group.cells.begin(), group.cells.end());
    }
}

/// Sigma grows with depth; residuals are millimetres of depth at the usual one. What is seen at a grazing angle is left
/// out: a slight turn would carry it anywhere along the ray.
void Planes::weigh_by_depth(const Model& first) {
    constexpr double flattest = 0.2; // cosine of 78 degrees
    std::vector<double> depths;
    for (const Plane& plane : planes_)
        for (const Cell& cell : plane.cells)
            depths.push_back(cell.depth_m);
    const double usual_m = median_of(depths);
    const Camera camera = camera_of(first);
    for (Plane& plane : planes_) {
        for (Cell& cell : plane.cells)
            cell.weight = 1000 * depth_sigma_m(usual_m) / depth_sigma_m(cell.depth_m);
        std::erase_if(plane.cells, [&](const Cell& cell) {
            const Eigen::Vector3d ray = pose(cell.frame).linear() * ray_of(camera, cell.pixel);
            return std::abs(plane.normal.dot(ray.normalized())) < flattest;
        });
    }
    std::erase_if(planes_, [](const Plane& plane) { return static_cast<int>(plane.cells.size()) < least_cells; });
}

/// So many are enough; every so manieth of each plane is kept.
void Planes::thin_out() {
    constexpr std::size_t enough = 2000;
    const std::size_t step = (cells() + enough - 1) / enough;
    for (Plane& plane : planes_) {
        std::vector<Cell> kept;
        for (std::size_t i = 0; i < plane.cells.size(); i += step)
            kept.push_back(plane.cells[i]);
        plane.cells = std::move(kept);
    }
    std::erase_if(planes_, [](const Plane& plane) { return static_cast<int>(plane.cells.size()) < least_cells; });
}

/// Leaves out cells that do not lie on their planes, judged by a robust fit with focal length, principal point and
/// offset free: a wrong camera must not cost the image's corners.
void Planes::prune(const Model& first) {
    constexpr double most_sigmas = 4;
    for (int round = 0; round < 3 && !planes_.empty(); ++round) {
        Fit fit = start(first);
        Problem adjustment(*this, fit);
        for (std::size_t i = 0; i < planes_.size(); ++i)
            for (const Cell& cell : planes_[i].cells)
                adjustment.add(i, cell, false, new ceres::CauchyLoss(sigma_mm_));
        adjustment.hold_poses();
        Free free{};
        for (const Unknown unknown : {f, cx, cy})
            free[unknown] = linked_;
        free[k1] = !linked_;
        freeze(adjustment.problem, fit.model, free);
        solve(adjustment.problem, fit, true);
        std::vector<double> residuals, misses;
        ceres::Problem::EvaluateOptions without_loss;
        without_loss.apply_loss_function = false;
        adjustment.problem.Evaluate(without_loss, nullptr, &residuals, nullptr, nullptr);
        residuals.resize(cells()); // the poses' come after the cells'
        for (const double residual : residuals)
            misses.push_back(std::abs(residual));
        sigma_mm_ = std::max(1e-6, median_of(misses) / 0.674); // of a Gaussian
        std::size_t at = 0;
        for (Plane& plane : planes_) {
            std::vector<Cell> kept;
            for (const Cell& cell : plane.cells)
                if (misses[at++] <= most_sigmas * sigma_mm_)
                    kept.push_back(cell);
            plane.cells = std::move(kept);
        }
        std::erase_if(planes_, [](const Plane& plane) { return static_cast<int>(plane.cells.size()) < least_cells; });
    }
}

} // namespace scanshade::calibration
