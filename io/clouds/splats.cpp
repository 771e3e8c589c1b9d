#include "io/clouds/splats.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace scanshade {

std::optional<SplatFields> splat_fields(const CloudRecords& records) {
    constexpr std::array names{"f_dc_0",  "f_dc_1", "f_dc_2", "opacity", "scale_0",
                               "scale_1", "rot_0",  "rot_1",  "rot_2",   "rot_3"};
    std::array<std::size_t, names.size()> found{};
    for (std::size_t k = 0; k < names.size(); ++k) {
        const auto field = records.field_named(names[k]);
        if (!field)
            return std::nullopt;
        found[k] = *field;
    }
    return SplatFields{found[3], {found[0], found[1], found[2]}};
}

double opacity_of(const CloudRecords& records, const SplatFields& fields, std::size_t splat) {
    return 1 / (1 + std::exp(-value_at(records, records.record(splat), fields.opacity)));
}

std::optional<std::string> doubt_of_splats(const Cloud& cloud) {
    constexpr double many = 0.1;
    const auto fields = cloud.records ? splat_fields(*cloud.records) : std::nullopt;
    if (!fields)
        return std::nullopt;
    double translucent = 0, used = 0;
    for (std::size_t i = 0; i < cloud.points.size(); ++i)
        if (cloud.points[i].allFinite()) {
            ++used;
            translucent += opacity_of(*cloud.records, *fields, i) < solid_opacity;
        }
    if (translucent <= many * used)
        return std::nullopt;
    return fmt::format(
        "{:.0f} % of the splats have an opacity below {:g}: they occlude here as solid ones do, more than "
        "what they show.",
        100 * translucent / used, solid_opacity);
}

std::vector<cv::Vec3b> colours_of(const CloudRecords& records, const SplatFields& fields) {
    constexpr double of_degree_0 = 0.28209479177387814; // the spherical harmonic's value, 1 / sqrt(4 pi)
    std::vector<cv::Vec3b> colours(records.point_count);
    tbb::parallel_for(std::size_t(0), colours.size(), [&](std::size_t i) {
        const std::string_view record = records.record(i);
        for (std::size_t channel = 0; channel < 3; ++channel) {
            const double value = 0.5 + of_degree_0 * value_at(records, record, fields.f_dc[channel]);
            colours[i][2 - static_cast<int>(channel)] = cv::saturate_cast<uchar>(std::isnan(value) ? 0 : 255 * value);
        }
    });
    return colours;
}

} // namespace scanshade
