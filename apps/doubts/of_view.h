// Rules for what a camera sees: the camera, its depth image, and how both suit the radius.
#pragma once

#include "apps/doubts/sentences.h"
#include "projection/camera.h"
#include "projection/length_unit.h"
#include "projection/project.h"
#include "projection/sensor/noise.h"

namespace scanshade {

void doubt_camera(const Camera& camera, Doubts& doubts);
/// Planes that bend as those of ranges, of disparities or of a renderer's depth buffer do.
void doubt_kind(const DepthImage& depth, Doubts& doubts);
/// One value at either end of the depths that no surface explains.
void doubt_ends(const DepthImage& depth, const LengthUnit& unit, Doubts& doubts);
/// A radius of 0 or less is of a method without one.
void doubt_radius_in_view(const DepthImage& depth, double radius_m, const LengthUnit& unit, Doubts& doubts);
void doubt_noise_in_view(const DepthImage& depth, double radius_m, const DepthNoise& noise, const LengthUnit& unit,
                         Doubts& doubts);
/// Depth that was rounded so coarsely that surfaces are stairs.
void doubt_steps_in_view(double radius_m, const DepthNoise& noise, const LengthUnit& unit, Doubts& doubts);
/// Whether depth shows hollows well within the radius, such as corners and what stands before something: a share of
/// the pixels lies behind the line between neighbours.
[[nodiscard]] bool has_hollows(const DepthImage& depth, double radius_m);

} // namespace scanshade
