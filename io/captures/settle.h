// Opening, after the listing: what the user, the camera's file and the poses say about the whole capture.
#pragma once

#include "io/captures/listing/layouts.h"

namespace scanshade {

/// Camera, depth encoding and registration: the user's camera, or the listing's. Returns whether the camera's y axis
/// was upwards, so that the capture's own poses are those of such cameras.
[[nodiscard]] bool settle_camera(Listing& listing, const CaptureOptions& options);
/// Gives a single depth image its colour, which the user says belongs to it.
void take_colour(Capture& capture, const std::filesystem::path& colour);

/// The same poses for cameras with y downwards, in a world whose y is turned as well: mirrored twice, they stay
/// rotations.
void turn_poses_y_down(Capture& capture);
/// Takes away poses that are all the same, which recorders write where they do not track the camera, and warns. Of a
/// camera that stands still they would tell nothing more.
void leave_out_equal_poses(Capture& capture);
/// Replaces the recording's poses by those of a file. Throws Error if no frame has one.
void take_poses(Capture& capture, const CaptureOptions& options);
/// Warns of what looks like poses or cameras in a folder that was read as a generic one.
void tell_unused(const std::filesystem::path& folder, Listing& listing);

/// In a capture whose unit is arbitrary, depth and poses share the unit. If it was told now, both become metres. If
/// not, both are measured by the scene: a workspace of twice the numbers is the same to the walk.
void settle_unit(Capture& capture, bool listed_in_arbitrary_unit, const CaptureOptions& options);

} // namespace scanshade
