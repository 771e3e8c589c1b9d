// Cameras on disk: ours, Open3D's, OpenCV's, ROS's, Kalibr's, COLMAP's, PCL's, 3x3 text matrices, and fx,fy,cx,cy from
// the command line.
#pragma once

#include "projection/camera.h"
#include "projection/frame.h"

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// A camera as a file states it.
struct CameraFile {
    Camera camera; ///< pinhole.size is 0x0 where the file gives none
    std::optional<double> depth_units_per_metre;
    Registration registration = Registration::unknown;
    std::vector<std::string> warnings;
    DepthCorrection depth_correction = {};   ///< of the depths that this camera records
    std::optional<ColourCamera> colour = {}; ///< the secondary camera, if another one took the colour
    double pose_time_offset_s = 0;           ///< an image stamped t was taken at t + offset of the poses' clock
    /// The file has fy < 0: its y axis, and that of poses made with it, is upwards. `camera` has y downwards.
    bool y_was_up = false;
};

/// Reads, told apart by content:
/// - ours: {"fx","fy","cx","cy","width","height", optional "distortion":[k1,k2,p1,p2,k3] or, rational,
/// [k1,k2,p1,p2,k3,k4,k5,k6], "depth_units_per_metre", "registered",
/// "depth_correction":{"scale","offset_m","curve_per_m"}, "pose_time_offset_s", "colour": a camera of the same keys
/// with "colour_from_depth":[[4 numbers] x 4], row by row}; a fisheye has "fisheye":[k1,k2,k3,k4] instead of
/// "distortion"
/// - Open3D: {"width","height","intrinsic_matrix":[9 numbers, column-major]}
/// - OpenCV's yml (camera_matrix, distortion_coefficients; `fisheye_model: 1` for a fisheye), ROS's camera_info yaml
///   (plumb_bob, rational_polynomial, equidistant), Kalibr's camchain yaml (pinhole with radtan, equidistant or none;
///   cam0, and cam1 with its T_cn_cnm1 as the colour camera)
/// - COLMAP's cameras.txt (its first camera; SIMPLE_PINHOLE to FULL_OPENCV and OPENCV_FISHEYE)
/// - a 3x3 row-major text matrix (7-Scenes, BundleFusion), BundleFusion's info.txt, PCL's XML beside .pclzf
/// Throws Error naming the file, and the key, line or column, for: JSON syntax, missing keys, wrong counts, non-finite,
/// zero focal lengths, a negative fx, a row-major Open3D matrix, short matrices. A negative fy is ICL-NUIM's way to say
/// that y is upwards: it is read, with a warning.
[[nodiscard]] CameraFile read_camera_file(const std::filesystem::path& file);

/// `text` is a file's path, the name of a known camera (io/cameras/known_cameras.h), or "fx,fy,cx,cy". Throws Misuse
/// when it is none of these.
[[nodiscard]] CameraFile camera_from_argument(const std::string& text);

enum class CameraFormat { scanshade, open3d, opencv, ros, kalibr, colmap };
/// Of those that are written.
[[nodiscard]] std::vector<std::string> camera_format_names();
/// By name, or where that is empty by the file's extension. Throws Misuse listing what there is.
[[nodiscard]] CameraFormat camera_format(const std::filesystem::path& file, const std::string& name);

/// How the camera was found, as far as the format says; empty and NaN if unknown.
struct CameraQuality {
    double rms_px = std::numeric_limits<double>::quiet_NaN(); ///< OpenCV's avg_reprojection_error
    std::vector<double> view_rms_px;                          ///< OpenCV's per_view_reprojection_errors
    std::string details;                                      ///< a JSON object, kept by ours under "refinement"
};

/// Writes atomically. Throws Error naming the file where the format cannot hold the whole camera (a lens for Open3D,
/// k3 to k6 for Kalibr, a colour camera for all but ours and Kalibr's, a depth correction for all but ours): nothing is
/// dropped.
void write_camera_file(const std::filesystem::path& file, const CameraFile& camera,
                       CameraFormat format = CameraFormat::scanshade, const CameraQuality& quality = {});

} // namespace scanshade
