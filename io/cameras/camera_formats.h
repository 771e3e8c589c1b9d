// The table of camera formats, and one function each way: what read_camera_file() and write_camera_file() choose from.
#pragma once

#include "io/cameras/camera_file.h"
#include "io/text.h"

#include <array>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

inline constexpr int widest_image = 1 << 16;

[[noreturn]] void refuse_camera(const std::filesystem::path& file, const std::string& why);

/// Refuses focal lengths that no pinhole has; `names` are the file's words for fx, fy, cx, cy.
void check_numbers(const std::filesystem::path& file, const Pinhole& camera, const std::array<std::string, 4>& names);

/// A 4x4 matrix as a rigid transform, its rotation made exact. Throws Error naming the key where it is none to 1e-3.
[[nodiscard]] Eigen::Isometry3d rigid_from(const std::filesystem::path& file, const Eigen::Matrix4d& matrix,
                                           const std::string& key);

// Each throws Error naming file and place.
[[nodiscard]] CameraFile camera_from_json(const std::filesystem::path& file, const std::string& text);
/// Of an object as camera_from_json() reads it, where sizes may be missing.
[[nodiscard]] CameraFile camera_from_keys(const std::filesystem::path& file, const nlohmann::json& object);
/// The one camera in a JSON of others, by our names of its keys, with the numbers that stand around it. Of several,
/// that of depth, with a warning. Throws Error naming the file where there is none, or where none says that it is
/// depth's.
[[nodiscard]] nlohmann::json in_our_words(const std::filesystem::path& file, const nlohmann::json& root,
                                          std::vector<std::string>& warnings);
/// What other keys of a camera's object say: takes the unit of depths, and names the numbers that nothing reads.
void use_other_keys(const std::filesystem::path& file, const nlohmann::json& object, CameraFile& result);
/// Lines of a key and a number, whatever stands between them: fx, fy, cx or ppx ..., as ORB-SLAM's settings have them
/// behind "Camera.", and RealSense Viewer's tables with other words. Of several sections of an INI file none is chosen.
[[nodiscard]] CameraFile camera_from_lines(const std::filesystem::path& file, const std::vector<TextLine>& lines);
/// Whether one of them says fx.
[[nodiscard]] bool has_camera_keys(const std::vector<TextLine>& lines);
[[nodiscard]] CameraFile camera_from_yaml(const std::filesystem::path& file, const std::string& text);
[[nodiscard]] CameraFile camera_from_xml(const std::filesystem::path& file, const std::string& text);
[[nodiscard]] CameraFile camera_from_info(const std::filesystem::path& file, const std::vector<TextLine>& lines);
/// ScanNet's SCAN.txt: depth's camera, and colour's where it is there.
[[nodiscard]] CameraFile camera_from_scan(const std::filesystem::path& file, const std::vector<TextLine>& lines);
[[nodiscard]] CameraFile camera_from_matrix(const std::filesystem::path& file, const std::vector<TextLine>& lines);
[[nodiscard]] CameraFile camera_from_colmap(const std::filesystem::path& file, const std::vector<TextLine>& lines);
/// Whether a line reads "ID MODEL WIDTH HEIGHT numbers", as COLMAP's cameras.txt does.
[[nodiscard]] bool is_colmap(const std::vector<TextLine>& lines);

// A value that the format cannot hold is an Error; nothing is dropped.
[[nodiscard]] std::string camera_as_json(const CameraFile& camera, const std::string& details);
[[nodiscard]] std::string camera_as_open3d(const Camera& camera);
[[nodiscard]] std::string camera_as_opencv(const Camera& camera, const CameraQuality& quality);
[[nodiscard]] std::string camera_as_ros(const Camera& camera);
[[nodiscard]] std::string camera_as_kalibr(const CameraFile& camera);
[[nodiscard]] std::string camera_as_colmap(const Camera& camera);

// --- the table ---

/// A camera file's content.
struct CameraText {
    const std::filesystem::path& file;
    const std::string& bytes;
    std::vector<TextLine> lines;
};

/// A new format is a row in camera_file.cpp and its functions.
struct CameraFormatRow {
    const char* name; ///< of --format, if it is written
    const char* recognised;
    const char* content; ///< what of the format is read
    /// The first row whose `is` holds reads the file; formats of one syntax share a reader, which goes by their keys.
    bool (*is)(const CameraText& text);
    CameraFile (*read)(const CameraText& text);
    std::string_view extension =
        {}; ///< of files that are written; the first row of one is what it means without --format
    std::optional<CameraFormat> format = {}; ///< none: not written
    std::string (*written)(const CameraFile& camera, const CameraQuality& quality) = nullptr;
};
[[nodiscard]] std::span<const CameraFormatRow> camera_formats();

} // namespace scanshade
