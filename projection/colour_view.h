// Colour laid over depth, and what is known of depth pixels over colour: the walk between two cameras side by side.
#pragma once

#include "projection/frame.h"

namespace scanshade {

/// The surface that a depth image recorded, as the colour camera sees it: on the colour image's pixels.
struct SurfaceInColour {
    cv::Mat1f z_m;     ///< metres along the colour camera's axis; 0 = no surface was recorded there
    cv::Mat2f seen_at; ///< the place in the recorded depth image (column, row) that is seen there; NaN = none
};

/// Neighbouring depth pixels of one surface (same_surface_m) are spanned by triangles, which the colour camera sees
/// with a depth test; over edges and holes nothing is spanned. `depth_m` and `depth_camera` are as recorded, lens
/// included.
[[nodiscard]] SurfaceInColour surface_in_colour(const cv::Mat1f& depth_m, const Camera& depth_camera,
                                                const ColourCamera& colour);

/// A colour for each recorded depth pixel, between the colour image's pixels.
struct ColourOnDepth {
    cv::Mat3b colour; ///< black where none is known
    cv::Mat1b known;  ///< 0: no depth, outside the colour image, or hidden from the colour camera by something in front
};
/// A pixel counts as hidden when the surface is nearer in any of the 3x3 colour pixels about it: beside an outline half
/// a pixel of miscalibration would otherwise lend it the colour of what stands in front.
[[nodiscard]] ColourOnDepth colour_on_depth(const cv::Mat3b& colour, const cv::Mat1f& depth_m,
                                            const Camera& depth_camera, const ColourCamera& colour_camera,
                                            const SurfaceInColour& surface);

/// Values of depth pixels (NaN = unknown) on the colour image's pixels: of the depth pixels around each place those
/// that are known, weighted by nearness; NaN where no surface is seen.
[[nodiscard]] cv::Mat1f on_colour_pixels(const cv::Mat1f& per_depth_pixel, const SurfaceInColour& surface);

} // namespace scanshade
