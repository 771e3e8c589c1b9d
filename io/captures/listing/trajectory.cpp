// Poses from text, each row checked: numbers finite, quaternions not zero, matrices rigid.
#include "io/captures/listing/trajectory.h"

#include "io/text.h"
#include "projection/base/error.h"
#include "projection/motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fmt/format.h>

namespace scanshade {

namespace fs = std::filesystem;

Eigen::Isometry3d pose_from(const Eigen::Vector3d& translation, const Eigen::Quaterniond& rotation) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = rotation.normalized().toRotationMatrix();
    pose.translation() = translation;
    return pose;
}

namespace {

/// Published rotations are rounded: 7-Scenes' are up to 4e-4 off orthonormal. Beyond this it is another kind of matrix.
constexpr double rigid_tolerance = 1e-2;
/// TUM prints quaternions with 4 digits, which moves their length by up to 1e-4.
constexpr double unit_tolerance = 1e-3;

/// tx ty tz qx qy qz qw from seven words; errors go to `trouble`, corrections to `warning`.
std::optional<Eigen::Isometry3d> quaternion_pose(const std::vector<std::string_view>& row, std::size_t first,
                                                 std::string& trouble, std::string& warning) {
    static constexpr std::array names{"tx", "ty", "tz", "qx", "qy", "qz", "qw"};
    std::array<double, 7> v{};
    for (std::size_t i = 0; i < v.size(); ++i) {
        const auto value = number(row[first + i]);
        if (!value || !std::isfinite(*value)) {
            trouble = fmt::format("{} is {}, expected a finite number", names[i], in_quotes(row[first + i]));
            return std::nullopt;
        }
        v[i] = *value;
    }
    const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
    const double length = rotation.norm();
    if (!(length > 1e-6) || !std::isfinite(length)) {
        trouble = "the quaternion is zero";
        return std::nullopt;
    }
    if (std::abs(length - 1) > unit_tolerance)
        warning = fmt::format("the quaternion has length {:.4g}; normalised", length);
    return pose_from({v[0], v[1], v[2]}, rotation);
}

bool is_rigid(const Eigen::Matrix4d& m) {
    const Eigen::Matrix3d r = m.topLeftCorner<3, 3>();
    const double off = (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    return m.allFinite() && off < rigid_tolerance && r.determinant() > 0 &&
           (m.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() < 1e-6;
}

std::string not_rigid(const Eigen::Matrix4d& m) {
    return fmt::format("the matrix is not rigid (determinant of its rotation {:.3g}, expected 1)",
                       m.topLeftCorner<3, 3>().determinant());
}

Eigen::Isometry3d rigid(const Eigen::Matrix4d& m) {
    return pose_from(m.topRightCorner<3, 1>(), Eigen::Quaterniond(Eigen::Matrix3d(m.topLeftCorner<3, 3>())));
}

/// Lines that are neither blank nor a comment.
std::vector<TextLine> content_lines(std::string_view bytes) {
    auto lines = text_lines(bytes);
    std::erase_if(
        lines, [](const TextLine& line) { return trimmed(line.text).empty() || trimmed(line.text).starts_with('#'); });
    return lines;
}

/// Four numbers of a matrix row; on failure the reason.
std::string read_row(const TextLine& line, Eigen::Matrix4d& matrix, int row) {
    const auto all = words(line.text);
    if (all.size() != 4)
        return fmt::format("{}, expected 4 (a row of a 4x4 pose)", counted(all.size(), "value"));
    for (int i = 0; i < 4; ++i) {
        const auto value = number(all[static_cast<std::size_t>(i)]);
        if (!value || std::isnan(*value))
            return fmt::format("{} in a pose, expected a finite number", in_quotes(all[static_cast<std::size_t>(i)]));
        matrix(row, i) = *value;
    }
    return {};
}

} // namespace

std::vector<StampedPose> read_tum_trajectory(const fs::path& file, std::vector<std::string>& warnings) {
    const std::string bytes = read_list_file(file);
    std::vector<StampedPose> poses;
    RepeatedWarning left_out(warnings), mended(warnings);
    bool first = true;
    for (const TextLine& line : content_lines(bytes)) {
        const auto row = words(line.text);
        const auto stamp = number(row[0]);
        const auto at = at_line(file, line.number);
        const bool header = std::exchange(first, false) && !stamp;
        if (header) {
            warnings.push_back(at + ": no time stamp; taken as a header that lacks its \"#\".");
        } else if (!stamp || !std::isfinite(*stamp)) {
            left_out.add(fmt::format("{}: {} is no time stamp; line not used.", at, in_quotes(row[0])));
        } else if (row.size() != 8) {
            left_out.add(fmt::format("{}: {}, expected 8 (time tx ty tz qx qy qz qw); pose not used.", at,
                                     counted(row.size(), "value")));
        } else {
            std::string trouble, warning;
            const auto pose = quaternion_pose(row, 1, trouble, warning);
            if (pose)
                poses.push_back({*stamp, *pose});
            else
                left_out.add(fmt::format("{}: {}; pose not used.", at, trouble));
            if (!warning.empty())
                mended.add(fmt::format("{}: {}.", at, warning));
        }
    }
    const auto earlier = [](const StampedPose& a, const StampedPose& b) { return a.stamp_s < b.stamp_s; };
    if (!std::is_sorted(poses.begin(), poses.end(), earlier)) {
        warnings.push_back(file.string() + ": time stamps are out of order; sorted.");
        std::stable_sort(poses.begin(), poses.end(), earlier);
    }
    return poses;
}

std::optional<Eigen::Isometry3d> pose_at(const std::vector<StampedPose>& poses, double stamp_s, double limit_s) {
    const auto near_enough = [&](const StampedPose& pose) { return std::abs(pose.stamp_s - stamp_s) <= limit_s; };
    const auto after = std::lower_bound(poses.begin(), poses.end(), stamp_s,
                                        [](const StampedPose& pose, double stamp) { return pose.stamp_s < stamp; });
    const bool after_near = after != poses.end() && near_enough(*after);
    const bool before_near = after != poses.begin() && near_enough(*std::prev(after));
    if (after_near && before_near) {
        const auto& [from_s, from] = *std::prev(after);
        const auto& [to_s, to] = *after;
        return pose_between(from, to, (stamp_s - from_s) / (to_s - from_s));
    }
    if (after_near)
        return after->world_from_camera;
    return before_near ? std::optional(std::prev(after)->world_from_camera) : std::nullopt;
}

std::map<std::size_t, Eigen::Isometry3d> read_pose_rows(const fs::path& file, std::vector<std::string>& warnings) {
    const std::string bytes = read_list_file(file);
    std::map<std::size_t, Eigen::Isometry3d> poses;
    RepeatedWarning left_out(warnings), mended(warnings);
    std::size_t number_of_row = 0;
    for (const TextLine& line : content_lines(bytes)) {
        ++number_of_row;
        const auto row = words(line.text);
        const auto at = at_line(file, line.number);
        std::string trouble, warning;
        if (row.size() != 7) {
            left_out.add(fmt::format("{}: {}, expected 7 (tx ty tz qx qy qz qw); pose not used.", at,
                                     counted(row.size(), "value")));
            continue;
        }
        if (const auto pose = quaternion_pose(row, 0, trouble, warning))
            poses.emplace(number_of_row, *pose);
        else
            left_out.add(fmt::format("{}: {}; pose not used.", at, trouble));
        if (!warning.empty())
            mended.add(fmt::format("{}: {}.", at, warning));
    }
    return poses;
}

std::map<std::size_t, Eigen::Isometry3d> read_redwood_log(const fs::path& file, std::vector<std::string>& warnings) {
    const std::string bytes = read_list_file(file);
    const auto lines = content_lines(bytes);
    std::map<std::size_t, Eigen::Isometry3d> poses;
    RepeatedWarning left_out(warnings);
    for (std::size_t i = 0; i < lines.size(); i += 5) {
        const auto head = words(lines[i].text);
        constexpr std::uint64_t none = UINT64_MAX;
        const std::uint64_t index = head.size() == 3 ? whole_number(head[0]).value_or(none) : none;
        std::string trouble = index != none ? "" : "expected three whole numbers before a pose";
        int line = lines[i].number;
        if (trouble.empty() && i + 4 >= lines.size())
            trouble = "the file ends inside the pose that starts here";
        Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
        for (int row = 0; row < 4 && trouble.empty(); ++row) {
            const TextLine& text = lines[i + 1 + static_cast<std::size_t>(row)];
            trouble = read_row(text, matrix, row);
            line = text.number;
        }
        if (!trouble.empty()) { // the rest cannot be split into poses
            warnings.push_back(
                fmt::format("{}: {}; this pose and all after it not used.", at_line(file, line), trouble));
            return poses;
        }
        if (!is_rigid(matrix))
            left_out.add(fmt::format("{}: {}; pose not used.", at_line(file, lines[i].number), not_rigid(matrix)));
        else
            poses.emplace(index, rigid(matrix));
    }
    return poses;
}

Eigen::Matrix4d from_opengl(const Eigen::Matrix4d& world_from_camera) {
    return world_from_camera * Eigen::Vector4d(1, -1, -1, 1).asDiagonal();
}

MatrixPose checked_pose(const Eigen::Matrix4d& matrix, const std::string& where) {
    MatrixPose result;
    if (!matrix.allFinite())
        result.warning = fmt::format("{}: the pose {}, which means that tracking was lost; pose not used.", where,
                                     matrix.hasNaN() ? "has NaN" : "is infinite");
    else if (!is_rigid(matrix))
        result.warning = fmt::format("{}: {}; pose not used.", where, not_rigid(matrix));
    else
        result.world_from_camera = rigid(matrix);
    return result;
}

std::string read_matrix(const fs::path& file, Eigen::Matrix4d& matrix, std::size_t* rows) {
    const std::string bytes = read_list_file(file);
    const auto lines = content_lines(bytes);
    if (lines.size() != 3 && lines.size() != 4)
        return fmt::format("{}: {}, expected a 4x4 pose", file.string(), counted(lines.size(), "row"));
    if (rows)
        *rows = lines.size();
    matrix = Eigen::Matrix4d::Identity();
    for (std::size_t row = 0; row < lines.size(); ++row)
        if (const std::string trouble = read_row(lines[row], matrix, static_cast<int>(row)); !trouble.empty())
            return fmt::format("{}: {}", at_line(file, lines[row].number), trouble);
    return {};
}

MatrixPose read_matrix_pose(const fs::path& file) {
    Eigen::Matrix4d matrix;
    std::size_t rows = 0;
    if (const std::string problem = read_matrix(file, matrix, &rows); !problem.empty())
        return {std::nullopt, problem, {}};
    MatrixPose result = checked_pose(matrix, file.string());
    if (result.world_from_camera && rows == 3)
        result.warning = file.string() + ": 3 rows, expected 4; the last taken as 0 0 0 1.";
    return result;
}

} // namespace scanshade
