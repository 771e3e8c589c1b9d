// Cameras on disk: JSON (ours and Open3D's), 3x3 text matrices, and fx,fy,cx,cy from the command line.
#pragma once

#include "projection/camera.h"
#include "projection/frame.h"

#include <filesystem>
#include <optional>
#include <string>

namespace scanshade {

/// A camera as a file states it.
struct CameraFile {
    Camera camera; ///< pinhole.size is 0x0 where the file gives none
    std::optional<double> depth_units_per_metre;
    Registration registration = Registration::unknown;
    std::vector<std::string> warnings;
};

/// Reads, told apart by content:
/// - ours: {"fx","fy","cx","cy","width","height", optional "distortion":[k1,k2,p1,p2,k3], "depth_units_per_metre",
/// "registered"}
/// - Open3D: {"width","height","intrinsic_matrix":[9 numbers, column-major]}
/// - a 3x3 row-major text matrix (7-Scenes, BundleFusion)
/// Throws Error naming the file, and the key, line or column, for: JSON syntax, missing keys, wrong counts, non-finite,
/// zero or negative focal lengths (with a hint that fy < 0 is ICL-NUIM's flip), a row-major Open3D matrix, short
/// matrices.
[[nodiscard]] CameraFile read_camera_file(const std::filesystem::path& file);

/// `text` is a file's path, or "fx,fy,cx,cy". Throws Misuse when it is neither.
[[nodiscard]] CameraFile camera_from_argument(const std::string& text);

/// Writes ours, atomically.
void write_camera_file(const std::filesystem::path& file, const CameraFile& camera);

} // namespace scanshade
