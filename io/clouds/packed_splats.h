// Gaussian splats of formats other than plain PLY: their records are those of a PLY of splats, and the file's own bytes
// are kept for what is written.
#pragma once

#include "io/clouds/cloud_records.h"

#include <cstdint>
#include <Eigen/Geometry>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// One splat, decoded.
struct SplatRow {
    Eigen::Vector3f position, colour; ///< colour: red, green, blue of degree 0, as displayed
    Eigen::Vector3f log_sigma;
    float opacity; ///< 0 .. 1
    Eigen::Quaternionf rotation;
};

/// Makes records of splats.
class SplatTable {
  public:
    /// Throws Error where there are more than 2^31 - 1, or memory is short.
    SplatTable(std::uint64_t count, const std::filesystem::path& file);
    /// From several threads.
    void set(std::size_t splat, const SplatRow& row);
    /// `packed`: the file, or what was unpacked of it.
    [[nodiscard]] CloudRecords records(std::string packed) &&;

  private:
    CloudRecords records_;
};

/// A byte of colour after shading: 255 times srgb(linear(byte / 255) light).
[[nodiscard]] std::uint8_t shaded_byte(std::uint8_t byte, double light);

// Readers; `bytes` is the whole file. What they cannot use is refused with an Error that names file and place.

/// .splat of antimatter15's viewer: records of 32 bytes without a header.
[[nodiscard]] CloudRecords read_splat(std::string_view bytes, const std::filesystem::path& file,
                                      std::vector<std::string>& warnings);
/// PLY as PlayCanvas and SuperSplat pack it: chunks of 256 splats with limits, between which 32 bits hold a position.
[[nodiscard]] CloudRecords read_compressed_ply(std::string_view bytes, const std::filesystem::path& file,
                                               std::vector<std::string>& warnings);
/// SPZ, version 2, 3 or 4.
[[nodiscard]] CloudRecords read_spz(std::string_view bytes, const std::filesystem::path& file,
                                    std::vector<std::string>& warnings);
[[nodiscard]] bool is_spz(std::string_view start);
/// Binary glTF with KHR_gaussian_splatting: the splats of its scene, placed by its nodes, in glTF's axes.
[[nodiscard]] CloudRecords read_splat_glb(std::string_view bytes, const std::filesystem::path& file,
                                          std::vector<std::string>& warnings);
[[nodiscard]] bool is_splat_glb(std::string_view start);
/// The file with one more attribute for each of `additions`, _AMBIENT_OCCLUSION of ambient_occlusion, -1 for NaN; all
/// else as it was.
[[nodiscard]] std::string splat_glb_bytes(const CloudRecords& records, std::string points,
                                          const std::vector<FieldAddition>& additions);

// The file again with shaded colours and no other change. `visibility`: one per splat, NaN = unchanged.
[[nodiscard]] std::string shaded_splat(const CloudRecords& records, std::span<const float> visibility, double strength);
[[nodiscard]] std::string shaded_compressed_ply(const CloudRecords& records, std::span<const float> visibility,
                                                double strength);
[[nodiscard]] std::string shaded_splat_glb(const CloudRecords& records, std::span<const float> visibility,
                                           double strength);
[[nodiscard]] std::string shaded_spz(const CloudRecords& records, std::span<const float> visibility, double strength);

/// An element of a binary little-endian PLY without lists.
struct PlyTable {
    std::string name;
    std::vector<CloudField> fields; ///< with their offsets in a row
    std::size_t rows = 0, stride = 0;
    std::size_t at = 0; ///< of the first row in the file
    [[nodiscard]] std::size_t end() const { return at + rows * stride; }
    /// Of a field; Error naming it where there is none of that type.
    [[nodiscard]] std::size_t offset_of(const std::string& field, Scalar type) const;
};
/// All elements; Error where the file is too short for them.
[[nodiscard]] std::vector<PlyTable> ply_tables(std::string_view bytes, const std::filesystem::path& file);

} // namespace scanshade
