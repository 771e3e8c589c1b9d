// Directions: round the sphere, and cosine-weighted for many neighbouring points, each with a few of one long sequence.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace scanshade {

/// Unit directions spread evenly over the sphere (Fibonacci's spiral).
[[nodiscard]] std::vector<Eigen::Vector3d> spread_directions(int count);

/// One scrambled Sobol sequence (Burley 2020) on the hemisphere about z, cut into runs of `rays`. Points in the order
/// of a tree that take run after run hold, eight or sixteen together, an even set of their own: the mean over
/// neighbours is as good as that many times the rays.
class RayFan {
  public:
    RayFan(int rays, int seed);

    struct Run {
        const float *x, *y, *z;
        int count;
    };
    [[nodiscard]] std::size_t rays() const { return rays_; } ///< of a run
    [[nodiscard]] std::size_t runs() const { return runs_; }
    /// Of the point at a place.
    [[nodiscard]] Run run(std::size_t place) const {
        const std::size_t first = place % runs_ * rays_;
        return {x_.data() + first, y_.data() + first, z_.data() + first, static_cast<int>(rays_)};
    }

  private:
    std::size_t rays_, runs_;
    std::vector<float> x_, y_, z_;
};

} // namespace scanshade
