// A cloud file as its own records: header text, fields, and the bytes or words of every point, kept to be written back.
#pragma once

#include "io/clouds/laz/laz.h"
#include "projection/base/splat.h"
#include "projection/base/station.h"
#include "projection/found_frames.h"

#include <array>
#include <cstdint>
#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

enum class Scalar { int8, uint8, int16, uint16, int32, uint32, int64, uint64, float32, float64 };

[[nodiscard]] std::size_t size_of(Scalar type);

struct CloudFormat;
class FileBytes;

/// A PCD field or a PLY vertex property.
struct CloudField {
    std::string name;
    Scalar type = Scalar::float32;
    std::size_t count = 1;             ///< values per point, side by side (PCD's COUNT)
    std::optional<Scalar> list_length; ///< PLY list: the type of the length that comes before `type` values
    std::size_t offset = 0;            ///< in a record of fixed stride

    [[nodiscard]] std::size_t bytes() const { return size_of(type) * count; }
};

/// Whatever the case of its letters.
[[nodiscard]] bool is_named(const CloudField& field, std::string_view name);

/// The file, taken apart but not changed: header, before, points, after in this order are its bytes (the
/// compressed points of PCD and LAZ are unpacked and put point after point).
struct CloudRecords {
    enum class Encoding { ascii, binary, big_endian, compressed };

    const CloudFormat* format = nullptr; ///< that it was read in
    Encoding encoding = Encoding::binary;
    std::string header; ///< up to and including the end of its last line
    std::vector<CloudField> fields;
    std::size_t point_count = 0;
    cv::Size grid;
    std::string before;     ///< PLY elements that come before the vertices
    std::string points;     ///< the records, without the last one's line end
    std::string packed;     ///< PCD, LAZ: the compressed block as the file has it; OBJ, glTF: the file
    std::size_t stride = 0; ///< bytes per record; 0 where records differ in length (text, lists)
    std::vector<std::size_t>
        ends; ///< where each record ends in `points` (text: behind its last word), when stride is 0
    std::map<std::size_t, std::string>
        inserted;      ///< text: what stands before a point's record and is no part of it, PTX's headers of more scans
    std::string after; ///< faces, other elements, left-over lines
    std::array<double, 3> scale{1, 1, 1}, shift{0, 0, 0}; ///< coordinates are field values times scale plus shift
    std::vector<Eigen::Vector3d> placed;                  ///< the points, if fields alone do not give them
    std::string unit;               ///< of the coordinates, and its source; empty: metres, by convention
    std::vector<laz::Chunk> octree; ///< COPC: the chunks as the file has them, its nodes; empty for other files
    std::string octree_damage;      ///< COPC: what is wrong with the octree; empty where it is kept
    double colour_step = 0;         ///< the divisor of colours, where these are a part of the file; 0 = they tell it
    std::optional<Eigen::Isometry3d> viewpoint; ///< world_from_camera, if the file has one
    std::vector<Station> stations;              ///< of a file of several scans, in the order of their points
    std::vector<Splat> splats;                  ///< one per point; empty where points are no Gaussian splats
    std::vector<FoundFrame> cameras;            ///< of splats: those that they were made with, where they are known

    [[nodiscard]] bool text() const { return encoding == Encoding::ascii; }
    /// Point `index`'s bytes; for text what lies between the last word before it and its own last word.
    [[nodiscard]] std::string_view record(std::size_t index) const;
    /// The first field of that name that is not a list, because a list may be empty. Capitals count only where there
    /// are several.
    [[nodiscard]] std::optional<std::size_t> field_named(std::string_view name) const;
};

/// A field's byte range in a record: all its values (text: its words).
struct FieldPlace {
    std::size_t offset = 0, length = 0;
};
[[nodiscard]] FieldPlace locate(const CloudRecords& records, std::string_view record, std::size_t field);

/// The first value of `field` in `record`; NaN where text is no number.
[[nodiscard]] double value_at(const CloudRecords& records, std::string_view record, std::size_t field);
/// A value as the file's encoding writes it: bytes in its order, or a word.
[[nodiscard]] std::string encoded(const CloudRecords& records, Scalar type, double value);
/// A number of `type` at `from`, which must have that many bytes.
[[nodiscard]] double decoded(const char* from, Scalar type, bool big_endian);

/// Fields that hold colour: one 4-byte field of packed bits, or three numbers.
struct ColourFields {
    std::optional<std::size_t> packed;             ///< 0xAARRGGBB, typed float or integer
    std::optional<std::array<std::size_t, 3>> bgr; ///< divided by colour_step_of() they are 0 .. 255
};
[[nodiscard]] ColourFields colour_fields(const CloudRecords& records);
/// The packed colour's bits. Floats are read as bits, never as numbers: many are NaN or denormal.
[[nodiscard]] std::uint32_t packed_bits(const CloudRecords& records, std::string_view record, std::size_t field);
[[nodiscard]] std::string encoded_bits(const CloudRecords& records, Scalar type, std::uint32_t bits);

/// Puts new content in place of a field of every point.
struct FieldReplacement {
    std::size_t field = 0;
    std::function<std::string(std::size_t point, std::string_view record)> content;
};
/// A field added behind the last one of every point. LAS and PCD take floats only.
struct FieldAddition {
    std::string name;
    std::span<const float> values;
    Scalar type = Scalar::float32;
};
/// All records in file order with replacements (sorted by field) and additions made. Replacements are asked for from
/// several threads.
[[nodiscard]] std::string edited_points(const CloudRecords& records, const std::vector<FieldReplacement>& replacements,
                                        const std::vector<FieldAddition>& additions);

/// A file's bytes: `points` between these; its memory is used again.
[[nodiscard]] std::string between(std::string_view header, std::string points, std::string_view after);

/// Throws Error for more points than 32 bits number.
void check_point_count(std::uint64_t count, const std::filesystem::path& file);

/// Lines of an ASCII body; skips blank ones.
class TextRecords {
  public:
    TextRecords(std::string_view body, int first_line) : body_(body), line_(first_line - 1) {}
    /// Moves to the next line with words; false at the end.
    bool next();
    [[nodiscard]] const std::vector<std::string_view>& words() const { return words_; }
    [[nodiscard]] int line() const { return line_; }
    /// Behind the last word of this line, as an offset in the body.
    [[nodiscard]] std::size_t end() const { return end_; }

  private:
    std::string_view body_;
    std::size_t at_ = 0, end_ = 0;
    int line_ = 0;
    std::vector<std::string_view> words_;
};

// One reader and one writer per format; io/clouds/format.cpp lists them. `bytes` is the whole file.
[[nodiscard]] CloudRecords read_pcd(std::string_view bytes, const std::filesystem::path& file,
                                    std::vector<std::string>& warnings);
[[nodiscard]] CloudRecords read_ply(std::string_view bytes, const std::filesystem::path& file,
                                    std::vector<std::string>& warnings);
/// LAS 1.0 to 1.4, every point format, and LAZ of formats 0 .. 3 and 6 .. 8 (ASPRS, "LAS Specification 1.4 - R15");
/// everything but the points is kept as it is. Fields are named after the specification; those of an extra bytes record
/// keep their names.
[[nodiscard]] CloudRecords read_las(std::string_view bytes, const std::filesystem::path& file,
                                    std::vector<std::string>& warnings);
/// One point a line: .xyz (a line of names may come first) and .pts (the count comes first). Columns without names are
/// x y z, then colours (bytes) and normals (of length 1) as their values tell, an intensity before or another value
/// behind. Cells between commas or semicolons (CSV) become words between blanks.
[[nodiscard]] CloudRecords read_xyz(std::string_view bytes, const std::filesystem::path& file,
                                    std::vector<std::string>& warnings);
/// Whether a text of another name begins as read_xyz() reads it: eight lines or more of x y z, alone or with colours or
/// normals, or under their names. Trajectories and matrices have other numbers of columns, or fewer lines.
[[nodiscard]] bool is_text_cloud(std::string_view start);
/// One point a line, .ptx: each scan has sizes, pose, then the grid; "0 0 0" = nothing seen. A scan alone keeps its
/// grid.
[[nodiscard]] CloudRecords read_ptx(std::string_view bytes, const std::filesystem::path& file,
                                    std::vector<std::string>& warnings);
/// Sweeps of floats without a header, KITTI's x y z reflectance or nuScenes' x y z intensity ring. The records are
/// those of a PLY.
[[nodiscard]] CloudRecords read_kitti(std::string_view bytes, const std::filesystem::path& file,
                                      std::vector<std::string>& warnings);
/// E57: all scans of a file, placed by their poses, as the records of a PLY: x y z, then every field of numbers. A scan
/// alone keeps its grid, if every cell has one point.
[[nodiscard]] CloudRecords read_e57(std::string_view bytes, const std::filesystem::path& file,
                                    std::vector<std::string>& warnings);
/// OBJ and glTF: points and triangles as the records of a PLY with faces; the file's own bytes are in `packed`.
[[nodiscard]] CloudRecords read_obj_cloud(std::string_view bytes, const std::filesystem::path& file,
                                          std::vector<std::string>& warnings);
[[nodiscard]] CloudRecords read_gltf_cloud(std::string_view bytes, const std::filesystem::path& file,
                                           std::vector<std::string>& warnings);
/// Faces as triangles, polygons fanned from their first corner; -1 for an index that names no vertex. Tristrips are not
/// read.
[[nodiscard]] std::vector<std::array<int, 3>> ply_triangles(const CloudRecords& records);
/// Where the records of a file lie that can be read in blocks.
struct CloudShape {
    CloudRecords records;  ///< header, fields and number of points; the points and what follows are not there
    std::uint64_t at = 0;  ///< where the points begin in the file
    std::uint64_t end = 0; ///< behind the points; what follows is kept as it is
    std::optional<Eigen::AlignedBox3d> box; ///< that the points are said to lie in, in the cloud's unit
    std::string reference;          ///< LAS: the records that name the coordinates' reference system, as they are
    laz::Packing packing;           ///< LAZ: how points are packed, and where. What follows is in `records`, since it
    std::vector<laz::Chunk> chunks; ///< may change
    std::string whole_since;        ///< not empty: why the file has to be read as a whole
};
// From the beginning of a file, with the checks of its reader.
[[nodiscard]] CloudShape ply_shape(const FileBytes& file, std::vector<std::string>& warnings);
[[nodiscard]] CloudShape pcd_shape(const FileBytes& file, std::vector<std::string>& warnings);
[[nodiscard]] CloudShape las_shape(const FileBytes& file, std::vector<std::string>& warnings);

/// The file again with `points` (from edited_points) and the header naming `additions`.
[[nodiscard]] std::string pcd_bytes(const CloudRecords& records, std::string points,
                                    const std::vector<FieldAddition>& additions);
/// `additions` become extra bytes: floats behind each point, and a record that names them.
[[nodiscard]] std::string las_bytes(const CloudRecords& records, std::string points,
                                    const std::vector<FieldAddition>& additions);
[[nodiscard]] std::string text_bytes(const CloudRecords& records, std::string points,
                                     const std::vector<FieldAddition>& additions);
[[nodiscard]] std::string ply_bytes(const CloudRecords& records, std::string points,
                                    const std::vector<FieldAddition>& additions);
/// What comes before the points in a LAS file whose points ended at `old_end`.
[[nodiscard]] std::string las_head(const CloudRecords& records, const std::vector<FieldAddition>& additions,
                                   std::uint64_t old_end);
/// Throws Error where a COPC has a damaged octree. `copc` = false: it becomes LAZ, whatever its octree is.
void settle_octree(CloudRecords& records, bool copc);

/// What stands round the points of a LAZ file whose block of points ended at `old_end`. COPC keeps its octree: the
/// chunks `octree` are packed anew, each with its points.
struct LazHead {
    std::string header, after;
    laz::Packing packing;
    std::uint64_t old_end;
    std::vector<laz::Chunk> octree; ///< before; empty where there is none
};
[[nodiscard]] LazHead laz_head(const CloudRecords& records, const std::vector<FieldAddition>& additions,
                               std::uint64_t old_end);
/// For the points between.
[[nodiscard]] laz::Packer packer_of(const LazHead& head);
/// Offsets in header and octree, which keep their lengths, once `packer` has all points.
void finish(LazHead& head, const laz::Packer& packer);

} // namespace scanshade
