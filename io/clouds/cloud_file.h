// Clouds (PLY, PCD, LAS, lines of text, KITTI): points out, every other field, face and comment kept as the file's own
// bytes and written back.
#pragma once

#include "projection/base/splat.h"
#include "projection/frame.h"

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// Reads PCD (ascii, binary, binary_compressed), PLY (ascii, both endians; float or double; list properties walked) or
/// LAS 1.0 to 1.4 and LAZ, told by content; .xyz, .pts, .ptx and KITTI's .bin, told by name. Coordinates in the
/// file's unit. Infinite or absurd (> 1e30) coordinates become NaN. Throws Error naming the file and the line or
/// byte offset for every damage the header or body shows; nothing is allocated from an unchecked number. `warnings`
/// receives oddities that do not prevent reading.
[[nodiscard]] Cloud read_cloud(const std::filesystem::path& file, std::vector<std::string>& warnings);

/// Indices of points, three per triangle, of a mesh (a PLY with faces; polygons are fanned, -1 names no vertex); empty
/// for clouds.
[[nodiscard]] std::vector<std::array<int, 3>> triangles_of(const Cloud& cloud);
/// The file's own normals (nx ny nz, or normal_x ...), one per point, made as long as 1; empty where there are none, or
/// fewer than nine in ten points with coordinates have one.
[[nodiscard]] std::vector<Eigen::Vector3d> recorded_normals(const Cloud& cloud);

/// One value per point; throws Error naming `file` where the cloud has no such field.
[[nodiscard]] std::vector<float> recorded_field(const Cloud& cloud, const std::string& name,
                                                const std::filesystem::path& file);

/// A float field to add to each point. NaN = unknown.
struct AddedField {
    std::string name;
    std::span<const float> values; ///< one per point
};

/// Writes the cloud in the format, encoding and byte order it was read from, plus `added` fields (replacing a field of
/// that name). All other fields, point count, grid, viewpoint, faces, comments keep their bits. `colours`, when not
/// empty, replaces the colour field's r, g, b (alpha kept), or adds such fields where takes_colours(). Atomic.
void write_cloud(const std::filesystem::path& file, const Cloud& cloud, const std::vector<AddedField>& added,
                 std::span<const cv::Vec3b> colours = {});

/// The splats of a cloud, one per point, or none; opacity 0 where a splat shows nothing.
[[nodiscard]] std::span<const Splat> splats_of(const Cloud& cloud);
/// The points of splats, and those that `cloud.points` leaves out since they are of next to no opacity.
[[nodiscard]] std::vector<Eigen::Vector3d> points_with_haze(const Cloud& cloud);
/// Writes splats as they are but for their colours, all coefficients of them: srgb(linear(colour) (1 - strength +
/// strength visibility)), as shade() does it. Where visibility is NaN, colours keep their bits. Atomic.
void write_shaded_splats(const std::filesystem::path& file, const Cloud& cloud, std::span<const float> visibility,
                         double strength);

/// Whether the file has colours, or its format takes them behind the other fields; LAS does not.
[[nodiscard]] bool takes_colours(const Cloud& cloud);

/// Whether its format has room for fields; packed splats have none.
[[nodiscard]] bool takes_fields(const Cloud& cloud);

/// A new cloud as binary PLY (x y z float or double when far from the origin, red green blue, `added`). Atomic.
void write_new_ply(const std::filesystem::path& file, const std::vector<Eigen::Vector3d>& points,
                   const std::vector<cv::Vec3b>& colours, const std::vector<AddedField>& added,
                   const std::vector<std::string>& comments = {});

/// Properties of the file as people ask for them: format, encoding, fields, grid.
[[nodiscard]] std::string describe(const CloudRecords& records);
/// The unit of the coordinates and its source; empty for formats that use metres by convention.
[[nodiscard]] std::string unit_of(const CloudRecords& records);
/// Whether z points up: in surveyors' formats, and in PLY and PCD if their coordinates are those of a map.
[[nodiscard]] bool z_is_up(const Cloud& cloud);
/// ".pcd", ".ply", ".las" ..., as read; what was read without a header is written as ".ply".
[[nodiscard]] std::string extension(const CloudRecords& records);
/// The file that write_cloud() makes of a cloud called `name`: with extension(), and `.plain` in place of a `.copc`
/// that would not be true.
[[nodiscard]] std::string written_name(const std::string& name, const CloudRecords& records);

} // namespace scanshade
