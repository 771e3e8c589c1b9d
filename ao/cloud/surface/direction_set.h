// Sets of directions: evenly round the sphere, and cosine-weighted for the rays of neighbouring points.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace scanshade {

/// Unit directions spread evenly over the sphere (Fibonacci's spiral).
[[nodiscard]] std::vector<Eigen::Vector3d> spread_directions(int count);

/// One scrambled Sobol sequence (Burley 2020) on the hemisphere about z, cut into runs of `rays`. Points take run after
/// run in the order of the tree. Eight or sixteen neighbours then hold an even set together, and their mean is as good
/// as that many times the rays.
class DirectionSet {
  public:
    DirectionSet(int rays, int seed);

    struct Run {
        const float *x, *y, *z;
        int count;
    };
    [[nodiscard]] std::size_t rays() const { return rays_; } ///< of a run
    [[nodiscard]] std::size_t runs() const { return runs_; }
    /// The directions of the point with this index in the tree's order.
    [[nodiscard]] Run run(std::size_t index) const {
        const std::size_t first = index % runs_ * rays_;
        return {x_.data() + first, y_.data() + first, z_.data() + first, static_cast<int>(rays_)};
    }

  private:
    std::size_t rays_, runs_;
    std::vector<float> x_, y_, z_;
};

} // namespace scanshade
