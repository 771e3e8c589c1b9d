// The table of cloud formats: names, signatures, extensions, readers and writers. No other code tells formats apart. A
// new format is a row in format.cpp and a file beside it.
#pragma once

#include "io/clouds/cloud_records.h"

#include <array>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

struct LinkedFiles;
struct LinkRequest;
struct TexturedMesh;

/// How a format takes colours that the file did not have: as bytes red, green and blue, or packed in one float, rgb.
enum class NewColours { none, bytes, packed };

struct CloudFormat {
    std::string_view name;    ///< "PLY"
    std::string_view content; ///< what of the format is read
    /// Whether a file that begins so is of this format. None: only the name says so.
    bool (*signature)(std::string_view start) = nullptr;
    std::array<std::string_view, 2> extensions; ///< lower case, with the dot
    std::string_view written_extension = {};    ///< of files that `written` makes, if it is not the first one

    CloudRecords (*read)(std::string_view bytes, const std::filesystem::path& file,
                         std::vector<std::string>& warnings) = nullptr;
    /// The file again with `points` (from edited_points) and a header that names `additions`.
    std::string (*written)(const CloudRecords& records, std::string points,
                           const std::vector<FieldAddition>& additions) = nullptr;
    /// Of splats that are no PLY: the file again with shaded colours. Where `written` is missing, it takes no fields.
    std::string (*shaded)(const CloudRecords& records, std::span<const float> visibility, double strength) = nullptr;
    CloudShape (*shape)(const FileBytes& file, std::vector<std::string>& warnings) = nullptr; ///< none: read as a whole
    std::vector<std::array<int, 3>> (*triangles)(const CloudRecords& records) = nullptr;      ///< none: no meshes
    TexturedMesh (*textured)(const CloudRecords& records, const std::filesystem::path& file) = nullptr;
    LinkedFiles (*linked)(const LinkRequest& asked) = nullptr; ///< there where `textured` is
    std::string_view binary_encoding = "binary";               ///< what the format calls little-endian numbers
    bool wide_colours = false;                                 ///< red, green and blue may have 16 bits
    NewColours new_colours = NewColours::none;                 ///< of a file that has none
    bool z_up = false;                                         ///< z points up, by definition or custom
};

/// The format, by how the file begins, or by its name where only that tells; none where it is unknown.
[[nodiscard]] const CloudFormat* cloud_format(std::string_view bytes, const std::filesystem::path& file);
/// Whether the name is that of a cloud.
[[nodiscard]] bool has_cloud_extension(const std::filesystem::path& file);
/// Whether a file that begins so is a cloud, or a damaged one by its name.
[[nodiscard]] bool is_cloud(std::string_view start, const std::filesystem::path& file);
[[nodiscard]] std::span<const CloudFormat> cloud_formats();
/// The names of all.
[[nodiscard]] std::vector<std::string_view> cloud_format_names();
/// Of the file that write_cloud() makes of a cloud in this format.
[[nodiscard]] std::string_view written_extension(const CloudFormat& format);
/// The name, without extension, of a LAZ that is no COPC: NAME.plain for NAME.copc, other names as they are.
[[nodiscard]] std::string plain_laz_name(const std::string& name);
/// Those of all formats.
[[nodiscard]] std::vector<std::string_view> written_cloud_extensions();

} // namespace scanshade
