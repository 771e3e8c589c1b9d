// Depth with a sensor's noise.
#pragma once

#include "projection/maps.h"
#include "projection/sensor/noise.h"

#include <cmath>
#include <random>

namespace scanshade::tests {

/// Independent Gaussian noise of the given law, then the disparity steps of a structured-light sensor.
[[nodiscard]] inline DepthImage noisy(const DepthImage& clean, const DepthNoise& noise, double step_per_z2 = 0,
                                      unsigned seed = 1) {
    DepthImage image{clean.camera, clean.z_m.clone(), {}};
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (float& z : image.z_m) {
        if (z <= 0)
            continue;
        double value = z + noise.at(z) * normal(random);
        if (step_per_z2 > 0)
            value = 1 / (std::round(1 / (value * step_per_z2)) * step_per_z2);
        z = static_cast<float>(value);
    }
    return image;
}

} // namespace scanshade::tests
