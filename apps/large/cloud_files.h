// The points of one cloud file, or of several as if they were one, as they pass by.
#pragma once

#include "ao/cloud/large_cloud.h"
#include "io/clouds/cloud_stream.h"

#include <cstddef>
#include <optional>
#include <vector>

namespace scanshade {

/// Points are numbered through all files. What the first pass tells is kept.
class CloudFiles final : public PointSource {
  public:
    explicit CloudFiles(std::vector<CloudStream> files);

    [[nodiscard]] std::size_t size() const override { return starts_.back(); }
    void pass(const Visit& visit) override;
    [[nodiscard]] bool has_normals() const override;
    [[nodiscard]] bool z_up() const override;
    [[nodiscard]] std::optional<Eigen::Vector3d> scanner() const override;

    [[nodiscard]] const std::vector<CloudStream>& files() const { return files_; }
    [[nodiscard]] std::size_t start(std::size_t file) const { return starts_[file]; }
    /// Oddities of that file's points.
    [[nodiscard]] std::vector<std::string> warnings(std::size_t file) const;
    /// Whether any point of that file has a colour other than black.
    [[nodiscard]] bool coloured(std::size_t file) const { return told_[file].coloured; }

  private:
    struct Told {
        PointOddities odd;
        bool coloured = false;
    };
    std::vector<CloudStream> files_;
    std::vector<std::size_t> starts_;
    std::vector<Told> told_;
    NormalCounts normals_;
    MapCounts map_;
    bool all_have_normals_ = false, passed_ = false;
};

} // namespace scanshade
