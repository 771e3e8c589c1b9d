// The steps of one frame between loading and attaching: what the walk takes in turns, and the library one by one.
#pragma once

#include "ao/frame.h"
#include "apps/walk/work.h"

namespace scanshade {

/// Puts what is known of the loaded frame into its row: its size, the share of valid depths, its warnings.
void describe_frame(Work& work);

/// Finds the frame's camera and projects it. Throws Error where that camera sees none of the recorded points.
void prepare_view(Work& work, const ProjectOptions& range);

/// Computes the projected frame by itself. `method` and what it keeps on its device must outlive `work`.
void compute_alone(Work& work, FrameAo& method, const DepthNoise& noise);

/// Computes a value for every point of the frame's cloud, without a camera's view, and attaches them. Throws
/// OutOfMemory before it begins where there is too little.
void compute_points(Work& work, PointMethod& points);
/// The same where normals, faces and scanner are not those of the cloud's file. `set.points` are the cloud's.
void compute_points(Work& work, PointMethod& points, const PointSet& set,
                    const std::optional<Eigen::Vector3d>& scanner);

} // namespace scanshade
