// Rules for what a camera sees: the camera, its depth image, and how both suit the radius.
#pragma once

#include "projection/base/finding.h"
#include "projection/camera.h"
#include "projection/length_unit.h"
#include "projection/project.h"
#include "projection/sensor/noise.h"

namespace scanshade {

void check_camera(const Camera& camera, Findings& findings);
/// Planes that bend as those of ranges, of disparities or of a renderer's depth buffer do.
void check_kind(const DepthImage& depth, Findings& findings);
/// One value at either end of the depths that no surface explains.
void check_ends(const DepthImage& depth, const LengthUnit& unit, Findings& findings);
/// A radius of 0 or less is of a method without one.
void check_radius_in_view(const DepthImage& depth, double radius_m, const LengthUnit& unit, Findings& findings);
void check_noise_in_view(const DepthImage& depth, double radius_m, const DepthNoise& noise, const LengthUnit& unit,
                         Findings& findings);
/// Depth that was rounded so coarsely that surfaces are stairs.
void check_steps_in_view(double radius_m, const DepthNoise& noise, const LengthUnit& unit, Findings& findings);
/// Whether depth shows hollows well within the radius, such as corners and what stands before something: a share of
/// the pixels lies behind the line between neighbours.
[[nodiscard]] bool has_hollows(const DepthImage& depth, double radius_m);

} // namespace scanshade
