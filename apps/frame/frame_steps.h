// The steps of one frame from loaded to findings. The walk takes them in turns, the library one after the other.
#pragma once

#include "ao/frame.h"
#include "apps/frame/frame_images.h"
#include "apps/frame/work.h"

namespace scanshade {

/// Puts what is known of the loaded frame into its row: its size, the share of valid depths, its warnings.
void describe_frame(Work& work);

/// Decides whether the loaded frame's cloud is computed from its points; the row's notes have the reason.
void choose_points_or_view(Work& work, CloudWalk walk);

/// Finds the frame's camera and projects it. Throws Error where that camera sees none of the recorded points.
void prepare_view(Work& work, const ProjectOptions& range);

/// Computes the projected frame by `method`, or, with a sequence, with its neighbours in the capture. `method` and what
/// it keeps on its device must outlive `work`.
void compute_view(Work& work, FrameAo& method, const DepthNoise& noise, const Capture& capture,
                  SequenceAo* sequence = nullptr);

/// Computes a value for every point of the frame's cloud, without a camera's view, and attaches them. Throws
/// OutOfMemory before it begins where there is too little.
void compute_points(Work& work, PointMethod& points);
/// The same where normals, faces and scanner are not those of the cloud's file. `set.points` are the cloud's.
void compute_points(Work& work, PointMethod& points, const PointSet& set,
                    const std::optional<Eigen::Vector3d>& scanner);

/// What a computed frame is judged by. Reads `row.valid_share` and `row.coverage`.
[[nodiscard]] ComputedFrame computed_frame(const Work& work);

/// Attaches the values to what was recorded and judges them: coverage, mean, expected error and doubts of the row.
/// Returns the images that `outputs` asks for; none of a cloud computed from its points. See finish().
[[nodiscard]] FrameImages attach_values(Work& work, const FrameOptions& options, const Outputs& outputs,
                                        bool every_error = false);

} // namespace scanshade
