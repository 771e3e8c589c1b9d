// What all problems share of Ceres: fixed numbers, settings, and the covariance of the model's numbers.
#pragma once

#include "projection/calibration/problem.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <map>

namespace scanshade::calibration {

/// The model's numbers are parameter blocks of Ceres: camera, depth, extrinsics, clock. Of those in the problem, fixes
/// the numbers that are not free.
void fix(ceres::Problem& problem, Model& model, const Free& free);

/// Solves; fills rss (without robust loss), residuals, unknowns, converged. Throws Error where nothing can be solved.
void solve(ceres::Problem& problem, Fit& fit, bool many_unknowns);

/// Three numbers of a scene's point, and the part of the scene whose errors are correlated.
struct ClusteredPoint {
    double* values;
    int cluster;
};

/// Which part of the scene residuals belong to. Residuals of neither kind are independent.
struct Clusters {
    std::vector<ClusteredPoint> points = {};              ///< with all their residuals
    std::map<ceres::ResidualBlockId, int> residuals = {}; ///< of no point
    bool many = false;                                    ///< enough of them to leave out each in turn
};

/// Fills fit.covariance; leaves it empty where the problem is singular.
///
/// Points are blocks of three that appear together with others but never with each other. They are eliminated one by
/// one (Schur complement), so that only the model and `kept`, the problem's other unknowns, are inverted.
///
/// Without clusters the covariance is the inverse normal matrix times rss / (residuals - unknowns). With clusters,
/// residuals of one cluster may be correlated in any way: a wall has the same depth error in all frames, and neighbours
/// on an outline share theirs. The covariance is then the cluster-robust one (Liang and Zeger 1986). Of many clusters
/// each is left out in turn, by one Newton step (the jackknife of Bell and McCaffrey 2002): a cluster that dominates
/// the fit has small residuals. Their number is that of equal clusters which would determine a number as well
/// (Satterthwaite 1946, as Bell and McCaffrey take it), and sigmas are wider by Student's factor, so that two of them
/// hold 95 % even of a few. Where one scene can be cut into clusters in several ways, all with the same points, the
/// mean over the groupings counts.
void add_covariance(ceres::Problem& problem, Fit& fit, const Free& free, const std::vector<double*>& kept,
                    const std::vector<Clusters>& groupings);

/// Transforms a point by a pose of six numbers: axis times angle, then translation.
template <class Number>
void transform_point(const Number* pose, const Number* point, Number* result) {
    ceres::AngleAxisRotatePoint(pose, point, result);
    for (int i = 0; i < 3; ++i)
        result[i] += pose[3 + i];
}

} // namespace scanshade::calibration
