// Signs of a graph's nodes by its leading eigenvector.
#include "ao/cloud/sides/signed_graph.h"

#include "projection/base/hash.h"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>
#include <limits>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {
namespace {

/// Links by node, in rows: each is there for both of its ends.
struct Rows {
    struct To {
        std::uint32_t node;
        float weight;
    };
    std::vector<std::size_t> starts;
    std::vector<To> links;

    Rows(std::size_t nodes, const std::vector<SignedGraph::Link>& all) : starts(nodes + 2, 0) {
        for (const auto& link : all)
            ++starts[link.a + 2], ++starts[link.b + 2];
        for (std::size_t node = 2; node < starts.size(); ++node)
            starts[node] += starts[node - 1];
        links.resize(starts.back());
        for (const auto& link : all) {
            links[starts[link.a + 1]++] = {link.b, static_cast<float>(link.weight)};
            links[starts[link.b + 1]++] = {link.a, static_cast<float>(link.weight)};
        }
        starts.pop_back();
    }
    [[nodiscard]] std::size_t size() const { return starts.size() - 1; }
    /// Sums `of(link)` over the links of a node, in their order.
    template <class Of>
    [[nodiscard]] double sum(std::size_t node, Of&& of) const {
        double sum = 0;
        for (std::size_t k = starts[node]; k < starts[node + 1]; ++k)
            sum += of(links[k]);
        return sum;
    }
};

/// The links, each divided by the root of its ends' weights: a symmetric matrix with eigenvalues within -1 .. 1.
class Matrix {
  public:
    explicit Matrix(const Rows& rows) : rows_(rows), weight_(size()) {
        for_each([&](std::size_t node) {
            weight_[static_cast<Eigen::Index>(node)] =
                std::sqrt(rows.sum(node, [](const Rows::To& to) { return std::abs(static_cast<double>(to.weight)); }));
        });
        scale_ = (weight_.array() > 0).select(weight_.array().inverse(), 0.0);
    }
    [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(rows_.size()); }
    /// The roots of the nodes' weights.
    [[nodiscard]] const Eigen::VectorXd& weight() const { return weight_; }

    void multiply(const Eigen::VectorXd& vector, Eigen::VectorXd& product) {
        scaled_ = scale_.cwiseProduct(vector);
        product.resize(size());
        for_each([&](std::size_t node) {
            const auto at = static_cast<Eigen::Index>(node);
            product[at] = scale_[at] * rows_.sum(node, [&](const Rows::To& to) {
                return static_cast<double>(to.weight) * scaled_[to.node];
            });
        });
    }

  private:
    template <class Visit>
    void for_each(Visit&& visit) const {
        constexpr std::size_t worth_tasks = 100000; // links: waking threads costs more than a product of fewer
        if (rows_.links.size() < worth_tasks) {
            for (std::size_t node = 0; node < rows_.size(); ++node)
                visit(node);
            return;
        }
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rows_.size(), 256), [&](const auto& range) {
            for (std::size_t node = range.begin(); node < range.end(); ++node)
                visit(node);
        });
    }

    const Rows& rows_;
    Eigen::VectorXd weight_, scale_, scaled_;
};

/// By Lanczos' iteration (1950), every new direction made orthogonal to all before. Once suffices unless that takes
/// most of its length (Daniel, Gragg, Kaufman and Stewart 1976).
Eigen::VectorXd leading_eigenvector(Matrix& matrix) {
    const Eigen::Index steps = std::min<Eigen::Index>(100, matrix.size());
    Eigen::MatrixXd basis(matrix.size(), steps);
    Eigen::VectorXd diagonal(steps), beside(steps), next(matrix.size());
    for (Eigen::Index node = 0; node < next.size(); ++node)
        next[node] = (hash(static_cast<std::uint32_t>(node)) & 1 ? 1 : -1) * matrix.weight()[node];
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> small;
    constexpr double hardly = 1e-6; // the angle left to the eigenvector: residual / gap (Davis and Kahan 1970)
    Eigen::Index done = 0;
    for (; done < steps; ++done) {
        const double length = next.norm();
        constexpr double nothing_new = 1e-9; // of vectors of length 1: the directions so far hold all there is
        if (length <= (done > 0 ? nothing_new : 0.0))
            break;
        if (done > 0)
            beside[done - 1] = length;
        basis.col(done) = next / length;
        const Eigen::VectorXd direction = basis.col(done);
        matrix.multiply(direction, next);
        diagonal[done] = next.dot(direction);
        next -= diagonal[done] * direction;
        if (done > 0)
            next -= beside[done - 1] * basis.col(done - 1);
        constexpr double most = 0.5;
        for (double before = std::numeric_limits<double>::infinity(), left = next.norm(); left < most * before;) {
            const auto directions = basis.leftCols(done + 1);
            next -= directions * (directions.transpose() * next).eval();
            before = std::exchange(left, next.norm());
        }
        if (const Eigen::Index held = done + 1; held % 10 == 0 && held < steps) {
            small.computeFromTridiagonal(diagonal.head(held), beside.head(done));
            const double gap = small.eigenvalues()[done] - small.eigenvalues()[done - 1];
            if (next.norm() * std::abs(small.eigenvectors()(done, done)) < hardly * gap) {
                done = held;
                break;
            }
        }
    }
    if (done == 0)
        return Eigen::VectorXd::Zero(matrix.size());
    small.computeFromTridiagonal(diagonal.head(done), beside.head(done - 1));
    return basis.leftCols(done) * small.eigenvectors().col(done - 1);
}

std::vector<std::int8_t> signs_of(const Eigen::VectorXd& values) {
    std::vector<std::int8_t> signs(static_cast<std::size_t>(values.size()));
    std::transform(values.begin(), values.end(), signs.begin(),
                   [](double value) { return static_cast<std::int8_t>(value < 0 ? -1 : 1); });
    return signs;
}

/// The leading eigenvector is nearly zero on parts that hardly hang together with the rest. There, signs of equal
/// weight come to an agreement among neighbours.
std::vector<std::int8_t> agreed_nearby(Matrix& matrix, const std::vector<std::int8_t>& signs) {
    constexpr int rounds = 30;
    constexpr double shift = 0.3; // without it, the most negative eigenvalue might lead
    Eigen::VectorXd values(matrix.size()), next;
    for (Eigen::Index node = 0; node < values.size(); ++node)
        values[node] = signs[static_cast<std::size_t>(node)] * matrix.weight()[node];
    for (int round = 0; round < rounds; ++round) {
        matrix.multiply(values, next);
        values = shift * values + next;
    }
    return signs_of(values);
}

} // namespace

void SignedGraph::add(std::uint32_t a, std::uint32_t b, double weight) {
    if (a != b)
        links_.push_back({a, b, weight});
}

std::vector<std::int8_t> SignedGraph::signs() const {
    const Rows rows(nodes_, links_);
    Matrix matrix(rows);
    std::vector<std::int8_t> signs = agreed_nearby(matrix, signs_of(leading_eigenvector(matrix)));
    constexpr int most_rounds = 100; // each turn makes the sum larger, so that there is an end
    for (int round = 0; round < most_rounds; ++round) {
        bool any = false;
        for (std::size_t node = 0; node < nodes_; ++node) {
            const double agreed =
                rows.sum(node, [&](const Rows::To& to) { return static_cast<double>(to.weight) * signs[to.node]; });
            if (agreed * signs[node] < 0) {
                signs[node] = static_cast<std::int8_t>(-signs[node]);
                any = true;
            }
        }
        if (!any)
            break;
    }
    return signs;
}

} // namespace scanshade
