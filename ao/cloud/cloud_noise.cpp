// The noise of a cloud: thickness of flat neighbourhoods.
#include "ao/cloud/cloud_noise.h"

#include "ao/cloud/moments.h"
#include "projection/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

using Eigen::Vector3f;

constexpr std::size_t sample = 1024, most_points = 4096;
constexpr std::size_t fewest_points = 12;

/// Thickness and width of the points within a ball: standard deviations.
struct Ball {
    float thickness = 0, width = 0;
    std::size_t points = 0;
};

Ball ball_round(const NeighbourTree& tree, const Vector3f& at, float radius) {
    Moments moments;
    std::size_t points = 0;
    tree.for_each_within(at, radius, [&](std::size_t place) {
        if (++points <= most_points)
            moments.add((tree[place] - at) / radius);
    });
    if (points < fewest_points)
        return {0, 0, points};
    const Vector3f variances = PrincipalAxes(moments.covariance()).variances;
    const float freed = static_cast<float>(points) / static_cast<float>(points - 3); // a plane takes three
    return {radius * std::sqrt(freed * variances[0]), radius * std::sqrt(variances[1]), points};
}

std::optional<float> sigma_round(const NeighbourTree& tree, std::size_t place, float widest) {
    constexpr float growth = 1.5F, flat = 3.5F; // a disc's width is half its radius
    constexpr float no_thicker = 1.3F, rounding = 2e-4F;
    Nearest nearest;
    tree.find_round(place, 16, nearest);
    if (nearest.all().empty())
        return std::nullopt;
    const Vector3f at = tree[place];
    float radius = std::sqrt(nearest.all().back().distance2);
    if (!(radius > 0))
        return std::nullopt;
    for (Ball ball = ball_round(tree, at, radius); radius < widest && ball.points <= most_points / 2;) {
        radius *= growth;
        const Ball larger = ball_round(tree, at, radius);
        if (ball.points >= fewest_points && ball.width > flat * ball.thickness &&
            larger.thickness <= std::max(no_thicker * ball.thickness, rounding * radius))
            return ball.thickness;
        ball = larger;
    }
    return std::nullopt;
}

} // namespace

CloudNoise::CloudNoise(const NeighbourTree& tree, float widest) {
    const std::size_t asked = std::min(sample, tree.size());
    std::vector<std::optional<float>> found(asked);
    const auto place_of = [&](std::size_t i) { return (2 * i + 1) * tree.size() / (2 * asked); };
    tbb::parallel_for(std::size_t(0), asked, [&](std::size_t i) { found[i] = sigma_round(tree, place_of(i), widest); });
    for (std::size_t i = 0; i < asked; ++i)
        if (found[i]) {
            places_.push_back(tree[place_of(i)]);
            sigmas_.push_back(*found[i]);
        }
    if (20 * sigmas_.size() < asked || sigmas_.empty()) {
        sigmas_.clear();
        places_.clear();
        return;
    }
    median_ = scanshade::median(sigmas_);
}

float CloudNoise::at(const Vector3f& point) const {
    constexpr std::size_t wanted = 16;
    struct Near {
        float distance2, sigma;
    };
    std::array<Near, wanted> near;
    std::size_t count = 0;
    for (std::size_t i = 0; i < places_.size(); ++i) {
        const float distance2 = (places_[i] - point).squaredNorm();
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
    return sigmas[count / 4];
}

} // namespace scanshade
