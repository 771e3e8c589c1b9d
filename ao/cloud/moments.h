// The first two moments of weighted points: their mean, their spread, and the plane through them.
#pragma once

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

} // namespace scanshade
