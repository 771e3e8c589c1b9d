// Camera poses on disk: TUM rows, 4x4 matrices, Redwood logs; every pose is world_from_camera, rigid and finite.
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

struct StampedPose {
    double stamp_s = 0;
    Eigen::Isometry3d world_from_camera;
};

/// TUM's groundtruth.txt: "time tx ty tz qx qy qz qw" per line. Lines that cannot be used (not a number, NaN, zero
/// quaternion) are left out, each with a warning naming the line; quaternions off unit length are normalised. Sorted by
/// time.
[[nodiscard]] std::vector<StampedPose> read_tum_trajectory(const std::filesystem::path& file,
                                                           std::vector<std::string>& warnings);

/// A camera's pose: interpolated if the poses before and after are near enough in time, else the nearer one.
[[nodiscard]] std::optional<Eigen::Isometry3d> pose_at(const std::vector<StampedPose>& poses, double stamp_s,
                                                       double limit_s);

/// The same rows without time: the pose of row N (counted from 1, comments and blank lines left out).
[[nodiscard]] std::map<std::size_t, Eigen::Isometry3d> read_pose_rows(const std::filesystem::path& file,
                                                                      std::vector<std::string>& warnings);

/// Redwood's .log: a line of three integers, of which the first is the frame's index, then a 4x4 matrix.
/// A damaged block ends the reading with a warning naming the line.
[[nodiscard]] std::map<std::size_t, Eigen::Isometry3d> read_redwood_log(const std::filesystem::path& file,
                                                                        std::vector<std::string>& warnings);

/// A file that holds one pose.
struct MatrixPose {
    std::optional<Eigen::Isometry3d> world_from_camera;
    std::string problem; ///< the file is damaged: names file and line
    std::string
        warning; ///< why there is no pose though the file is sound (tracking lost, not rigid), or what was completed
};

/// A file's matrix, checked; `where` begins the sentences.
[[nodiscard]] MatrixPose checked_pose(const Eigen::Matrix4d& world_from_camera, const std::string& where);
/// Four rows of four numbers, or three; the rest is that of the identity. Empty, or why not. `rows`, if given, gets
/// their number.
[[nodiscard]] std::string read_matrix(const std::filesystem::path& file, Eigen::Matrix4d& matrix,
                                      std::size_t* rows = nullptr);
[[nodiscard]] Eigen::Isometry3d pose_from(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation);
/// OpenGL's and ARKit's cameras have y up and look along -z: the pose of ours, world_from_camera.
[[nodiscard]] Eigen::Matrix4d from_opengl(const Eigen::Matrix4d& world_from_camera);

/// 7-Scenes' and BundleFusion's pose.txt: 4x4, or 3x4 with the last row left out. Infinities mean that tracking was
/// lost.
[[nodiscard]] MatrixPose read_matrix_pose(const std::filesystem::path& file);

} // namespace scanshade
