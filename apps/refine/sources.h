// The sources of `refine` without depth images: pictures of a board and organised clouds; and first cameras.
#pragma once

#include "io/captures/capture.h"
#include "projection/calibration/boards/board_detection.h"
#include "projection/calibration/refinement.h"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// The flags of the first camera; `camera` takes precedence over `fov_degrees` (across the width).
struct FirstCamera {
    std::string camera;        ///< file, name of a known camera, or fx,fy,cx,cy
    std::string colour_camera; ///< the same of a secondary colour camera, where colour is not registered
    double fov_degrees = 0;
    LensModel lens = LensModel::brown_conrady;
};

/// The first camera from the flags, sized to the images. Throws Error where it is for images of another size.
[[nodiscard]] std::optional<Camera> given_camera(const std::string& camera, double fov_degrees, LensModel lens,
                                                 cv::Size size);
/// The first camera without flags: the focal length of the picture's EXIF, else a usual lens.
[[nodiscard]] Camera guessed_camera(const std::filesystem::path& picture, LensModel lens, cv::Size size);

/// Bundle adjustment over the pictures of a board in a folder. Pictures without a board, damaged pictures and pictures
/// of an unusual size are left out, each with a note. Throws Error where no camera can be found.
[[nodiscard]] calibration::Refinement refine_from_boards(const std::filesystem::path& folder,
                                                         const calibration::Target& target, const FirstCamera& first,
                                                         calibration::RefineOptions options);

/// Fits a camera to the pixels and points of a capture's organised clouds.
[[nodiscard]] calibration::Refinement refine_from_clouds(const Capture& capture, const std::vector<std::size_t>& frames,
                                                         const FirstCamera& first, calibration::RefineOptions options);

} // namespace scanshade
