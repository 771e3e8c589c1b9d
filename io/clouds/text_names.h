// Names of columns in texts of points: what others call x, y, z and colours.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace scanshade {

/// A line of names in our words.
struct ColumnNames {
    std::vector<std::string> ours; ///< in lower case; x, y, z, red, green, blue by these names
    double metres = 1;             ///< a unit of the coordinates, from "X [mm]", "x_mm" or "X1 (mm)"
};

/// "//X Y Z Rf Gf Bf", "Easting Northing Height [m]" or "pos_x pos_y pos_z" as names of ours.
[[nodiscard]] ColumnNames column_names(const std::vector<std::string_view>& words);
/// Whether x, y and z are there, once each.
[[nodiscard]] bool names_axes(const std::vector<std::string>& names);
/// Whether a line below the names holds units alone: "[m] [m] [m]".
[[nodiscard]] bool is_line_of_units(const std::vector<std::string_view>& words);
/// The metres of "[mm]" or "(cm)"; 1 of other words.
[[nodiscard]] double metres_in(std::string_view word);

} // namespace scanshade
