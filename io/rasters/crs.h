// A map's coordinate system: kept as its file's GeoTIFF keys or text, and looked into only for its units.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace scanshade::rasters {

/// The three GeoTIFF tags, as they lie in a file.
struct GeoKeys {
    std::vector<std::uint16_t> directory; ///< tag 34735: four numbers a key, the first four a head; empty = no keys
    std::vector<double> doubles;          ///< tag 34736
    std::string ascii;                    ///< tag 34737
};

struct Crs {
    GeoKeys keys;
    std::string text;               ///< well-known text, where keys cannot say all of it; goes into a file beside
    double unit_m = 1;              ///< metres in a unit of the coordinates
    double height_unit_m = 1;       ///< the same of heights
    bool known = false;             ///< false: the file names none
    bool geographic = false;        ///< coordinates are degrees
    int epsg = 0;                   ///< of the horizontal system; 0 = none is named
    std::string name;               ///< of the horizontal system, for people; empty = none is given
    std::vector<std::string> notes; ///< sentences: what was assumed
};

/// From the tags of a GeoTIFF or the records of a LAS file. Keys stay as they are. A directory that is cut short, or a
/// value outside its tag, is an Error that says which key.
[[nodiscard]] Crs crs_of_keys(GeoKeys keys);
/// From well-known text, version 1 or 2. Codes of EPSG become keys; without one the text is kept.
[[nodiscard]] Crs crs_of_text(std::string_view text);

/// A band's own unit of heights, as GDAL names it ("ft"), goes before that of the coordinate system; empty = none is
/// named. What it changes, and words that are not known, become notes.
void take_height_unit(Crs& crs, const std::string& unit, std::vector<std::string>& notes);

/// A key's value; `otherwise` where it is not there. Values in other tags are not followed.
[[nodiscard]] int value_of(const GeoKeys& keys, int key, int otherwise);
/// The same keys, with a value of this one.
[[nodiscard]] GeoKeys with_value(GeoKeys keys, int key, int value);

} // namespace scanshade::rasters
