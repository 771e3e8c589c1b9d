// The first guess of a frame's camera, by the rows of its image: part of found_frames().
#pragma once

#include <cmath>
#include <cstddef>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

namespace scanshade::frame_rows {

using Points = std::span<const Eigen::Vector3d>;

constexpr double pixel_tolerance = 0.2; ///< of a pixel; a fifth, as pixel_cloud() has it

/// Points one after the other, of one row or a piece of one, and the plane that they lie in.
struct Row {
    std::size_t first, last; ///< one past its end
    Eigen::Vector3d middle, normal;
    double weight; ///< how well the plane's angle is known: the points' spread across the row in grains, by root of
                   ///< their number
};

/// The line that planes of rows share.
struct RowLine {
    Eigen::Vector3d at, along;

    /// Whether a plane holds it, as far as its points tell.
    [[nodiscard]] bool fits(const Row& row) const {
        constexpr double least_angle = 0.002, uncertain = 1.5;
        const double distance = (row.middle - at).norm();
        const double angle = least_angle + uncertain / row.weight;
        return std::abs(row.normal.dot(along)) < angle && std::abs(row.normal.dot(row.middle - at)) < angle * distance;
    }
};

/// Rows of one frame, and the line through its camera.
struct Core {
    std::vector<Row> rows;
    RowLine line;
};

/// A camera with its pixels' place as numbers to be fitted: pixels of the world's points.
struct View {
    Eigen::Isometry3d world_from_camera;
    double fx, fy, cx = 0, cy = 0;

    [[nodiscard]] Eigen::Vector3d seen(const Eigen::Vector3d& world) const {
        return world_from_camera.linear().transpose() * (world - world_from_camera.translation());
    }
    [[nodiscard]] Eigen::Vector2d pixel(const Eigen::Vector3d& camera) const {
        return {fx * camera.x() / camera.z() + cx, fy * camera.y() / camera.z() + cy};
    }
    /// Whether a point is on a whole pixel, to `tolerance`.
    [[nodiscard]] bool holds(const Eigen::Vector3d& world, double tolerance = pixel_tolerance) const {
        constexpr double widest = 2.5; // tangents: a view of 136 degrees
        const Eigen::Vector3d camera = seen(world);
        if (!(camera.z() > 0) || std::abs(camera.x()) > widest * camera.z() ||
            std::abs(camera.y()) > widest * camera.z())
            return false;
        const Eigen::Vector2d at = pixel(camera);
        return (at - at.array().round().matrix()).cwiseAbs().maxCoeff() < tolerance;
    }
};

/// How far coordinates may be off, in their unit: they are single-precision numbers or were computed in these, whose
/// errors are several steps, or have so many digits.
[[nodiscard]] double grain_of(Points points);
/// The rows whose planes are known: flat to the grain, and wide enough across. Walls without noise are lines, which
/// leave the plane open; two rows in one are no plane.
[[nodiscard]] std::vector<Row> rows_of(Points points, double grain);
/// From row `s` on, the first rows whose planes share a line, and all that follow and hold it, too; `s` becomes the row
/// behind them. Nothing where there are none.
[[nodiscard]] std::optional<Core> core_of(std::span<const Row> rows, std::size_t& s);
/// Of the camera that saw these rows; nothing where their columns are no whole pixels.
[[nodiscard]] std::optional<View> first_view(const Core& core, Points points, double grain);

} // namespace scanshade::frame_rows
