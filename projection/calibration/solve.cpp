// Ceres, as all evidence uses it: settings, frozen numbers, covariance.
#include "projection/calibration/solve.h"

#include "projection/error.h"

#include <Eigen/Dense>
#include <glog/logging.h>
#include <map>

namespace scanshade::calibration {
namespace {

struct Block {
    int first, size;
};
constexpr Block blocks[] = {
    {0, camera_unknowns}, {depth_scale, depth_unknowns}, {turn_x, place_unknowns}, {time_offset, 1}};

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

void freeze(ceres::Problem& problem, Model& model, const Free& free) {
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
        std::vector<int> frozen;
        for (int i = 0; i < block.size; ++i)
            if (!free[block.first + i])
                frozen.push_back(i);
        if (!frozen.empty())
            problem.SetManifold(values, new ceres::SubsetManifold(block.size, frozen));
    }
}

void solve(ceres::Problem& problem, Fit& fit, bool many_unknowns) {
    FLAGS_minloglevel = google::GLOG_ERROR; // a step that fails is taken again, shorter: nothing to warn of
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR; // poses and model are few, points are eliminated
    options.max_num_iterations = many_unknowns ? 40 : 100;
    options.function_tolerance = many_unknowns ? 1e-7 : 1e-10; // of the sum: far below one sigma of any number
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

/// The normal equations with the points eliminated. Rows come as a sparse Jacobian whose columns hold the first `kept`
/// numbers, then three per point.
class Reduced {
  public:
    Reduced(const ceres::CRSMatrix& jacobian, const std::vector<double>& residuals, Eigen::Index kept,
            const std::vector<int>& clusters)
        : kept_(kept), normal_(Eigen::MatrixXd::Zero(kept, kept)), spread_(normal_) {
        points_.resize(static_cast<std::size_t>((jacobian.num_cols - kept) / 3));
        for (int row = 0; row < jacobian.num_rows; ++row)
            add_row(jacobian, row, residuals[row]);
        std::map<int, Eigen::VectorXd> pulls;
        for (std::size_t i = 0; i < points_.size(); ++i) {
            const Point& point = points_[i];
            if (point.mixed.size() == 0)
                continue;
            const Eigen::LDLT<Eigen::Matrix3d> own = point.own.ldlt();
            normal_ -= point.mixed.transpose() * own.solve(point.mixed);
            const Eigen::VectorXd pull = point.pull - point.mixed.transpose() * own.solve(point.own_pull);
            const auto [sum, first] = pulls.try_emplace(clusters[i], pull);
            if (!first)
                sum->second += pull;
        }
        for (const auto& [cluster, pull] : pulls)
            spread_ += pull * pull.transpose();
        if (pulls.size() > 1)
            spread_ *= static_cast<double>(pulls.size()) / static_cast<double>(pulls.size() - 1);
    }
    [[nodiscard]] const Eigen::MatrixXd& normal() const { return normal_; }
    /// Sum over clusters of the outer product of how each pulls at the kept numbers.
    [[nodiscard]] const Eigen::MatrixXd& spread() const { return spread_; }

  private:
    struct Point {
        Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
        Eigen::MatrixXd mixed;
        Eigen::VectorXd pull;
        Eigen::Vector3d own_pull = Eigen::Vector3d::Zero();
    };

    void add_row(const ceres::CRSMatrix& jacobian, int row, double residual) {
        const int begin = jacobian.rows[row], end = jacobian.rows[row + 1];
        Point* point = nullptr;
        for (int a = begin; a < end && !point; ++a)
            if (jacobian.cols[a] >= kept_)
                point = &points_[static_cast<std::size_t>((jacobian.cols[a] - kept_) / 3)];
        if (point && point->mixed.size() == 0) {
            point->mixed = Eigen::MatrixXd::Zero(3, kept_);
            point->pull = Eigen::VectorXd::Zero(kept_);
        }
        Eigen::VectorXd alone = point ? Eigen::VectorXd() : Eigen::VectorXd::Zero(kept_);
        for (int a = begin; a < end; ++a) {
            const Eigen::Index at = jacobian.cols[a];
            const double value = jacobian.values[a];
            (at < kept_ ? (point ? point->pull : alone)(at) : point->own_pull((at - kept_) % 3)) += value * residual;
            for (int b = begin; b < end; ++b)
                add(point, at, jacobian.cols[b], value * jacobian.values[b]);
        }
        if (!point)
            spread_ += alone * alone.transpose();
    }
    void add(Point* point, Eigen::Index a, Eigen::Index b, double value) {
        if (a < kept_ && b < kept_)
            normal_(a, b) += value;
        else if (a >= kept_ && b >= kept_)
            point->own((a - kept_) % 3, (b - kept_) % 3) += value;
        else if (a >= kept_)
            point->mixed((a - kept_) % 3, b) += value; // the other half is its transpose
    }

    Eigen::Index kept_;
    Eigen::MatrixXd normal_, spread_;
    std::vector<Point> points_;
};

/// The inverse of a symmetric matrix scaled to a unit diagonal first; empty where it has none worth the name.
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

void add_covariance(ceres::Problem& problem, Fit& fit, const Free& free, const std::vector<double*>& poses,
                    const std::vector<ClusteredPoint>& points) {
    fit.covariance.resize(0, 0);
    const int spare = fit.residuals - fit.unknowns;
    if (spare <= 0)
        return;
    ceres::Problem::EvaluateOptions options;
    options.apply_loss_function = false;
    std::vector<int> places; // of the kept columns in the model; -1 for the poses'
    for (const Block& block : blocks) {
        double* values = fit.model.values.data() + block.first;
        if (!in_use(problem, fit.model, block) || problem.IsParameterBlockConstant(values))
            continue;
        options.parameter_blocks.push_back(values);
        for (const int index : free_in(block, free))
            places.push_back(block.first + index);
    }
    const auto count = static_cast<Eigen::Index>(places.size());
    auto kept = count;
    for (double* pose : poses)
        if (problem.HasParameterBlock(pose) && !problem.IsParameterBlockConstant(pose)) {
            options.parameter_blocks.push_back(pose);
            kept += problem.ParameterBlockTangentSize(pose);
        }
    std::vector<int> clusters;
    for (const ClusteredPoint& point : points)
        if (problem.HasParameterBlock(point.values)) {
            options.parameter_blocks.push_back(point.values);
            clusters.push_back(point.cluster);
        }
    fit.covariance = Eigen::MatrixXd::Zero(unknown_count, unknown_count);
    if (count == 0)
        return;
    ceres::CRSMatrix jacobian;
    std::vector<double> residuals;
    problem.Evaluate(options, nullptr, &residuals, nullptr, &jacobian);
    const Reduced reduced(jacobian, residuals, kept, clusters);
    Eigen::MatrixXd all = inverse(reduced.normal());
    if (all.size() == 0 || !all.allFinite()) {
        fit.covariance.resize(0, 0);
        return;
    }
    all = points.empty() ? Eigen::MatrixXd(all * (fit.rss / spare)) : Eigen::MatrixXd(all * reduced.spread() * all);
    for (Eigen::Index a = 0; a < count; ++a)
        for (Eigen::Index b = 0; b < count; ++b)
            fit.covariance(places[a], places[b]) = all(a, b);
}

} // namespace scanshade::calibration
