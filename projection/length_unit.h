// What a recording's lengths are in: metres, or a unit that nothing relates to the metre.
#pragma once

#include <fmt/format.h>
#include <string>

namespace scanshade {

/// The walk computes with numbers of moderate size, which are metres where a recording has them. A recording in an
/// arbitrary unit, such as a reconstruction from images, is measured by its own scene instead: one of the walk's
/// lengths is then a part of the scene's median depth.
struct LengthUnit {
    /// How many units of the recording are one of the walk's lengths; 0 = the walk's lengths are metres.
    double units_per_length = 0;

    [[nodiscard]] bool arbitrary() const { return units_per_length > 0; }
    /// In the recording's units, or metres.
    [[nodiscard]] double told(double length) const { return arbitrary() ? length * units_per_length : length; }
    [[nodiscard]] const char* name() const { return arbitrary() ? "units" : "m"; }
    /// "0.23 m", "0.23 units": a length of the walk as people are told.
    [[nodiscard]] std::string text(double length, int digits = 3) const {
        return fmt::format("{:.{}g} {}", told(length), digits, name());
    }
};

} // namespace scanshade
