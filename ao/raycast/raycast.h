// Ray casting: visibility by definition (methods.md's equation 1 and section 2), on the CPU and unhurried. What the
// faster methods are held against: the best that one depth image, a cloud or a mesh can tell.
#pragma once

#include "ao/base/method.h"
#include "ao/raycast/ray_hemisphere.h"

namespace scanshade {

/// Where the rays of a mesh start.
enum class MeshRays { triangles, vertices };

/// What a person sets.
struct RaycastOptions {
    double radius_m = 0.5;
    int rays = 256; ///< per pixel, point, vertex or triangle
    Falloff falloff = Falloff::hard;
    double thickness_m = 0; ///< of depth images: how far surfaces reach behind their outlines; see surface_of()
    MeshRays mesh = MeshRays::triangles;
    int seed = 1;

    [[nodiscard]] std::vector<Parameter> parameters();
};

/// Not thread-safe itself; uses all cores, and the result does not depend on how many there are.
class Raycast final : public Method, public PointMethod {
  public:
    /// Throws Misuse naming a setting out of its range.
    explicit Raycast(RaycastOptions options);
    /// For the table of methods; the device only gives up surfaces that lie on it.
    Raycast(gpu::Device& device, RaycastOptions options) : Raycast(std::move(options)) { device_ = &device; }

    /// The depth image as the surface, about the given normals or its own. Memory grows with the image: 100 bytes a
    /// pixel.
    AoMap compute(const View& view) override;
    /// Clouds as discs (discs_of()); meshes as they are. A vertex of a mesh has the mean over its triangles: visibility
    /// at their centroids about their face normals (Luna 2016, chapter 21). Or it has rays of its own, about the mean
    /// of their normals. NaN for points that are not finite and vertices without a triangle.
    PointVisibility compute(const PointSet& points, const std::optional<Eigen::Vector3d>& scanner = {}) override;

    [[nodiscard]] const Timings& timings() const override { return timings_; }
    /// One standard error of each value of the last compute(), in its order (row by row); NaN where there is no value.
    [[nodiscard]] const std::vector<float>& standard_error() const { return standard_error_; }
    /// The standard error of the last depth image, cloud or mesh: what `run --dump` writes. Empty before.
    [[nodiscard]] std::vector<Intermediate> intermediates() override;

  private:
    std::vector<float> of_cloud(const PointSet& points);
    std::vector<float> of_mesh(const PointSet& points);
    template <class StartOf>
    std::vector<float> cast(const RaySurface& surface, std::size_t count, StartOf&& start_of);

    RaycastOptions options_;
    gpu::Device* device_ = nullptr;
    CosineDirections directions_;
    Timings timings_;
    std::vector<float> standard_error_;
    cv::Size size_; // of the last depth image
};

} // namespace scanshade
