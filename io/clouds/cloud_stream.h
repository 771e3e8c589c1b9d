// Clouds larger than the memory: records in blocks, in the order of the file, and the same file written with values.
#pragma once

#include "io/clouds/cloud_edit.h"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// From the beginning of the file. Throws Error naming the file for every damage that it shows. Nothing where the
/// file is no cloud.
[[nodiscard]] std::optional<CloudShape> cloud_shape(const std::filesystem::path& file,
                                                    std::vector<std::string>& warnings);

/// A cloud file, block by block.
class CloudStream {
  public:
    /// `shape` is that of the file, without a reason to read it as a whole.
    CloudStream(std::filesystem::path file, CloudShape shape);

    [[nodiscard]] const std::filesystem::path& file() const { return file_; }
    /// All but the points.
    [[nodiscard]] const CloudRecords& records() const { return shape_.records; }
    [[nodiscard]] std::size_t size() const { return shape_.records.point_count; }

    /// A block is the records of a few points, with the fields of the file; it is valid until visit returns.
    using Visit = std::function<void(std::size_t first, const CloudRecords& block)>;
    /// Visits all points. Throws Error naming file and place.
    void pass(const Visit& visit) const;

    /// The box that the file names, or of points here and there in it; nothing where none is valid.
    [[nodiscard]] std::optional<Eigen::AlignedBox3d> box() const;
    [[nodiscard]] const std::string& reference() const { return shape_.reference; }

    /// For the points from `first` on: one list of values per name, NaN = unknown; and colours, if they change.
    struct BlockValues {
        std::vector<std::vector<float>> fields;
        std::vector<cv::Vec3b> colours;
    };
    /// Writes the file again, with float fields of these names added to each point, or in their place where the file
    /// has them. Everything else keeps its bits. Atomic.
    void write(const std::filesystem::path& target, const std::vector<std::string>& names,
               const std::function<BlockValues(std::size_t first, const CloudRecords& block)>& values) const;

    /// The divisor of colours, the largest that colour_step_of() finds in the blocks; they have it from then on.
    void set_colour_step(double step) { shape_.records.colour_step = step; }

  private:
    [[nodiscard]] CloudRecords empty_block() const;
    void pass_chunks(const FileBytes& file, CloudRecords& block, const Visit& visit) const;

    std::filesystem::path file_;
    CloudShape shape_;
};

} // namespace scanshade
