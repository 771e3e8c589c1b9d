// Means of values over neighbouring texels on the surface, never across the image.
#pragma once

#include "ao/texture/texel_surface.h"

#include <opencv2/core.hpp>

namespace scanshade {

/// The means reach so many texels in each direction.
inline constexpr int means_reach = 3;

/// The mean of each texel's value and its neighbours': those at most `means_reach` texels or `most` away in space, with
/// like normals and values, in whichever chart they are. Texels of several triangles, and those without a value (NaN),
/// stay as they are and count for no other.
/// `noise`: standard deviation of a value, at most; values that differ by more than a few of these are not of one
/// surface: a contact or an outline is between them.
[[nodiscard]] cv::Mat1f means_on_surface(const Texels& texels, const TexelSurface& surface, const cv::Mat1f& values,
                                         float most, float noise);

} // namespace scanshade
