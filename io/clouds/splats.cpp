#include "io/clouds/splats.h"

#include "projection/base/error.h"
#include "projection/srgb.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

namespace scanshade {
namespace {

/// f_rest_0 ... in order; as many as a degree of spherical harmonics has.
std::vector<std::size_t> rest_fields(const CloudRecords& records) {
    constexpr std::string_view prefix = "f_rest_";
    constexpr std::array<std::size_t, 4> counts{0, 9, 24, 45};
    std::size_t named = 0; // the largest number, and one
    for (const CloudField& field : records.fields)
        if (field.name.starts_with(prefix)) {
            std::size_t number = 0;
            const char* const end = field.name.data() + field.name.size();
            if (std::from_chars(field.name.data() + prefix.size(), end, number).ptr == end)
                named = std::max(named, number + 1);
        }
    const auto* const expected = std::ranges::lower_bound(counts, named);
    if (expected == counts.end())
        throw Error(fmt::format("property f_rest_{}: 9, 24 or 45 are expected", named - 1));
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < *expected; ++k) {
        const auto field = records.field_named(fmt::format("{}{}", prefix, k));
        if (!field)
            throw Error(fmt::format("property f_rest_{} is missing: 9, 24 or 45 are expected", k));
        found.push_back(*field);
    }
    return found;
}

} // namespace

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
    SplatFields fields{.f_dc = {found[0], found[1], found[2]},
                       .opacity = found[3],
                       .scale = {found[4], found[5]},
                       .rotation = {found[6], found[7], found[8], found[9]},
                       .f_rest = rest_fields(records)};
    if (const auto third = records.field_named("scale_2"))
        fields.scale.push_back(*third);
    return fields;
}

Splat checked_splat(const Eigen::Quaternionf& rotation, const Eigen::Vector3f& sigma, float opacity) {
    const float norm = rotation.norm();
    const bool usable = norm > 0 && std::isfinite(norm) && sigma.allFinite() && sigma.minCoeff() >= 0 && opacity > 0;
    return usable ? Splat{Eigen::Quaternionf(rotation.coeffs() / norm), sigma, std::min(opacity, 1.0F)} : Splat();
}

std::vector<Splat> splats_of(const CloudRecords& records) {
    const std::optional<SplatFields> fields = splat_fields(records);
    std::vector<Splat> splats(fields ? records.point_count : 0);
    tbb::parallel_for(std::size_t(0), splats.size(), [&](std::size_t i) {
        const std::string_view record = records.record(i);
        const auto value = [&](std::size_t field) { return static_cast<float>(value_at(records, record, field)); };
        Eigen::Vector3f sigma = Eigen::Vector3f::Zero();
        for (std::size_t axis = 0; axis < fields->scale.size(); ++axis)
            sigma[static_cast<int>(axis)] = std::exp(value(fields->scale[axis]));
        const auto& [w, x, y, z] = fields->rotation;
        splats[i] =
            checked_splat({value(w), value(x), value(y), value(z)}, sigma, 1 / (1 + std::exp(-value(fields->opacity))));
    });
    return splats;
}

std::vector<cv::Vec3b> colours_of(const CloudRecords& records, const SplatFields& fields) {
    std::vector<cv::Vec3b> colours(records.point_count);
    tbb::parallel_for(std::size_t(0), colours.size(), [&](std::size_t i) {
        const std::string_view record = records.record(i);
        for (std::size_t channel = 0; channel < 3; ++channel) {
            const double value = 0.5 + colour_of_degree_0 * value_at(records, record, fields.f_dc[channel]);
            colours[i][2 - static_cast<int>(channel)] = cv::saturate_cast<uchar>(std::isnan(value) ? 0 : 255 * value);
        }
    });
    return colours;
}

double light_of(float visibility, double strength) {
    return std::isnan(visibility) ? 1 : 1 - strength + strength * static_cast<double>(visibility);
}

double shaded_channel(double colour, double light) {
    return srgb_from_linear(linear_from_srgb(std::max(colour, 0.0)) * light);
}

double shaded_factor(double colour, double light) {
    constexpr double black = 1e-4, power = 1 / 2.4; // the power of the curve above its linear part
    return colour > black ? shaded_channel(colour, light) / colour : std::pow(light, power);
}

std::vector<FieldReplacement> shaded_splats(const CloudRecords& records, const SplatFields& fields,
                                            std::span<const float> visibility, double strength) {
    std::vector<FieldReplacement> replacements;
    const auto replace = [&](std::size_t field, std::size_t f_dc, bool rest) {
        replacements.push_back({field, [=, &records](std::size_t splat, std::string_view record) {
                                    const double light = light_of(visibility[splat], strength);
                                    const double colour = 0.5 + colour_of_degree_0 * value_at(records, record, f_dc);
                                    const FieldPlace place = locate(records, record, field);
                                    if (light == 1 || !std::isfinite(colour))
                                        return std::string(record.substr(place.offset, place.length));
                                    const double value =
                                        rest ? shaded_factor(colour, light) * value_at(records, record, field)
                                             : (shaded_channel(colour, light) - 0.5) / colour_of_degree_0;
                                    return encoded(records, records.fields[field].type, value);
                                }});
    };
    for (const std::size_t field : fields.f_dc)
        replace(field, field, false);
    for (std::size_t k = 0; k < fields.f_rest.size(); ++k)
        replace(fields.f_rest[k], fields.f_dc[fields.channel_of_rest(k)], true);
    std::ranges::sort(replacements, std::ranges::less(), &FieldReplacement::field);
    return replacements;
}

} // namespace scanshade
