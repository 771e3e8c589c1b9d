// What reading and writing a cloud as a whole and in blocks have in common.
#pragma once

#include "io/clouds/cloud_file.h"
#include "io/clouds/cloud_records.h"

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// Points without usable coordinates, or that their file does not want used.
struct PointOddities {
    std::size_t all = 0, absurd = 0, unusable = 0;
    std::size_t left_out = 0; ///< LAS: withheld, or classified as noise
};
/// In the cloud's unit; NaN in all three coordinates where they are infinite, absurd (> 1e30) or unknown, where LAS
/// marks the point as withheld or as noise, and where a splat has next to no opacity.
[[nodiscard]] std::vector<Eigen::Vector3d> points_of(const CloudRecords& records, PointOddities& odd);
void warn_of(const PointOddities& odd, const std::filesystem::path& file, std::vector<std::string>& warnings);

/// BGR, of splats the one they show from all sides; empty where there are none.
[[nodiscard]] std::vector<cv::Vec3b> colours_of(const CloudRecords& records);
/// The divisor of colours in three fields, as these records tell it; 0 where there are none.
[[nodiscard]] double colour_step_of(const CloudRecords& records);

/// The fields of recorded normals: nx ny nz, or normal_x ...
[[nodiscard]] std::optional<std::array<std::size_t, 3>> normal_fields(const CloudRecords& records);
/// Of unit length, whatever their recorded length; zero or NaN where there is none.
[[nodiscard]] std::vector<Eigen::Vector3d> normals_of(const CloudRecords& records,
                                                      const std::array<std::size_t, 3>& fields);
/// Fields called normals are ones where nine in ten points with coordinates have one.
struct NormalCounts {
    std::size_t valid = 0, unit = 0;
    void add(std::span<const Eigen::Vector3d> points, std::span<const Eigen::Vector3d> normals);
    [[nodiscard]] bool are_normals() const { return 10 * unit >= 9 * valid; }
};

/// Whether coordinates are those of a map, from every step(points)-th of them.
struct MapCounts {
    std::size_t there = 0, all = 0;
    [[nodiscard]] static std::size_t step(std::size_t points) {
        constexpr std::size_t some = 1000;
        return points < some ? 1 : points / some;
    }
    void add(const Eigen::Vector3d& point);
    [[nodiscard]] bool on_a_map() const { return there > all / 2; }
};

/// What is done to each record. Keeps what it points to, except the values and colours given.
struct CloudEdit {
    std::vector<FieldReplacement> replacements;
    std::vector<FieldAddition> additions;
    std::vector<std::vector<float>> channels; ///< colours as additions
};
[[nodiscard]] CloudEdit edit_of(const CloudRecords& records, const std::vector<AddedField>& added,
                                std::span<const cv::Vec3b> colours);

} // namespace scanshade
