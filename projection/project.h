// Frame -> DepthImage: undistort a recorded image once, or splat a cloud's points with a depth test.
#pragma once

#include "projection/fit_pinhole.h"
#include "projection/frame.h"
#include "projection/maps.h"

namespace scanshade {

/// Depths outside [near_m, far_m], NaN and infinities become holes. far_m 1000: nothing a depth sensor records is
/// farther.
struct ProjectOptions {
    double near_m = 1e-3;
    double far_m = 1000.0;
};

/// The camera of a frame's depth image; its `origin` names its source:
/// - the frame's own, where it has one (a missing image size is taken from the depth image, the grid, or twice the
///   principal point);
/// - else, for an organised cloud, the one fitted to its points: "recovered from the points, rms 0.0003 px, 239087
/// points";
/// - else one at the origin, looking along +z, that frames the cloud at about one point per pixel.
/// Putting the result into frame.camera saves project() the search.
/// Throws Error for a depth image without a camera or of another size than its camera's, and for a frame without data.
/// Also for a cloud around or beside its origin, which has no single camera.
[[nodiscard]] Camera camera_of(const Frame& frame);

/// The depth image the methods work on, seen by camera_of(frame); of a lens, by its straight camera
/// (Undistortion::straight_camera).
/// - Depth frames without distortion keep their pixels (the very same cv::Mat where nothing had to become a hole); with
///   distortion each pixel takes the depth between the recorded pixels around it where they are of one surface, else
///   the nearest one's (never an average of two surfaces: that would invent points between them).
/// - Organised clouds whose points project to their own pixels keep the grid. Others are splatted with a depth test
///   (the nearest wins, then the lowest index); `source` records which point each pixel shows. Gaps between the points
///   of unorganised clouds are closed, so that surfaces behind do not shine through.
/// An all-hole image is a result; Error as camera_of() throws it.
[[nodiscard]] DepthImage project(const Frame& frame, const ProjectOptions& options = {});

/// Depths of one pixel or of neighbours that differ by less belong to one surface: 1 % plus the width of two pixels.
[[nodiscard]] inline double same_surface_m(const Pinhole& camera, double z_m) { return z_m * (0.01 + 2.0 / camera.fx); }

} // namespace scanshade
