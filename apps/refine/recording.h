// The source of `refine` with depth images: a recording's own frames.
#pragma once

#include "apps/refine/sources.h"
#include "io/cameras/camera_file.h"

#include <Eigen/Geometry>

namespace scanshade {

/// The flags of a recording.
struct RecordingOptions {
    std::string observations = "auto"; ///< auto (tracks where there is colour), tracks, depth (alone)
    std::string registered = "auto";   ///< auto (as the capture says; unknown counts as yes), yes, no
    std::string poses = "auto"; ///< auto, keep (as exact), refine (from the recorded ones), ignore (estimate them)
    int frames = 24;            ///< at most so many, evenly spread
};

struct RecordingResult {
    calibration::Refinement refinement;
    CameraFile file; ///< the depth camera with correction, colour camera and time offset
    std::vector<std::pair<std::string, Eigen::Isometry3d>> poses = {}; ///< name, world_from_camera of each frame used
    std::vector<double> stamps_s = {}; ///< of the frames used; their indices where they have none
};

/// Refines from tracks, depths and poses of a recording's frames, or from depths alone. Registered: the one camera of
/// both images. Unregistered: the secondary colour camera and its extrinsics. A capture without a camera starts from
/// the field of view or its pictures' EXIF. Throws Error where there is neither.
[[nodiscard]] RecordingResult refine_from_recording(Capture capture, const std::vector<std::size_t>& frames,
                                                    const FirstCamera& first, const RecordingOptions& recording,
                                                    calibration::RefineOptions options);

} // namespace scanshade
