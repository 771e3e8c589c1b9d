// The noise of a cloud: thickness of flat neighbourhoods.
#include "ao/cloud/surface/cloud_noise.h"

#include "ao/cloud/surface/moments.h"
#include "projection/base/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3f;

constexpr std::size_t sample = 1024, enough_points = 2048;
constexpr std::size_t fewest_points = 12;

/// The points within a ball, by the plane through them.
struct Ball {
    float thickness = 0, width = 0; ///< standard deviations
    float unrelated = 0;            ///< standard deviation off the plane of points side by side: within cells of it
    float kurtosis = 3;             ///< of the offsets off the plane: 3 for noise, 1 for two sheets
    std::size_t points = 0;
};

/// Normals recorded with the points, or none.
struct Facing {
    const NeighbourTree& tree;
    std::span<const Eigen::Vector3d> normals; ///< by index of the cloud

    /// The other side of a thin board is no noise.
    [[nodiscard]] bool alike(std::size_t one, std::size_t other) const {
        return normals.empty() || normals[tree.original(one)].dot(normals[tree.original(other)]) >= 0;
    }
};

/// Of offsets (x, y in the plane, -1 .. 1; z off it), the standard deviation within cells that hold about four.
/// Structure is alike side by side, noise is not.
float spread_within_cells(std::span<const Vector3f> offsets) {
    const int side = std::max(2, static_cast<int>(std::sqrt(static_cast<float>(offsets.size()) / 4)));
    struct Sums {
        float count = 0, sum = 0, squares = 0;
    };
    std::vector<Sums> cells(static_cast<std::size_t>(side * side));
    const auto along = [side](float x) {
        return std::clamp(static_cast<int>((x + 1) / 2 * static_cast<float>(side)), 0, side - 1);
    };
    for (const Vector3f& offset : offsets) {
        Sums& cell = cells[static_cast<std::size_t>(along(offset.y()) * side + along(offset.x()))];
        cell.count += 1;
        cell.sum += offset.z();
        cell.squares += offset.z() * offset.z();
    }
    float squares = 0, freedom = 0;
    for (const Sums& cell : cells)
        if (cell.count > 1) {
            squares += cell.squares - cell.sum * cell.sum / cell.count;
            freedom += cell.count - 1;
        }
    return freedom > 0 ? std::sqrt(std::max(squares, 0.0F) / freedom) : 0;
}

Ball ball_round(const Facing& facing, std::size_t middle_index, float radius) {
    const Vector3f& at = facing.tree[middle_index];
    Moments moments;
    std::vector<Vector3f> offsets;
    facing.tree.for_each_within(at, radius, [&](std::size_t index) {
        if (offsets.size() < NoiseLook::most_points && facing.alike(index, middle_index)) {
            offsets.emplace_back((facing.tree[index] - at) / radius);
            moments.add(offsets.back());
        }
    });
    const std::size_t points = offsets.size();
    if (points < fewest_points)
        return {0, 0, 0, 3, points};
    const PrincipalAxes axes(moments.covariance());
    const float freed = static_cast<float>(points) / static_cast<float>(points - 3); // a plane takes three
    const Vector3f x = axes.normal.unitOrthogonal(), y = axes.normal.cross(x), middle = moments.mean();
    float fourth = 0;
    for (Vector3f& offset : offsets) {
        offset = Vector3f(offset.dot(x), offset.dot(y), (offset - middle).dot(axes.normal));
        fourth += offset.z() * offset.z() * offset.z() * offset.z() / static_cast<float>(points);
    }
    const float square = axes.variances[0] * axes.variances[0];
    return {radius * std::sqrt(freed * axes.variances[0]), radius * std::sqrt(axes.variances[1]),
            radius * spread_within_cells(offsets), square > 0 ? fourth / square : 3, points};
}

} // namespace

std::optional<float> noise_round(const NeighbourTree& tree, std::span<const Eigen::Vector3d> normals, std::size_t index,
                                 const NoiseLook& look) {
    const Facing facing{tree, normals};
    constexpr float two_sheets = 1.6F;          // kurtosis of noisy sheets five sigma apart
    constexpr float growth = 1.5F, flat = 3.5F; // a disc's width is half its radius
    constexpr float no_thicker = 1.3F, rounding = 2e-4F, mostly = 0.7F;
    Nearest nearest;
    facing.tree.find_round(index, 16, nearest);
    if (nearest.all().empty())
        return std::nullopt;
    float radius = std::sqrt(nearest.all().back().distance2);
    if (!(radius > 0))
        return std::nullopt;
    for (Ball ball = ball_round(facing, index, radius);
         radius < look.widest && growth * radius <= look.reach && ball.points <= enough_points;) {
        radius *= growth;
        const Ball larger = ball_round(facing, index, radius);
        if (ball.points >= fewest_points && ball.width > flat * ball.thickness &&
            larger.thickness <= std::max(no_thicker * ball.thickness, rounding * radius) &&
            (!facing.normals.empty() || larger.kurtosis > two_sheets) &&
            larger.unrelated >= std::min(mostly * larger.thickness, larger.thickness - rounding * radius))
            return larger.unrelated;
        ball = larger;
    }
    return std::nullopt;
}

namespace {

/// So many of the tree's points, evenly spread over it.
std::vector<std::size_t> spread_over(const NeighbourTree& tree) {
    std::vector<std::size_t> places(std::min(sample, tree.size()));
    for (std::size_t i = 0; i < places.size(); ++i)
        places[i] = (2 * i + 1) * tree.size() / (2 * places.size());
    return places;
}

} // namespace

CloudNoise::CloudNoise(const NeighbourTree& tree, float widest, std::span<const Eigen::Vector3d> normals)
    : CloudNoise(tree, NoiseLook{widest}, normals, spread_over(tree)) {}

CloudNoise::CloudNoise(const NeighbourTree& tree, const NoiseLook& look, std::span<const Eigen::Vector3d> normals,
                       std::span<const std::size_t> places) {
    std::vector<std::optional<float>> found(places.size());
    std::vector<Vector3f> at(places.size());
    tbb::parallel_for(std::size_t(0), places.size(), [&](std::size_t i) {
        found[i] = noise_round(tree, normals, places[i], look);
        at[i] = tree[places[i]];
    });
    *this = CloudNoise(at, found);
}

CloudNoise::CloudNoise(std::span<const Vector3f> places, std::span<const std::optional<float>> found) {
    for (std::size_t i = 0; i < places.size(); ++i)
        if (found[i]) {
            positions_.push_back(places[i]);
            sigmas_.push_back(*found[i]);
        }
    constexpr std::size_t fewest_share = 5; // a fifth
    if (sigmas_.empty() || fewest_share * sigmas_.size() < places.size()) {
        sigmas_.clear();
        positions_.clear();
        return;
    }
    summarize();
}

CloudNoise::CloudNoise(std::vector<Vector3f> positions, std::vector<float> sigmas)
    : positions_(std::move(positions)), sigmas_(std::move(sigmas)) {
    if (!sigmas_.empty())
        summarize();
}

void CloudNoise::summarize() {
    median_ = scanshade::median(sigmas_);
    constexpr float varies_by = 4;
    std::vector<float> sorted = sigmas_;
    largest_ = varies_by * quantile(sorted, 0.25);
}

CloudNoise CloudNoise::moved(const Eigen::Vector3d& apart) const {
    CloudNoise other = *this;
    for (Vector3f& position : other.positions_)
        position = (position.cast<double>() - apart).cast<float>();
    return other;
}

float CloudNoise::at(const Vector3f& point) const {
    constexpr std::size_t wanted = 16;
    struct Near {
        float distance2, sigma;
    };
    std::array<Near, wanted> near;
    std::size_t count = 0;
    for (std::size_t i = 0; i < positions_.size(); ++i) {
        const float distance2 = (positions_[i] - point).squaredNorm();
        if (count == wanted && distance2 >= near[count - 1].distance2)
            continue;
        std::size_t at = count < wanted ? count++ : count - 1;
        for (; at > 0 && near[at - 1].distance2 > distance2; --at)
            near[at] = near[at - 1];
        near[at] = {distance2, sigmas_[i]};
    }
    if (count == 0)
        return 0;
    std::array<float, wanted> sigmas;
    std::transform(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(count), sigmas.begin(),
                   [](const Near& n) { return n.sigma; });
    std::nth_element(sigmas.begin(), sigmas.begin() + static_cast<std::ptrdiff_t>(count / 4),
                     sigmas.begin() + static_cast<std::ptrdiff_t>(count));
    return std::min(sigmas[count / 4], largest_);
}

} // namespace scanshade
