// Fits the tables of expected errors of clouds to points whose true error is known.
#pragma once

#include "ao/cloud/cloud_error.h"

#include <span>

namespace scanshade {

/// A point: what it shows, and the square of how far its visibility is off.
struct CloudErrorSample {
    CloudErrorSigns signs;
    float square = 0;
    bool turned = false; ///< its normal is on the wrong side
    int scene = 0;       ///< points of one scene are left out together
    int cloud = 0;       ///< of all
};

/// Tables whose expected squares have the samples' sums over every knot (as fitted_errors() of depth images has), drawn
/// to neighbouring knots where samples are few. Errors never rise with the span nor with the sureness of the side, nor
/// fall with the repeated error. Points that were checked serve for the unchecked table, too. Samples of the scene
/// `without` are left out. Nothing but zeros where there are none.
[[nodiscard]] CloudErrorTables fitted_cloud_errors(std::span<const CloudErrorSample> samples, int without = -1);

} // namespace scanshade
