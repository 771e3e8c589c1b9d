// Ceres, as all problems use it: settings, fixed numbers, covariance.
#include "projection/calibration/solve.h"

#include "projection/base/error.h"

#include <Eigen/Dense>
#include <glog/logging.h>
#include <optional>

namespace scanshade::calibration {
namespace {

struct Block {
    int first, size;
};
constexpr Block blocks[] = {
    {0, camera_unknowns}, {depth_scale, depth_unknowns}, {rotation_x, extrinsic_unknowns}, {time_offset, 1}};

std::vector<int> free_in(const Block& block, const Free& free) {
    std::vector<int> indices;
    for (int i = 0; i < block.size; ++i)
        if (free[block.first + i])
            indices.push_back(i);
    return indices;
}

bool in_use(const ceres::Problem& problem, const Model& model, const Block& block) {
    return problem.HasParameterBlock(model.values.data() + block.first);
}

} // namespace

void fix(ceres::Problem& problem, Model& model, const Free& free) {
    for (const Block& block : blocks) {
        if (!in_use(problem, model, block))
            continue;
        double* values = model.values.data() + block.first;
        const std::vector<int> open = free_in(block, free);
        if (open.empty()) {
            problem.SetParameterBlockConstant(values);
            continue;
        }
        problem.SetParameterBlockVariable(values);
        std::vector<int> fixed;
        for (int i = 0; i < block.size; ++i)
            if (!free[block.first + i])
                fixed.push_back(i);
        if (!fixed.empty())
            problem.SetManifold(values, new ceres::SubsetManifold(block.size, fixed));
    }
}

void solve(ceres::Problem& problem, Fit& fit, bool many_unknowns) {
    FLAGS_minloglevel = google::GLOG_ERROR; // Ceres repeats a failed step, shorter: no reason to warn
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR; // poses and model are few, and points are eliminated
    options.max_num_iterations = many_unknowns ? 40 : 100;
    options.function_tolerance = many_unknowns ? 1e-6 : 1e-10; // of a sum of thousands of squared sigmas
    options.gradient_tolerance = 1e-12;
    options.parameter_tolerance = 1e-10;
    options.logging_type = ceres::SILENT;
    options.num_threads = many_unknowns ? 2 : 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable())
        throw Error("the least squares cannot be solved: " + summary.message);
    double half_rss = 0;
    ceres::Problem::EvaluateOptions without_loss;
    without_loss.apply_loss_function = false;
    problem.Evaluate(without_loss, &half_rss, nullptr, nullptr, nullptr);
    fit.rss = 2 * half_rss;
    fit.residuals = summary.num_residuals_reduced;
    fit.unknowns = summary.num_effective_parameters_reduced;
    fit.converged = summary.termination_type == ceres::CONVERGENCE;
}

namespace {

constexpr int no_cluster = -1;

/// How much wider than two sigmas the interval is that holds as much of Student's distribution as two sigmas hold of
/// the Gaussian one (95.45 %).
double students_factor(double degrees_of_freedom) {
    // Quantiles of Student's distribution for 1, 2, 3, ... degrees of freedom, over 2. Between them, and down to one
    // degree, their logarithm is nearly linear in the degrees' inverse.
    constexpr double factors[] = {6.984, 2.264, 1.653, 1.435, 1.325, 1.259, 1.215, 1.184, 1.160, 1.142};
    constexpr double last = std::size(factors);
    const double degrees = std::max(1.0, degrees_of_freedom);
    if (degrees >= last) // Cornish and Fisher 1938, first term
        return 1 + (factors[std::size(factors) - 1] - 1) * last / degrees;
    const auto below = static_cast<std::size_t>(degrees);
    const double from = 1.0 / static_cast<double>(below), to = 1.0 / static_cast<double>(below + 1);
    const double share = (from - 1 / degrees) / (from - to);
    return std::exp((1 - share) * std::log(factors[below - 1]) + share * std::log(factors[below]));
}

/// The normal equations of each cluster, with its points eliminated. The columns of the sparse Jacobian are the `kept`
/// numbers, then three per point.
class Reduced {
  public:
    Reduced(const ceres::CRSMatrix& jacobian, const std::vector<double>& residuals, Eigen::Index kept,
            const std::vector<int>& of_points, const std::vector<int>& of_rows)
        : kept_(kept), unclustered_(part()), spread_(unclustered_.normal) {
        points_.resize(static_cast<std::size_t>((jacobian.num_cols - kept) / 3));
        for (int row = 0; row < jacobian.num_rows; ++row)
            add_row(jacobian, row, residuals[row], of_points, of_rows[row]);
        for (std::size_t i = 0; i < points_.size(); ++i) {
            const Point& point = points_[i];
            if (point.mixed.size() == 0)
                continue;
            const Eigen::LDLT<Eigen::Matrix3d> own = point.own.ldlt();
            Part& cluster_part = cluster(of_points[i]);
            cluster_part.normal -= point.mixed.transpose() * own.solve(point.mixed);
            cluster_part.gradient -= point.mixed.transpose() * own.solve(point.own_gradient);
        }
        normal_ = unclustered_.normal;
        for (const auto& [number, part] : clusters_)
            normal_ += part.normal;
    }
    [[nodiscard]] const Eigen::MatrixXd& normal() const { return normal_; }
    /// Of the first `wanted` kept numbers, from each cluster's gradient.
    [[nodiscard]] Eigen::MatrixXd covariance(const Eigen::MatrixXd& inverse, Eigen::Index wanted, bool many) const {
        const auto count = static_cast<double>(clusters_.size());
        const Eigen::MatrixXd rows = inverse.topRows(wanted);
        Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(wanted, wanted);
        for (const auto& [number, part] : clusters_) {
            const Eigen::VectorXd step =
                many ? Eigen::VectorXd(without(part).head(wanted)) : Eigen::VectorXd(rows * part.gradient);
            sum += step * step.transpose();
        }
        if (count > 1)
            sum *= many ? (count - 1) / count : count / (count - 1);
        return sum + rows * spread_ * rows.transpose();
    }
    /// As many clusters of equal weight would determine each of these numbers as well; infinite where independent
    /// residuals do.
    [[nodiscard]] Eigen::VectorXd effective_clusters(const Eigen::MatrixXd& inverse, Eigen::Index wanted) const {
        const Eigen::MatrixXd rows = inverse.topRows(wanted);
        // What a part with independent errors adds to the numbers' variances.
        const auto variance_by = [&](const Part& part) -> Eigen::VectorXd {
            return (rows * part.normal).cwiseProduct(rows).rowwise().sum();
        };
        Eigen::VectorXd sum = variance_by(unclustered_); // independent residuals are many, each with a tiny share
        Eigen::VectorXd squares = Eigen::VectorXd::Zero(wanted);
        for (const auto& [number, part] : clusters_) {
            const Eigen::VectorXd variance = variance_by(part);
            sum += variance;
            squares += variance.cwiseAbs2();
        }
        return sum.cwiseAbs2().cwiseQuotient(squares);
    }

  private:
    struct Part {
        Eigen::MatrixXd normal;
        Eigen::VectorXd gradient;
    };
    struct Point {
        Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
        Eigen::MatrixXd mixed;
        Eigen::Vector3d own_gradient = Eigen::Vector3d::Zero();
    };

    /// The Newton step of all residuals but the cluster's, which their own minimum asks for.
    [[nodiscard]] Eigen::VectorXd without(const Part& part) const {
        const Eigen::MatrixXd rest = normal_ - part.normal;
        const Eigen::LLT<Eigen::MatrixXd> fast(rest); // several times as fast; fails where only this cluster tells
        return fast.info() == Eigen::Success ? Eigen::VectorXd(fast.solve(part.gradient))
                                             : Eigen::VectorXd(rest.ldlt().solve(part.gradient));
    }

    [[nodiscard]] Part part() const { return {Eigen::MatrixXd::Zero(kept_, kept_), Eigen::VectorXd::Zero(kept_)}; }
    Part& cluster(int number) {
        const auto found = clusters_.find(number);
        return found == clusters_.end() ? clusters_.emplace(number, part()).first->second : found->second;
    }

    void add_row(const ceres::CRSMatrix& jacobian, int row, double residual, const std::vector<int>& of_points,
                 int of_row) {
        const int begin = jacobian.rows[row], end = jacobian.rows[row + 1];
        std::optional<std::size_t> about;
        for (int a = begin; a < end && !about; ++a)
            if (jacobian.cols[a] >= kept_)
                about = static_cast<std::size_t>((jacobian.cols[a] - kept_) / 3);
        Point* point = about ? &points_[*about] : nullptr;
        if (point && point->mixed.size() == 0)
            point->mixed = Eigen::MatrixXd::Zero(3, kept_);
        const bool alone = !point && of_row == no_cluster;
        Part& cluster_part = alone ? unclustered_ : cluster(point ? of_points[*about] : of_row);
        Eigen::VectorXd gradient = alone ? Eigen::VectorXd::Zero(kept_) : Eigen::VectorXd();
        for (int a = begin; a < end; ++a) {
            const Eigen::Index at = jacobian.cols[a];
            const double value = jacobian.values[a];
            (at < kept_ ? (alone ? gradient : cluster_part.gradient)(at) : point->own_gradient((at - kept_) % 3)) +=
                value * residual;
            for (int b = begin; b < end; ++b)
                add(cluster_part.normal, point, at, jacobian.cols[b], value * jacobian.values[b]);
        }
        if (alone)
            spread_ += gradient * gradient.transpose();
    }
    void add(Eigen::MatrixXd& normal, Point* point, Eigen::Index a, Eigen::Index b, double value) const {
        if (a < kept_ && b < kept_)
            normal(a, b) += value;
        else if (a >= kept_ && b >= kept_)
            point->own((a - kept_) % 3, (b - kept_) % 3) += value;
        else if (a >= kept_)
            point->mixed((a - kept_) % 3, b) += value; // the other half is its transpose
    }

    Eigen::Index kept_;
    Part unclustered_; ///< rows whose errors are independent
    Eigen::MatrixXd normal_, spread_;
    std::vector<Point> points_;
    std::map<int, Part> clusters_;
};

/// Of each row of the Jacobian, in the order of the problem's residual blocks.
std::vector<int> clusters_of_rows(const ceres::Problem& problem,
                                  const std::vector<ceres::ResidualBlockId>& residual_blocks,
                                  const std::map<ceres::ResidualBlockId, int>& clusters) {
    std::vector<int> of_rows;
    for (const ceres::ResidualBlockId block : residual_blocks) {
        const auto found = clusters.find(block);
        const int rows = problem.GetCostFunctionForResidualBlock(block)->num_residuals();
        of_rows.insert(of_rows.end(), rows, found == clusters.end() ? no_cluster : found->second);
    }
    return of_rows;
}

/// The inverse of a symmetric matrix, scaled to a unit diagonal first; empty where double precision cannot invert it.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& normal) {
    constexpr double smallest = 1e-13; // of the eigenvalues: what is left of double precision after squaring
    const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
    if (!scale.allFinite())
        return {};
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scale.asDiagonal() * normal * scale.asDiagonal());
    const Eigen::VectorXd& values = solver.eigenvalues();
    if (!(values(0) > smallest * values(values.size() - 1)))
        return {};
    return scale.asDiagonal() * solver.eigenvectors() * values.cwiseInverse().asDiagonal() *
           solver.eigenvectors().transpose() * scale.asDiagonal();
}

} // namespace

void add_covariance(ceres::Problem& problem, Fit& fit, const Free& free, const std::vector<double*>& kept_blocks,
                    const std::vector<Clusters>& groupings) {
    fit.covariance.resize(0, 0);
    const int spare = fit.residuals - fit.unknowns;
    if (spare <= 0)
        return;
    ceres::Problem::EvaluateOptions options;
    options.apply_loss_function = false;
    std::vector<int> indices; // of the kept columns in the model
    for (const Block& block : blocks) {
        double* values = fit.model.values.data() + block.first;
        if (!in_use(problem, fit.model, block) || problem.IsParameterBlockConstant(values))
            continue;
        options.parameter_blocks.push_back(values);
        for (const int index : free_in(block, free))
            indices.push_back(block.first + index);
    }
    const auto count = static_cast<Eigen::Index>(indices.size());
    auto kept = count;
    for (double* block : kept_blocks)
        if (problem.HasParameterBlock(block) && !problem.IsParameterBlockConstant(block)) {
            options.parameter_blocks.push_back(block);
            kept += problem.ParameterBlockTangentSize(block);
        }
    if (!groupings.empty())
        for (const ClusteredPoint& point : groupings.front().points)
            if (problem.HasParameterBlock(point.values))
                options.parameter_blocks.push_back(point.values);
    problem.GetResidualBlocks(&options.residual_blocks);
    fit.covariance = Eigen::MatrixXd::Zero(unknown_count, unknown_count);
    if (count == 0)
        return;
    ceres::CRSMatrix jacobian;
    std::vector<double> residuals;
    problem.Evaluate(options, nullptr, &residuals, nullptr, &jacobian);
    const auto reduced_by = [&](const Clusters& clusters) {
        std::vector<int> of_points;
        for (const ClusteredPoint& point : clusters.points)
            if (problem.HasParameterBlock(point.values))
                of_points.push_back(point.cluster);
        return Reduced(jacobian, residuals, kept, of_points,
                       clusters_of_rows(problem, options.residual_blocks, clusters.residuals));
    };
    Eigen::MatrixXd all, inverted;
    Eigen::VectorXd effective = Eigen::VectorXd::Zero(count);
    const auto parts = static_cast<double>(groupings.size());
    for (std::size_t i = 0; i < std::max<std::size_t>(1, groupings.size()); ++i) {
        const Reduced reduced = reduced_by(groupings.empty() ? Clusters() : groupings[i]);
        if (inverted.size() == 0) // the same for all groupings
            inverted = inverse(reduced.normal());
        if (inverted.size() == 0 || !inverted.allFinite()) {
            fit.covariance.resize(0, 0);
            return;
        }
        if (groupings.empty()) {
            all = inverted * (fit.rss / spare);
            continue;
        }
        const Eigen::MatrixXd one = reduced.covariance(inverted, count, groupings[i].many) / parts;
        all = i == 0 ? one : Eigen::MatrixXd(all + one);
        effective += reduced.effective_clusters(inverted, count) / parts;
    }
    if (!groupings.empty()) {
        Eigen::VectorXd wider(count);
        for (Eigen::Index i = 0; i < count; ++i)
            wider(i) = students_factor(effective(i) - 1);
        all = wider.asDiagonal() * all * wider.asDiagonal();
    }
    for (Eigen::Index a = 0; a < count; ++a)
        for (Eigen::Index b = 0; b < count; ++b)
            fit.covariance(indices[a], indices[b]) = all(a, b);
}

} // namespace scanshade::calibration
