// Rules for clouds that are computed without a view.
#pragma once

#include "ao/frame.h"
#include "projection/base/finding.h"
#include "projection/frame.h"

namespace scanshade {

/// Coordinates in degrees.
void check_unit(const Cloud& cloud, Findings& findings);
/// What is no cloud of surfaces: hardly any points, or the numbers of lines in place of x.
void check_points(const Cloud& cloud, Findings& findings);
void check_radius_of_points(const Cloud& cloud, const PointVisibility& found, Findings& findings);
/// Coordinates that were rounded to steps (coordinate_steps.h).
void check_steps(const Cloud& cloud, const PointVisibility& found, Findings& findings);
/// Whether a share of some points have others within the radius in front of their planes. True where nothing is known.
[[nodiscard]] bool has_hollows(const Cloud& cloud, const PointVisibility& found);

} // namespace scanshade
