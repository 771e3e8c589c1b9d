// The pinhole camera of an organised cloud, from the cloud's own points.
#pragma once

#include "projection/frame.h"

namespace scanshade {

/// The pinhole that explains an organised cloud's own points: least squares of u = fx x/z + cx, v = fy y/z + cy.
struct PinholeFit {
    Pinhole camera;    ///< size is the cloud's grid
    double rms_px = 0; ///< residual over the points used, both axes together
    int points = 0;    ///< points used: those beyond 3 sigma of a first fit are left out of the second
};

/// Throws Error where the points do not determine it: an unorganised cloud, fewer than 3 valid points, all in one row
/// or column, focal lengths that are not positive, or a residual above 2 px (then the grid is not a pinhole image).
[[nodiscard]] PinholeFit fit_pinhole(const Cloud& cloud);

} // namespace scanshade
