#include "ao/cloud/repeatability.h"

#include "ao/cloud/neighbours.h"

#include <algorithm>
#include <cmath>
#include <tbb/parallel_for.h>

namespace scanshade {

using Eigen::Vector3d, Eigen::Vector3f;

double ThinnedCheck::error_per_difference() const { return keep > 0 && keep < 1 ? 1 / (std::sqrt(1 / keep) - 1) : 0; }

ThinnedCheck thinned_check(std::size_t points, double radius_in_spacings) {
    constexpr double enough = 100000;   // points to compute again
    constexpr double fewest = 200;      // points of which a quarter still makes surfaces
    constexpr double dense = 60;        // spacings in the radius: the error is below 0.05 then, with noise, too
    constexpr double still_spanned = 4; // spacings of the thinned cloud in the radius
    const auto all = static_cast<double>(points);
    if (all < fewest || !(radius_in_spacings > 0) || radius_in_spacings > dense)
        return {};
    const double thinner = std::min(all / enough, std::pow(radius_in_spacings / still_spanned, 2));
    return {1 / std::max(4.0, thinner)};
}

Repeatability repeatability(std::span<const Vector3d> points, std::span<const float> whole,
                            std::span<const std::uint32_t> kept, std::span<const float> thinned,
                            const ThinnedCheck& check) {
    constexpr std::size_t surroundings = 12; // kept points
    constexpr float half_at = 0.15F;
    std::vector<Vector3d> compared;
    std::vector<float> squares;
    for (std::size_t k = 0; k < kept.size(); ++k)
        if (const float off = thinned[k] - whole[kept[k]]; !std::isnan(off)) {
            compared.push_back(points[kept[k]]);
            squares.push_back(off * off);
        }
    Repeatability found;
    found.confidence.assign(points.size(), 1.0F);
    if (compared.empty())
        return found;
    double sum = 0;
    for (const float square : squares)
        sum += square;
    found.error = check.error_per_difference() * std::sqrt(sum / static_cast<double>(squares.size()));

    const LocalCloud cloud(compared);
    const auto scale = static_cast<float>(std::pow(check.error_per_difference(), 2) / (half_at * half_at));
    std::vector<float> factor(cloud.size()); // by place
    tbb::parallel_for(std::size_t(0), cloud.size(), [&](std::size_t place) {
        Nearest nearest;
        cloud.tree.find_round(place, surroundings, nearest);
        float mean = squares[cloud.tree.index(place)];
        for (const Nearest::Neighbour& neighbour : nearest.all())
            mean += squares[cloud.tree.index(neighbour.point)];
        mean /= static_cast<float>(nearest.all().size() + 1);
        factor[place] = 1 / (1 + scale * mean);
    });
    tbb::parallel_for(std::size_t(0), points.size(), [&](std::size_t i) {
        if (std::isnan(whole[i]))
            return;
        Nearest nearest;
        cloud.tree.find_near((points[i] - cloud.middle).cast<float>(), 1, nearest);
        found.confidence[i] = factor[nearest.all().front().point];
    });
    return found;
}

} // namespace scanshade
