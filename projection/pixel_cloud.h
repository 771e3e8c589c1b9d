// The camera of a cloud whose points are the pixels of one depth image, written without their grid.
#pragma once

#include "projection/fit_pinhole.h"

#include <optional>

namespace scanshade {

/// The median of |z| of a sample of the points, but of those at 0; 0 where there are none.
[[nodiscard]] double middle_depth(const Cloud& cloud);

/// Programs write a depth image as a cloud row by row and leave its holes out. All points then lie on the rays of a
/// grid of pixels, whose pitch the steps from point to point tell. `flipped`: they look along -z with y up (OpenGL).
struct PixelCloud {
    PinholeFit fit; ///< the camera's image is cut to the pixels that hold points
    bool flipped = false;
};

/// Nothing where points are no such pixels: fewer than a thousand, in another order, off the pixels' rays by more than
/// a fifth of a pixel, several in one, or with too few neighbours (a sample of an image has holes everywhere).
[[nodiscard]] std::optional<PixelCloud> pixel_cloud(const Cloud& cloud);

} // namespace scanshade
