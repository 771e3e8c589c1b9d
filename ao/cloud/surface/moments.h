// The first two moments of weighted points: their mean, their spread, and the plane through them.
#pragma once

#include <cmath>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

namespace scanshade {

/// Sums over points, relative to an origin near them; single precision then suffices.
struct Moments {
    float weight = 0;
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    Eigen::Matrix3f products = Eigen::Matrix3f::Zero();

    void add(const Eigen::Vector3f& offset, float of_weight = 1) {
        weight += of_weight;
        sum += of_weight * offset;
        products += of_weight * offset * offset.transpose();
    }
    [[nodiscard]] Eigen::Vector3f mean() const { return sum / weight; }
    [[nodiscard]] Eigen::Matrix3f covariance() const { return products / weight - mean() * mean().transpose(); }
};

/// The axes of a spread of points: variances along the normal, the narrow and the wide side, ascending.
struct PrincipalAxes {
    Eigen::Vector3f normal, variances;

    explicit PrincipalAxes(const Eigen::Matrix3f& covariance) {
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> axes;
        axes.computeDirect(covariance);
        normal = axes.eigenvectors().col(0);
        variances = axes.eigenvalues().cwiseMax(0);
    }
};

/// A recorded normal of length 1; zero where there is none.
[[nodiscard]] inline Eigen::Vector3f unit_normal(const Eigen::Vector3d& normal) {
    return normal.allFinite() && normal.norm() > 0.1 ? Eigen::Vector3f(normal.normalized().cast<float>())
                                                     : Eigen::Vector3f(Eigen::Vector3f::Zero());
}

/// A recorded normal, or that of the flat surface round it, turned to the same side. The latter where they differ by
/// more than 6 degrees: the normal was estimated from too few points then.
[[nodiscard]] inline Eigen::Vector3f checked_normal(const Eigen::Vector3f& recorded, const Eigen::Vector3f& of_plane) {
    constexpr float still_recorded = 0.9945F;
    const float cosine = recorded.dot(of_plane);
    if (std::abs(cosine) > still_recorded)
        return recorded;
    return cosine < 0 ? Eigen::Vector3f(-of_plane) : of_plane;
}

} // namespace scanshade
