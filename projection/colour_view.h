// Maps colour onto depth pixels, and values of depth pixels onto the colour image of a secondary camera.
#pragma once

#include "projection/frame.h"

namespace scanshade {

/// The surface that a depth image recorded, on the colour image's pixels.
struct SurfaceInColour {
    cv::Mat1f z_m;     ///< metres along the colour camera's axis; 0 = no surface was recorded there
    cv::Mat2f seen_at; ///< the position (column, row) in the recorded depth image; NaN = none
};

/// Triangles connect neighbouring depth pixels of one surface (same_surface_m), never across edges and holes. They are
/// rendered into the colour camera with a depth test. `depth_m` and `depth_camera` are as recorded, with lens
/// distortion.
[[nodiscard]] SurfaceInColour surface_in_colour(const cv::Mat1f& depth_m, const Camera& depth_camera,
                                                const ColourCamera& colour);

/// A colour for each recorded depth pixel, interpolated in the colour image.
struct ColourOnDepth {
    cv::Mat3b colour; ///< black where none is known
    cv::Mat1b known;  ///< 0: no depth, outside the colour image, or hidden from the colour camera by something in front
    cv::Mat3w deep;   ///< `colour` of a colour image of 16 bits; empty without
};
/// A pixel counts as hidden when the surface is nearer in any of the 3x3 colour pixels around it. Otherwise half a
/// pixel of miscalibration would give pixels along an outline the colour of the object in front.
[[nodiscard]] ColourOnDepth colour_on_depth(const cv::Mat3b& colour, const cv::Mat1f& depth_m,
                                            const Camera& depth_camera, const ColourCamera& colour_camera,
                                            const SurfaceInColour& surface, const cv::Mat3w& deep_colour = {});

/// Values of depth pixels (NaN = unknown) on the colour image's pixels: means of the known depth pixels around each
/// position, weighted by nearness; NaN where no surface is seen.
[[nodiscard]] cv::Mat1f on_colour_pixels(const cv::Mat1f& per_depth_pixel, const SurfaceInColour& surface);

} // namespace scanshade
