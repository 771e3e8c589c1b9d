#include "projection/calibration/solve.h"

#include "projection/error.h"

namespace scanshade::calibration {
namespace {

struct Block {
    int first, size;
};
constexpr Block blocks[] = {{0, camera_unknowns}, {depth_scale, depth_unknowns}, {turn_x, place_unknowns}};

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
    ceres::Solver::Options options;
    options.linear_solver_type = many_unknowns ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    options.max_num_iterations = 100;
    options.function_tolerance = 1e-10;
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

void add_covariance(ceres::Problem& problem, Fit& fit, const Free& free) {
    fit.covariance.resize(0, 0);
    const int spare = fit.residuals - fit.unknowns;
    if (spare <= 0)
        return;
    std::vector<Block> open;
    for (const Block& block : blocks)
        if (in_use(problem, fit.model, block) && !free_in(block, free).empty())
            open.push_back(block);
    ceres::Covariance::Options options;
    options.algorithm_type = ceres::SPARSE_QR;
    options.apply_loss_function = false;
    ceres::Covariance covariance(options);
    std::vector<std::pair<const double*, const double*>> pairs;
    for (std::size_t a = 0; a < open.size(); ++a)
        for (std::size_t b = a; b < open.size(); ++b)
            pairs.emplace_back(fit.model.values.data() + open[a].first, fit.model.values.data() + open[b].first);
    if (!pairs.empty() && !covariance.Compute(pairs, &problem))
        return;
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(unknown_count, unknown_count);
    for (std::size_t a = 0; a < open.size(); ++a)
        for (std::size_t b = a; b < open.size(); ++b) {
            Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> part(open[a].size, open[b].size);
            covariance.GetCovarianceBlock(fit.model.values.data() + open[a].first,
                                          fit.model.values.data() + open[b].first, part.data());
            all.block(open[a].first, open[b].first, open[a].size, open[b].size) = part;
            all.block(open[b].first, open[a].first, open[b].size, open[a].size) = part.transpose();
        }
    if (all.allFinite())
        fit.covariance = all * (fit.rss / spare);
}

} // namespace scanshade::calibration
