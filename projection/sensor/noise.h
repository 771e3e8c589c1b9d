// The noise of recorded depth: sigma(z), measured from the data.
#pragma once

#include "projection/length_unit.h"
#include "projection/maps.h"

#include <span>
#include <string>

namespace scanshade {

/// What depth shows where it jumps from one surface to another. Rendered depth is sharp. Depth that was resized by
/// interpolation, or smoothed, has two and more pixels that belong to neither surface: it is smeared.
enum class Jumps { unknown, sharp, smeared };

/// Standard deviation of one depth value in metres, quantisation included: sigma(z) = floor_m + per_z2 z^2.
/// The square law is that of disparity sensors; time of flight is nearly all floor (Khoshelham and Elberink 2012).
struct DepthNoise {
    double floor_m = 0;
    double per_z2 = 0;         ///< 1/m
    double correlation_px = 1; ///< correlation length along a row (integral of the correlation); 1 = independent pixels

    /// Quantisation: recorded values are step_m + step_per_z2 z^2 apart; 0 = none found.
    double step_m = 0, step_per_z2 = 0;

    Jumps jumps = Jumps::unknown;

    [[nodiscard]] double at(double z_m) const { return floor_m + per_z2 * z_m * z_m; }
    [[nodiscard]] bool any() const { return floor_m > 0 || per_z2 > 0; }
    /// Whether flying pixels are to be expected, as with all noise.
    [[nodiscard]] bool flies() const { return jumps == Jumps::smeared || (any() && jumps != Jumps::sharp); }
    /// Whether depth is to be prepared before a method sees it.
    [[nodiscard]] bool needs_preparation() const { return any() || flies(); }
};

/// Shorter correlation lengths are those of pixels that err each by itself, as with time of flight.
inline constexpr double independent_px = 1.5;

/// Measures sigma(z) on depth images of one sensor: the spread of second differences of 1/z (zero on any plane) in
/// bands of z, and the law fitted through the bands. Edges and curvature form the far tail of the spread; three fifths
/// of the samples are ignored for them.
///
/// The differences are over 4 pixels. Disparity comes from windows of pixels, which err alike, and so may a sensor that
/// smooths: there differences over 8 and 12 pixels tell more. What surfaces add to these grows with the square of the
/// distance, and differences over 16 pixels tell how much that is. Differences of values in steps are spread evenly
/// over a step (dithered). A band whose values are mostly on one step has no say where others tell; nor have areas of
/// one value, as of all that is beyond a sensor's range.
///
/// The correlation length follows from the ratio of second differences over 1 and over 4 pixels. It assumes a
/// correlation exp(-d^2 / 2 s^2); sigma is corrected for what of it reaches over those pixels. That of disparity is 2.8
/// pixels or more, since jumps between steps hide it. Of depth without disparity steps, relief shows over 4 pixels as
/// such noise does. So the ratio over 1 and 2 pixels is asked first: where that length is below independent_px,
/// differences of adjacent pixels tell sigma.
///
/// Steps are reported where a quarter of the distinct values are one step from the next, or all are whole numbers of
/// one. They are constant (16-bit files) or grow with z^2 (disparity). Steps that explain sigma are no noise: values
/// err by half a step at most, and jumps stay sharp. They may be constant, grow with z^2 (depth buffers), or be those
/// of 16-bit floats. Then sigma is that of the steps where they tilt the surface between adjacent pixels by much, and
/// none where they do not.
///
/// Stereo matchers may prefer whole disparities; what that adds is told from the fractions (pixel_locking.h).
///
/// Exact depth may look noisy: rows of a floor are far apart, and edges may be much of an image. Its slopes tell. Six
/// of ten and more are straight, from each pixel to the next. Or depth is smooth, what seems noise is small, and jumps
/// are sharp.
///
/// Returns no noise, only steps, where sigma is below 0.1 mm per metre or 0.12 mm: then nothing needs smoothing. Clean
/// depth in fine 16-bit steps (5000 per metre) has as much. Jumps are told of depth without other noise; with it,
/// unknown: flying pixels are expected anyway.
[[nodiscard]] DepthNoise measure_noise(std::span<const DepthImage> images);

/// From "none", "kinect" (0.0015, 0.0018, 3 px), "tof" (0.0015, 0) or "floor,per_z2[,correlation]". The caller handles
/// "auto". Throws Misuse.
[[nodiscard]] DepthNoise noise_from_text(const std::string& text);

/// "sigma 0.0014 + 0.0018 z^2 m, correlation length 3.1 px, steps of 0.0029 z^2 m", or "none, steps of 0.0002 m"; of a
/// recording in an arbitrary unit, z and sigma are in that unit.
[[nodiscard]] std::string describe(const DepthNoise& noise, const LengthUnit& unit = {});

} // namespace scanshade
