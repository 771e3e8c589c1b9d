// The results of `refine`: a table on the terminal, details for the camera's file, and a page with plots.
#pragma once

#include "apps/json.h"
#include "projection/calibration/refinement.h"

#include <string>

namespace scanshade {

/// Everything but the camera itself, for our JSON: status, numbers with sigmas, covariance, model selection, errors,
/// views, coverage, the pixel's sigma over the image, effects.
[[nodiscard]] json details_of(const calibration::Refinement& refinement, double took_s);

/// The same as a person reads it on a terminal.
[[nodiscard]] std::string summary_of(const calibration::Refinement& refinement, double took_s);

/// A whole page: tables and inline SVG (residuals over the image, views, coverage, the pixel's sigma).
[[nodiscard]] std::string page_of(const calibration::Refinement& refinement, double took_s);

/// One sentence: sound or doubtful, and why.
[[nodiscard]] std::string verdict_of(const calibration::Refinement& refinement);

/// "refined" or "unchanged"
[[nodiscard]] std::string status_of(const calibration::Refinement& refinement);

} // namespace scanshade
