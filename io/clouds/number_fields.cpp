#include "io/clouds/number_fields.h"

#include "io/clouds/cloud_records.h"
#include "io/clouds/format.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace scanshade {
namespace {

/// A value in some bits of a field ("LAS Specification 1.4 - R15", tables 7, 8, 16 and 17).
struct Bits {
    std::string_view field, name;
    unsigned shift, mask;
};
constexpr std::array old_bits = {Bits{"return_flags", "return", 0, 7}, Bits{"return_flags", "returns", 3, 7},
                                 Bits{"classification", "classification", 0, 31}};
constexpr std::array new_bits = {Bits{"return_numbers", "return", 0, 15}, Bits{"return_numbers", "returns", 4, 15},
                                 Bits{"return_flags", "scanner_channel", 4, 3}};
constexpr double scan_angle_step = 0.006; // degrees, table 15

bool is_las(const CloudRecords& records) { return records.format && records.format->wide_colours; }

/// Shown as places, colours, normals or results.
bool is_shown_otherwise(const CloudRecords& records, std::size_t index) {
    static constexpr std::array<std::string_view, 11> names = {
        "x", "y", "z", "nx", "ny", "nz", "normal_x", "normal_y", "normal_z", "ambient_occlusion", "ao_confidence"};
    const ColourFields colour = colour_fields(records);
    return std::ranges::any_of(names, [&](std::string_view name) { return is_named(records.fields[index], name); }) ||
           colour.packed == index || (colour.bgr && std::ranges::find(*colour.bgr, index) != colour.bgr->end());
}

} // namespace

std::vector<NumberField> number_fields(const CloudRecords& records) {
    std::vector<NumberField> all;
    const bool las = is_las(records), new_format = las && records.field_named("return_numbers");
    const std::span<const Bits> bits = new_format ? std::span<const Bits>(new_bits) : std::span<const Bits>(old_bits);
    for (std::size_t i = 0; i < records.fields.size(); ++i) {
        const CloudField& field = records.fields[i];
        if (field.list_length || field.count != 1 || is_shown_otherwise(records, i))
            continue;
        NumberField shown{
            .name = field.name, .field = i, .whole = field.type != Scalar::float32 && field.type != Scalar::float64};
        const std::size_t before = all.size();
        for (const Bits& part : bits)
            if (las && field.name == part.field) {
                shown.name = part.name, shown.shift = part.shift, shown.mask = part.mask;
                all.push_back(shown);
            }
        if (all.size() > before)
            continue;
        if (new_format && field.name == "scan_angle")
            shown.scale = scan_angle_step, shown.whole = false;
        else if (const LasScale told = las ? las_scale(records, field.name) : LasScale();
                 told.factor != 1 || told.offset != 0)
            shown.scale = told.factor, shown.offset = told.offset, shown.whole = false;
        all.push_back(std::move(shown));
    }
    return all;
}

void read_numbers(const CloudRecords& records, std::span<const NumberField> fields, std::size_t point,
                  std::span<double> values) {
    const std::string_view record = records.record(point);
    for (std::size_t i = 0; i < fields.size(); ++i) {
        const NumberField& from = fields[i];
        double value = value_at(records, record, from.field);
        if (from.mask != 0)
            value = static_cast<double>(static_cast<unsigned>(value) >> from.shift & from.mask);
        values[i] = value * from.scale + from.offset;
    }
}

} // namespace scanshade
