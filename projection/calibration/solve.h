// What the sources of evidence share of Ceres: frozen numbers, settings, and the covariance of the model's numbers.
#pragma once

#include "projection/calibration/problem.h"

#include <ceres/ceres.h>
#include <map>

namespace scanshade::calibration {

/// The model's numbers are blocks of a problem: camera, depth, place, clock. Those in the problem are frozen where not
/// free.
void freeze(ceres::Problem& problem, Model& model, const Free& free);

/// Solves; fills rss (without robust loss), residuals, unknowns, converged. Throws Error where nothing can be solved.
void solve(ceres::Problem& problem, Fit& fit, bool many_unknowns);

/// Three numbers of a scene's point, and the part of the scene whose errors go together.
struct ClusteredPoint {
    double* values;
    int cluster;
};

/// Which part of the scene residuals belong to: those of points, and those of no point. Others stand for themselves.
struct Clusters {
    std::vector<ClusteredPoint> points = {};
    std::map<ceres::ResidualBlockId, int> pointless = {};
    /// There are enough of them that each can be spared.
    bool many = false;
};

/// Fills fit.covariance; leaves it empty where the problem is singular. Without clusters it is the inverse normal
/// matrix scaled by rss / (residuals - unknowns). Points are blocks of three that appear together with others but
/// never with each other: they are eliminated one by one (Schur complement), which keeps what is inverted as small as
/// the model and `kept`, the evidence's other unknowns. With clusters residuals may hang together in any way within one
/// (a piece of wall has the same depth error from everywhere, neighbours on an outline are off by the same): the
/// covariance is the cluster-robust one (Liang and Zeger 1986). Of many clusters each is left out in turn, by one
/// Newton step (the jackknife of Bell and McCaffrey 2002): one that has pulled the fit to itself has small residuals.
void add_covariance(ceres::Problem& problem, Fit& fit, const Free& free, const std::vector<double*>& kept,
                    const Clusters& clusters);

/// Moves a point by a pose of six numbers: axis times angle, then translation.
template <class Number>
void moved(const Number* pose, const Number* point, Number* result);

} // namespace scanshade::calibration

#include <ceres/rotation.h>

template <class Number>
void scanshade::calibration::moved(const Number* pose, const Number* point, Number* result) {
    ceres::AngleAxisRotatePoint(pose, point, result);
    for (int i = 0; i < 3; ++i)
        result[i] += pose[3 + i];
}
