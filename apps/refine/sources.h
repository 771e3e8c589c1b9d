// Where `refine` finds evidence: pictures of a board, organised clouds, or a recording's own frames.
#pragma once

#include "io/capture.h"
#include "projection/calibration/boards/board_detection.h"
#include "projection/calibration/refinement.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// What the user said of the first camera; `camera` wins over `fov_degrees` (across the width).
struct FirstCamera {
    std::string camera;        ///< file, name of a known camera, or fx,fy,cx,cy
    std::string colour_camera; ///< the same of the camera beside the depth camera, where colour is not registered
    double fov_degrees = 0;
    LensModel lens = LensModel::brown_conrady;
};

/// The camera to start from as the user gave it, sized to the images. Throws Error where it is for other ones.
[[nodiscard]] std::optional<Camera> given_camera(const std::string& camera, double fov_degrees, LensModel lens,
                                                 cv::Size size);
/// What is left to start from: the focal length that the picture's EXIF tells, else a usual lens.
[[nodiscard]] Camera guessed_camera(const std::filesystem::path& picture, LensModel lens, cv::Size size);

/// Bundle adjustment over the pictures of a board in a folder. Pictures without a board, damaged ones and those of
/// another size than most are left out, each with a note. Throws Error where no camera can be found.
[[nodiscard]] calibration::Refinement refine_from_boards(const std::filesystem::path& folder,
                                                         const calibration::Target& target, const FirstCamera& first,
                                                         calibration::RefineOptions options);

/// Pixel and point pairs of a capture's organised clouds.
[[nodiscard]] calibration::Refinement refine_from_clouds(const Capture& capture, const std::vector<std::size_t>& frames,
                                                         const FirstCamera& first, calibration::RefineOptions options);

/// What the user said of a recording.
struct RecordingOptions {
    std::string evidence = "auto";   ///< auto (tracks where there is colour), tracks, depth (alone)
    std::string registered = "auto"; ///< auto (what the capture says; unknown counts as yes), yes, no
    std::string poses =
        "auto";      ///< auto, keep (they are the truth), refine (they are near it), ignore (follow the camera)
    int frames = 24; ///< at most so many, evenly spread
};

struct RecordingResult {
    calibration::Refinement refinement;
    CameraFile file; ///< the depth camera with all that was found: correction, colour camera, time offset
    std::vector<std::pair<std::string, Eigen::Isometry3d>> poses = {}; ///< name, world_from_camera of each frame used
    std::vector<double> stamps_s = {}; ///< of the frames used; their indices where they have none
};

/// Tracks, depths and poses of a recording's own frames, or depths alone. Registered: the one camera of both images.
/// Unregistered: the colour camera and its place beside the depth camera. A capture without a camera starts from the
/// field of view, its pictures' EXIF, or not at all.
[[nodiscard]] RecordingResult refine_from_recording(Capture capture, const std::vector<std::size_t>& frames,
                                                    const FirstCamera& first, const RecordingOptions& recording,
                                                    calibration::RefineOptions options);

} // namespace scanshade
