// How uncertain recorded depth is: sigma(z), measured from the data themselves.
#pragma once

#include "projection/maps.h"

#include <span>
#include <string>

namespace scanshade {

/// Standard deviation of one depth value in metres, quantisation included: sigma(z) = floor_m + per_z2 z^2.
/// The square law is that of disparity sensors; time of flight is nearly all floor (Khoshelham and Elberink 2012).
struct DepthNoise {
    double floor_m = 0;
    double per_z2 = 0; ///< 1/m
    double grain_px =
        1; ///< over how many pixels of a row values err alike (integral of their correlation); 1 = each by itself

    double step_m = 0,
           step_per_z2 = 0; ///< of the values recorded, step_m + step_per_z2 z^2 apart; 0: none found. For people alone

    [[nodiscard]] double at(double z_m) const { return floor_m + per_z2 * z_m * z_m; }
    [[nodiscard]] bool any() const { return floor_m > 0 || per_z2 > 0; }
};

/// Measures sigma(z) on depth images of one sensor: the spread of second differences of 1/z (zero on any plane) in
/// bands of z, and the law fitted through the bands. Edges and curvature are the spread's far tail and do not count, up
/// to three fifths of the samples. The grain follows from how much less adjacent values differ than values 4 pixels
/// apart: a correlation exp(-d^2 / 2 s^2) is taken for granted, since disparity comes from windows of pixels. Steps are
/// told where a quarter of the values that occur lie one step from the next: all alike (16-bit files), or growing with
/// z^2 (disparity).
/// Returns no noise (but steps) where the spread stays below a tenth of a millimetre per metre, or 0.12 mm, which fine
/// 16-bit steps (5000 per metre) make of clean depth: then nothing needs smoothing.
[[nodiscard]] DepthNoise measure_noise(std::span<const DepthImage> images);

/// "auto" is not for here. "none", "kinect" (0.0015, 0.0018, grain 3), "tof" (0.0015, 0) or "floor,per_z2[,grain]".
/// Throws Misuse.
[[nodiscard]] DepthNoise noise_from_text(const std::string& text);

/// "sigma 0.0014 + 0.0018 z^2 m, grain 3.1 px, steps of 0.0029 z^2 m", or "none, steps of 0.0002 m".
[[nodiscard]] std::string describe(const DepthNoise& noise);

} // namespace scanshade
