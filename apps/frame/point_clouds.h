// Clouds that no single camera sees: which ones these are, and their values.
#pragma once

#include "ao/base/method.h"
#include "apps/frame/frame_options.h"
#include "projection/attach.h"
#include "projection/frame.h"

#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Whether this cloud is computed from its points. `automatic` means yes, unless the user named a camera or the cloud
/// is the grid of a pinhole image. `notes` receives the reason.
[[nodiscard]] bool takes_points(const Frame& frame, CloudWalk walk, std::vector<std::string>& notes);

/// Whether the points of a cloud without a grid are those that a camera at the origin saw, looking along z: nearly all
/// within its view and seen first from there, 0.1 to 30 m away, and enough for an image.
[[nodiscard]] bool is_one_view(const Frame& frame);

/// Where the scanner stood, in the cloud's own coordinates: as its file says, or the origin where a layout has the pose
/// of a scanner whose clouds stay in its frame. None if neither is known.
[[nodiscard]] std::optional<Eigen::Vector3d> scanner_of(const Frame& frame);

/// Visibility of the cloud by `method`, with the file's own normals, faces and viewpoint.
[[nodiscard]] PointVisibility visibility_of_points(const Frame& frame, PointMethod& method);

/// Values of points, with how many of the valid ones have one.
[[nodiscard]] Attached attached_points(const Cloud& cloud, std::vector<float> visibility);

} // namespace scanshade
