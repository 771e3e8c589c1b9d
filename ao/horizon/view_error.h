// How far sky view is off, cell by cell: what errors of heights, missing surface and few directions do to it.
//
// Heights get errors once more, drawn as large as they are believed to be, and the view is computed again: the change
// is what the first errors did. Relief between cells is an error of heights in proportion to their curvature. Missing
// surface and directions add shares of what is hidden. The factors are fitted (`developers_bench relief-errors`).
#pragma once

#include "ao/horizon/horizon.h"

namespace scanshade::horizon {

/// Errors of heights with a given standard deviation, for each cell by its place: those of a part of a raster, whose
/// first row is `first_row` of the whole, are those of the whole. Each is alike over about 2^`octave` cells.
[[nodiscard]] float drawn_error(int row, int column, int octave, unsigned stream);

/// Expected RMSE of layers_of(field, settings, {.svf}) in `rows`, NaN where there is none. `errors`: one draw of the
/// heights' errors, as large as the field and in its unit; empty = heights are exact. `first_row`: of the field within
/// the whole where error_reach_of() rows are known on either side. Throws Misuse as layers_of().
[[nodiscard]] cv::Mat1f svf_error_of(const HeightField& field, const Settings& settings, const cv::Mat1f& errors,
                                     cv::Range rows, int first_row = 0);

[[nodiscard]] int error_reach_of(double cell, const Settings& settings);

/// Half the second difference of heights, RMS of both axes: the height that a cell does not show between its
/// neighbours, in the unit of heights; NaN where no three cells in a row are known.
[[nodiscard]] cv::Mat1f bend_of(const cv::Mat1f& z);

/// Means of the known of the (2 half + 1)² cells around each, NaN where none is. Bits do not depend on other cells.
[[nodiscard]] cv::Mat1f mean_of_known(const cv::Mat1f& values, int half);

} // namespace scanshade::horizon
