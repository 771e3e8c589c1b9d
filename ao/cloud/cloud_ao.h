// Visibility of every point of a cloud without a view: rays from the points against discs at the points.
#pragma once

#include "ao/base/method.h"
#include "ao/cloud/cloud_error.h"
#include "ao/cloud/surface/cloud_surface.h"

#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Which normals of a cloud are used; automatic: the recorded ones where they agree with the planes of the points.
enum class CloudNormals { automatic, recorded, estimated };

/// What a person sets.
struct CloudAoOptions {
    double radius = 0; ///< in the cloud's unit; 0 = from the cloud: see default_radius()
    int rays = 0;      ///< per point; neighbours share one even set, so their mean counts several times as many.
                       ///< 0 = 64 on a GPU, else 16; 8 and 4 where the radius spans more than 60 and 120 spacings
    int smooth = -1;   ///< times that a value becomes the mean of its neighbours' on the same surface; -1 = 2; 3 and 5
                       ///< where the radius spans more than 60 and 120 spacings
    bool sky = false;  ///< the share of the sky that a point sees, at any distance
    std::string up = "0,0,1";
    std::string outside = "auto"; ///< "auto", "up", "outward", "inward", or the scanner's position x,y,z
    CloudNormals normals = CloudNormals::automatic;
    int memory_mib = 4096; ///< for the points; larger clouds are computed in tiles
    int seed = 1;
    bool keep_signs = false; ///< for study: see CloudAo::signs()

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// A twentieth of the cloud's extent: the diagonal of the box without the lowest and highest hundredth of the points.
/// At least 10 spacings, since fewer would show single points; at most 200, since time grows with their number.
[[nodiscard]] double default_radius(double extent, double spacing);

/// Deterministic: the result depends neither on the number of threads nor on their timing.
class CloudAo final : public PointMethod {
  public:
    /// Runs on `device`; without one on the processor, which is faster than lavapipe. Throws Misuse that names a
    /// setting out of its range.
    explicit CloudAo(CloudAoOptions options, gpu::Device* device = nullptr);

    /// For a mesh, rays are cast from the vertices against its faces.
    PointVisibility compute(const PointSet& cloud, const std::optional<Eigen::Vector3d>& scanner = {}) override;

    /// What told of the errors of the last cloud in memory, of every point.
    [[nodiscard]] const std::vector<CloudErrorSigns>& signs() const { return signs_; }

    [[nodiscard]] std::size_t most_at_once() const override;
    [[nodiscard]] std::string fingerprint() const override;
    PointVisibility compute_large(PointSource& source, TileStore& store, double shown,
                                  const std::function<bool()>& stop) override;

  private:
    [[nodiscard]] PointVisibility of_mesh(const PointSet& mesh) const;
    [[nodiscard]] PointVisibility of_scans(PointSet cloud, const std::optional<Eigen::Vector3d>& scanner);

    CloudAoOptions options_;
    gpu::Device* device_;
    Eigen::Vector3d up_;
    std::optional<Eigen::Vector3d> viewpoint_; ///< given by the user
    std::vector<CloudErrorSigns> signs_;
};

} // namespace scanshade
