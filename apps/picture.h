// Depth and visibility made visible: colours for depth, clay for shape, and the side-by-side panel.
#pragma once

#include "projection/camera.h"
#include "projection/frame.h"

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace scanshade {

/// Depth (metres, 0 = hole) in turbo colours, near warm and far cold over the frame's own 1..99 % range; holes are
/// black.
[[nodiscard]] cv::Mat3b depth_picture(const cv::Mat1f& z_m);

/// Visibility as grey, 1 = white; where there is no surface a dim blue that no visibility has.
[[nodiscard]] cv::Mat3b visibility_picture(const cv::Mat1f& visibility);

/// Whether the cloud's points have colours of their own: some programs write all of them as zero.
[[nodiscard]] bool has_colours(const Cloud& cloud);

/// Values of points as grey, so that 255 is open; black where they are not known.
[[nodiscard]] std::vector<cv::Vec3b> greys(const std::vector<float>& visibility);

/// The surface as grey clay lit from the camera: the shape that depth alone shows. Holes get the same dim blue.
/// `camera` is the pinhole of `z_m`, same size; lens distortion may be ignored, it only bends the light a little.
[[nodiscard]] cv::Mat3b clay(const cv::Mat1f& z_m, const Pinhole& camera);

/// Signed differences: -full_scale is blue, 0 white, +full_scale red, values beyond are clamped; NaN gets the dim
/// blue. Straight lines in CIELAB between ends of equal lightness and chroma: equal differences look equally far apart
/// (after Moreland, "Diverging Color Maps for Scientific Visualization", 2009).
[[nodiscard]] cv::Mat3b difference_picture(const cv::Mat1f& difference, double full_scale);

/// Cosine between each pixel's surface normal and the way back to the camera, after a smoothing along the surface; 0 in
/// holes.
[[nodiscard]] cv::Mat1f facing_camera(const cv::Mat1f& z_m, const Pinhole& camera);

/// One picture of a panel, and the title above it.
struct Tile {
    std::string title;
    cv::Mat3b picture; ///< empty = an empty tile
};

/// Tiles side by side, each scaled to the first non-empty one's height, with titles.
[[nodiscard]] cv::Mat3b panel(const std::vector<Tile>& tiles);

} // namespace scanshade
