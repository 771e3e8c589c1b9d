// Visibility of every point of a cloud of any kind: rays from the points against the discs they make up. No view
// needed.
#pragma once

#include "ao/cloud/cloud_surface.h"
#include "ao/method.h"

#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Which normals of a cloud are taken; automatic: the recorded ones where they lie on the planes of the points.
enum class CloudNormals { automatic, recorded, estimated };

/// What a person sets.
struct CloudAoOptions {
    double radius = 0; ///< in the cloud's unit; 0 = from the cloud: see default_radius()
    int rays = 0; ///< per point; neighbours' rays make one even set, so that their mean counts several times as many.
                  ///< 0 = 64 on a GPU, else 16; 8 and 4 where the radius spans more than 60 and 120 spacings
    int smooth = -1;  ///< times that a value becomes the mean of those beside it on the same surface; -1 = 2; 3 and 5
                      ///< where so many spacings make neighbours near against the radius
    bool sky = false; ///< how much of the sky a point sees, however far what hides it
    std::string up = "0,0,1";
    std::string outside = "auto"; ///< "auto", "up", "outward", "inward", or the scanner's place x,y,z
    CloudNormals normals = CloudNormals::automatic;
    int memory_mib = 4096; ///< of the points in work; larger clouds are taken in tiles
    int seed = 1;

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// A twentieth of the cloud's extent (of the box that holds all but one in a hundred points, each way), but at least 10
/// and at most 200 spacings: fewer would see single points, more would cost without end.
[[nodiscard]] double default_radius(double extent, double spacing);

/// Deterministic: the result depends neither on the number of threads nor on their timing.
class CloudAo final : public PointMethod {
  public:
    /// On `device`, or where there is none on the processor (faster there than as Vulkan's device). Throws Misuse
    /// naming a setting out of its range.
    explicit CloudAo(CloudAoOptions options, gpu::Device* device = nullptr);

    /// Where there are faces, rays are cast from the vertices against them in place of discs.
    PointVisibility compute(const PointSet& cloud, const std::optional<Eigen::Vector3d>& scanner = {}) override;

  private:
    class Work;
    [[nodiscard]] PointVisibility of_mesh(const PointSet& mesh) const;

    CloudAoOptions options_;
    gpu::Device* device_;
    Eigen::Vector3d up_;
    std::optional<Eigen::Vector3d> viewpoint_; ///< said by the user
};

} // namespace scanshade
