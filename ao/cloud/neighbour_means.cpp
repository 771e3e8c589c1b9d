#include "ao/cloud/neighbour_means.h"

#include "shaders/shared/cloud.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <tbb/parallel_for.h>
#include <utility>

namespace scanshade {

float mean_falloff(float radius) { return -1 / (2 * 0.01F * radius * radius); }

Untouched<float> smoothed(const CloudSurface& surface, const Untouched<float>& values, float radius) {
    Untouched<float> means(values.size());
    const float falloff = mean_falloff(radius);
    tbb::parallel_for(std::size_t(0), values.size(), [&](std::size_t i) {
        means[i] = std::numeric_limits<float>::quiet_NaN();
        if (std::isnan(values[i]))
            return;
        float sum = values[i], weights = 1;
        for (const std::uint32_t j : surface.near[i]) {
            const float alike = surface.normals[i].dot(surface.normals[j]);
            if (j == i || std::isnan(values[j]) || !(alike > 0.9F))
                continue;
            const Eigen::Vector3f apart = surface.tree[j] - surface.tree[i];
            const float off = (values[i] - values[j]) / shared::mean_apart;
            const float weight = std::exp(falloff * apart.squaredNorm()) * std::max(1 - off * off, 0.0F);
            sum += weight * values[j];
            weights += weight;
        }
        means[i] = sum / weights;
    });
    return means;
}

std::vector<char> asked_by_means(const CloudSurface& surface, std::vector<char> wanted, int passes) {
    for (int pass = 0; pass < passes; ++pass) {
        std::vector<char> further = wanted;
        tbb::parallel_for(std::size_t(0), wanted.size(), [&](std::size_t i) {
            if (wanted[i])
                for (const std::uint32_t j : surface.near[i])
                    std::atomic_ref(further[j]).store(1, std::memory_order_relaxed);
        });
        wanted = std::move(further);
    }
    return wanted;
}

} // namespace scanshade
