// Rules for clouds that are computed without a view.
#pragma once

#include "ao/frame.h"
#include "apps/doubts/sentences.h"
#include "projection/frame.h"

namespace scanshade {

/// Coordinates in degrees.
void doubt_unit(const Cloud& cloud, Doubts& doubts);
/// What is no cloud of surfaces: hardly any points, or the numbers of lines in place of x.
void doubt_points(const Cloud& cloud, Doubts& doubts);
void doubt_radius_of_points(const Cloud& cloud, const PointVisibility& found, Doubts& doubts);
/// Coordinates that were rounded to steps (coordinate_steps.h).
void doubt_steps(const Cloud& cloud, const PointVisibility& found, Doubts& doubts);
/// Whether a share of some points have others within the radius in front of their planes. True where nothing is known.
[[nodiscard]] bool has_hollows(const Cloud& cloud, const PointVisibility& found);

} // namespace scanshade
