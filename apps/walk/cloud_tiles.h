// A cloud's points as 3D Tiles, on the Earth where its coordinate system is known.
#pragma once

#include "apps/frame/outputs.h"
#include "apps/frame/work.h"

#include <memory>
#include <span>
#include <vector>

namespace scanshade {

/// Writes tiles/NAME/. The row gets its files and notes. Throws Error where the frame is no cloud, or none of its
/// points has coordinates, if nothing else was asked for.
void write_cloud_tiles(Work& work, const Outputs& outputs);

/// The same of a cloud that is computed from disk, block by block.
class LargeCloudTiles {
  public:
    LargeCloudTiles(Work& work, const Outputs& outputs);
    ~LargeCloudTiles();
    LargeCloudTiles(const LargeCloudTiles&) = delete;
    LargeCloudTiles& operator=(const LargeCloudTiles&) = delete;
    /// The next points with their own colours, or none.
    void add(std::span<const Eigen::Vector3d> points, const std::vector<cv::Vec3b>& own,
             const std::vector<float>& visibility, const std::vector<float>& error);
    void finish();

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

} // namespace scanshade
