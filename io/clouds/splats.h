// Gaussian splats in a PLY: a point's opacity and colour, in place of a surface.
#pragma once

#include "io/clouds/cloud_records.h"
#include "projection/frame.h"

#include <array>
#include <cstddef>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace scanshade {

/// Splats less opaque than this show hardly anything; trained ones float by the thousand in the air.
inline constexpr double least_opacity = 0.05;
/// Splats less opaque than this let half of the light through and more, and occlude here as solid ones do.
inline constexpr double solid_opacity = 0.5;

struct SplatFields {
    std::size_t opacity;             ///< its logit
    std::array<std::size_t, 3> f_dc; ///< red, green, blue
};

/// The fields of splats as the method's authors write them (Kerbl et al., "3D Gaussian Splatting", 2023), or of flat
/// ones without scale_2 (Huang et al., "2D Gaussian Splatting", 2024); nothing where one is missing.
[[nodiscard]] std::optional<SplatFields> splat_fields(const CloudRecords& records);
/// 0 .. 1; NaN where it is no number.
[[nodiscard]] double opacity_of(const CloudRecords& records, const SplatFields& fields, std::size_t splat);
/// A sentence where more than a tenth of the splats that are used are translucent.
[[nodiscard]] std::optional<std::string> doubt_of_splats(const Cloud& cloud);
/// BGR: the part of the colour that is the same from all sides.
[[nodiscard]] std::vector<cv::Vec3b> colours_of(const CloudRecords& records, const SplatFields& fields);

} // namespace scanshade
