// The depth frames that a cloud was made of, as comments of its PLY file.
#pragma once

#include "projection/found_frames.h"
#include "projection/frame.h"

#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// One comment for all frames and one for each, to be read by recorded_frames():
///
///     scanshade frames 1: F frames of N points
///     scanshade frame FIRST LAST  fx fy cx cy width height  r11 r12 r13 x r21 ... z  u v d
///
/// FIRST and LAST number the frame's points from 0, one past the end; twelve numbers are world_from_camera's rows, in
/// the points' unit; u, v, d are the mean pixel and depth of its points, by which a reader knows that these are still
/// where they were. Numbers are exact. Too many frames for a header make one comment that says so.
[[nodiscard]] std::vector<std::string> frame_comments(std::span<const FoundFrame> frames,
                                                      std::span<const Eigen::Vector3d> points);

/// The frames of a cloud's file, with all their points. Empty where it names none, or where `warnings` says why they
/// are not believed: damaged comments, or points that are not those they speak of.
[[nodiscard]] std::vector<FoundFrame> recorded_frames(const Cloud& cloud, std::vector<std::string>& warnings);

} // namespace scanshade
