// Depth frames found again in a cloud that was merged from them, by the order of its points.
#pragma once

#include "projection/camera.h"

#include <cstddef>
#include <cstdint>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

namespace scanshade {

/// One of the images that a cloud was made from.
struct FoundFrame {
    Pinhole camera; ///< of the same size in all frames of a cloud; pixels are those that were written: strides count
    Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
    std::size_t first = 0, last = 0; ///< its points are among these; `last` is one past them
};

struct FoundFrames {
    std::vector<FoundFrame> frames;  ///< in the order of the file
    std::vector<std::int32_t> frame; ///< by point: its frame, or -1
    std::vector<std::int32_t> pixel; ///< by point: row * width + column of its frame's image, or -1
    double share = 0;                ///< of the finite points: those with a pixel

    /// Depth of frame `index`, in the cloud's unit along its camera's axis; 0 where it has no point.
    [[nodiscard]] cv::Mat1f depth(std::size_t index, std::span<const Eigen::Vector3d> points) const;
};

/// Programs merge depth frames in world coordinates (Open3D's `pcd += frame`, RTAB-Map, ROS, phones) frame after frame
/// and row by row, holes left out. Noise is along the rays, so rays are as exact as the numbers in the file, and a
/// frame's camera follows from the order of its points, however large noise is:
///
/// 1. Rows end where the next step goes against the row. The points of a row lie in a plane through the camera.
/// 2. All these planes hold one line, along the rows and through the camera.
/// 3. Where the camera is on the line: with a along the line and b across it, columns are linear in (a - t) / b. Pairs
///    of steps from pixel to pixel each tell t; most agree.
/// 4. The width of pixels in a row shrinks with the cosine of the row's angle, which tells the optical axis.
/// 5. Least squares of the pixels of all points, over a part that grows to the whole frame.
///
/// A frame counts if 90 % of its points are on whole pixels, to a fifth. Nothing where none of four places in the cloud
/// holds one: clouds in another order, laser scans. A part of the points does, if their order is kept, and coordinates
/// may be rounded to about 1/20,000 of their distance.
[[nodiscard]] std::optional<FoundFrames> found_frames(std::span<const Eigen::Vector3d> points);

/// The same where the frames are known: every point that is on a whole pixel of its frame takes it. Points of which
/// other points were merged are on none.
[[nodiscard]] FoundFrames pixels_of(std::span<const FoundFrame> frames, std::span<const Eigen::Vector3d> points);

} // namespace scanshade
