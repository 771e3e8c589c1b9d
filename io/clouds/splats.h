// Gaussian splats in a PLY: their shapes, the colour common to all directions, and colours shaded.
#pragma once

#include "io/clouds/cloud_records.h"
#include "projection/frame.h"

#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace scanshade {

/// A colour is 0.5 plus this times f_dc: the spherical harmonic of degree 0, 1 / sqrt(4 pi).
inline constexpr double colour_of_degree_0 = 0.28209479177387814;

/// The fields of splats as the method's authors write them (Kerbl et al., "3D Gaussian Splatting", 2023), or of flat
/// ones without scale_2 (Huang et al., "2D Gaussian Splatting", 2024).
struct SplatFields {
    std::array<std::size_t, 3> f_dc;     ///< red, green, blue
    std::size_t opacity;                 ///< its logit
    std::vector<std::size_t> scale;      ///< two or three: logarithms of the sigmas
    std::array<std::size_t, 4> rotation; ///< quaternion w x y z of any length
    std::vector<std::size_t> f_rest;     ///< red, then green, then blue: 0, 9, 24 or 45

    /// Of an index in f_rest: 0 red, 1 green, 2 blue.
    [[nodiscard]] std::size_t channel_of_rest(std::size_t index) const { return index / (f_rest.size() / 3); }
};
/// Nothing where one is missing. Throws Error naming the first that is missing of f_rest_0 ...
[[nodiscard]] std::optional<SplatFields> splat_fields(const CloudRecords& records);
/// One per point, or none where the fields are not those of splats. One whose shape is not finite has opacity 0.
[[nodiscard]] std::vector<Splat> splats_of(const CloudRecords& records);
/// sigma must be set; the rest of a splat that no renderer could show is made opacity 0.
[[nodiscard]] Splat checked_splat(const Eigen::Quaternionf& rotation, const Eigen::Vector3f& sigma, float opacity);

/// BGR: the part of the colour that is the same from all sides.
[[nodiscard]] std::vector<cv::Vec3b> colours_of(const CloudRecords& records, const SplatFields& fields);

/// What visibility leaves of the light: 1 - strength + strength visibility; 1 where that is NaN.
[[nodiscard]] double light_of(float visibility, double strength);
/// A colour of splats, as it is displayed and may exceed 1, times light: srgb(linear(colour) light). In linear light,
/// as shade() of projection/attach.h does it.
[[nodiscard]] double shaded_channel(double colour, double light);
/// The factor of the colour's other coefficients.
[[nodiscard]] double shaded_factor(double colour, double light);
/// What makes f_dc and f_rest shaded by visibility, NaN = not at all. Refers to its arguments.
[[nodiscard]] std::vector<FieldReplacement> shaded_splats(const CloudRecords& records, const SplatFields& fields,
                                                          std::span<const float> visibility, double strength);

} // namespace scanshade
