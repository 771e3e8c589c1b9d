// Whether two frames of a recording fit together where their poses put them, and a pose that makes them fit.
#pragma once

#include "projection/maps.h"
#include "projection/sensor/noise.h"

#include <Eigen/Geometry>
#include <vector>

namespace scanshade {

/// Pieces of plane on a wide grid of a depth image's pixels: enough to lay frames onto each other.
struct Facets {
    struct Facet {
        Eigen::Vector3d point = Eigen::Vector3d::Zero();
        Eigen::Vector3d normal = Eigen::Vector3d::Zero(); ///< camera space; zero where no plane fits
        double sigma_m = 0;                               ///< of the point, across the plane
        double radius_px = 0;                             ///< of the window that the plane was fitted to
    };
    DepthImage depth;
    int apart_px = 1; ///< pixels from one to the next
    cv::Size grid;
    std::vector<Facet> all; ///< row by row
};

/// Planes are fitted in 1/z over windows that grow with the noise.
[[nodiscard]] Facets facets_of(const DepthImage& depth, const DepthNoise& noise);

/// Of the facets of one frame, seen from the other.
struct Agreement {
    double overlap = 0;      ///< share of them that meet the other's
    double contradicted = 0; ///< share of these and of those that would hide what the other has seen, of the latter
    double alignment_error_m = 0; ///< distance from the other's planes that nine tenths of the former stay below
    double alignment_error = 0;   ///< median of these distances in the largest that fits: 1 % of the AO's radius and
                                  ///< half the sensor's sigma
    [[nodiscard]] bool fits() const { return overlap > 0.1 && contradicted < 0.15 && alignment_error < 1; }
};

/// Two frames, and what is tolerable between them.
struct Pair {
    const Facets& here;
    const Facets& there;
    double radius_m;
    DepthNoise noise;
};

[[nodiscard]] Agreement agreement(const Pair& pair, const Eigen::Isometry3d& here_from_there);

/// The pose next to the given one in which the planes of both frames lie on each other. The distances are
/// point-to-plane (Chen and Medioni 1991), each weighted by its own error; points are paired along the view (Blais and
/// Levine 1995). Directions that the surfaces leave open stay as given (Zhang, Kaess and Singh 2016), and so does the
/// pose where no motion is significant.
struct Aligned {
    Eigen::Isometry3d here_from_there;
    double sigma_m = 0; ///< of where it puts the surfaces, in the direction that they tell least about
};
[[nodiscard]] Aligned aligned(const Pair& pair, const Eigen::Isometry3d& here_from_there);

} // namespace scanshade
