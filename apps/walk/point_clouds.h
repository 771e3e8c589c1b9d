// Clouds that no single camera sees: which those are, their values, and how they look from two sides.
#pragma once

#include "ao/method.h"
#include "apps/walk/batch_options.h"
#include "projection/attach.h"
#include "projection/frame.h"

#include <string>
#include <vector>

namespace scanshade {

/// Whether this cloud is computed from its points. Automatically: unless the user named a camera, or the cloud is a
/// pinhole image's grid. `notes` receives why.
[[nodiscard]] bool takes_points(const Frame& frame, const BatchOptions& options, std::vector<std::string>& notes);

/// The cloud with its own normals, faces and viewpoint, as `method` sees it.
[[nodiscard]] PointVisibility visibility_of_points(const Frame& frame, PointMethod& method);

/// Values of points, with how many of the valid ones have one.
[[nodiscard]] Attached attached_points(const Cloud& cloud, std::vector<float> visibility);

/// The cloud's points from two opposite sides, obliquely from above (z up): colours, or light grey, times visibility;
/// below them visibility alone. Points are as large as they stand apart; those without a value are a dim blue; those
/// that face away are left out, so that one looks into rooms.
[[nodiscard]] cv::Mat3b two_sides(const Cloud& cloud, const PointVisibility& found, double strength);

} // namespace scanshade
