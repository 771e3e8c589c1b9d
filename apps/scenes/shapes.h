// Depth images of shapes whose visibility is known, for tests, hard cases and timings.
#pragma once

#include "projection/maps.h"

namespace scanshade::shapes {

/// 65 degrees wide. The principal point is off-centre, so that nothing can rely on the image's middle.
[[nodiscard]] Pinhole off_centre_camera(cv::Size size = {160, 120});

/// A plane through (0, 0, z_m), rotated about the vertical axis: 0 faces the camera. Pixels that see none of it within
/// 100 m are holes.
[[nodiscard]] DepthImage tilted_plane(const Pinhole& camera, double tilt_degrees, double z_m = 2);
/// Two walls that meet at a right angle in a vertical edge z_m away, each 45 degrees to the view.
[[nodiscard]] DepthImage wall_corner(const Pinhole& camera, double z_m = 2);
/// A ball of 0.3 m on a floor 1 m below the camera, with a wall behind.
[[nodiscard]] DepthImage ball_on_floor(const Pinhole& camera);

/// The same with a share of its pixels punched out, in blocks of 1 to 4 pixels; the same `seed` punches the same holes.
[[nodiscard]] DepthImage with_holes(const DepthImage& depth, double share, int seed = 1);

} // namespace scanshade::shapes
