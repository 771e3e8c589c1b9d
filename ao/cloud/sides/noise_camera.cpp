#include "ao/cloud/sides/noise_camera.h"

#include "projection/base/statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tbb/parallel_for.h>
#include <vector>

namespace scanshade {
namespace {

using Eigen::Vector3f;

constexpr double least_seen = 0.5; ///< share of the surface: cameras see 0.55 to 0.9, the best place round a tree 0.5

/// 0, 1, 2 ... by size; the smallest first.
std::vector<double> ranks(const std::vector<double>& values) {
    std::vector<std::size_t> order(values.size());
    std::iota(order.begin(), order.end(), std::size_t(0));
    std::ranges::sort(order, [&](std::size_t a, std::size_t b) {
        return values[a] < values[b] || (values[a] == values[b] && a < b);
    });
    std::vector<double> rank(values.size());
    for (std::size_t k = 0; k < order.size(); ++k)
        rank[order[k]] = static_cast<double>(k);
    return rank;
}

/// Spearman's.
double rank_correlation(const std::vector<double>& some, const std::vector<double>& others) {
    const std::vector<double> a = ranks(some), b = ranks(others);
    const auto count = static_cast<double>(a.size());
    double squares = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        squares += (a[i] - b[i]) * (a[i] - b[i]);
    return a.size() < 2 ? 0 : 1 - 6 * squares / (count * (count * count - 1));
}

/// Evenly in the unit cube: multiples of the powers of the root of x^4 = x + 1 (Roberts 2018).
Vector3f even_in_cube(std::size_t k) {
    constexpr double root = 1.2207440846057596;
    Vector3f place;
    double step = 1;
    for (float& along : place) {
        step /= root;
        along = static_cast<float>(std::fmod(0.5 + static_cast<double>(k) * step, 1.0));
    }
    return place;
}

/// Points of the surface that places are judged by.
class Judge {
  public:
    Judge(const CloudSurface& surface, const DiscRays& rays) : surface_(surface), rays_(rays) {
        constexpr std::size_t wanted = 400;
        for (std::size_t k = 0; k < wanted; ++k) {
            const std::size_t index = (2 * k + 1) * surface.size() / (2 * wanted);
            if (!surface.normals[index].isZero() && surface.disc_radius[index] > 0 &&
                (tests_.empty() || tests_.back() != index))
                tests_.push_back(index);
        }
    }

    [[nodiscard]] const std::vector<std::size_t>& tests() const { return tests_; }

    [[nodiscard]] NoiseCamera of(const Vector3f& position) const {
        std::vector<double> distance, sigma, density, thinning;
        for (const std::size_t index : tests_) {
            if (rays_.seen_from(index, position) == 0)
                continue;
            const Vector3f apart = position - surface_.tree[index];
            const auto far = static_cast<double>(apart.norm());
            const auto radius = static_cast<double>(surface_.disc_radius[index]);
            distance.push_back(far);
            sigma.push_back(static_cast<double>(surface_.noise[index]));
            density.push_back(static_cast<double>(surface_.weight(index)) / (radius * radius));
            thinning.push_back(static_cast<double>(std::abs(apart.dot(surface_.normals[index]))) / (far * far * far));
        }
        return {position, static_cast<double>(distance.size()) / static_cast<double>(tests_.size()),
                rank_correlation(sigma, distance), rank_correlation(density, thinning)};
    }

    /// The best of places in a box, the one given among them.
    [[nodiscard]] NoiseCamera best(const NoiseCamera& known, const Vector3f& low, const Vector3f& size,
                                   std::size_t places) const {
        std::vector<NoiseCamera> found(places);
        tbb::parallel_for(std::size_t(0), places,
                          [&](std::size_t k) { found[k] = of(low + size.cwiseProduct(even_in_cube(k))); });
        found.push_back(known);
        return *std::ranges::max_element(found, {}, [](const NoiseCamera& camera) {
            return camera.seen > least_seen ? camera.seen + camera.noise + camera.density : camera.seen - 3;
        });
    }

  private:
    const CloudSurface& surface_;
    const DiscRays& rays_;
    std::vector<std::size_t> tests_;
};

} // namespace

std::optional<NoiseCamera> camera_of_noise(const CloudSurface& surface, const DiscRays& rays) {
    constexpr std::size_t fewest_tests = 100, places = 1500, nearer_places = 100;
    constexpr double grows = 0.68; // cameras of merged frames read 0.73 to 0.96, the best place round a tree 0.62
    constexpr float outmost = 0.02F, round = 0.5F; // of the extent
    const Judge judge(surface, rays);
    if (judge.tests().size() < fewest_tests)
        return std::nullopt;
    Vector3f low, size;
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<float> along;
        for (const std::size_t index : judge.tests())
            along.push_back(surface.tree[index][axis]);
        low[axis] = quantile(along, outmost);
        size[axis] = quantile(along, 1 - outmost) - low[axis];
    }
    NoiseCamera camera = judge.best({}, low - round * size, (1 + 2 * round) * size, places);
    float side = 0.4F * size.norm();
    for (int pass = 0; pass < 3; ++pass, side /= 2)
        camera =
            judge.best(camera, camera.position - Vector3f::Constant(side / 2), Vector3f::Constant(side), nearer_places);
    return camera.seen > least_seen && camera.noise > grows ? std::optional(camera) : std::nullopt;
}

} // namespace scanshade
