#include "io/rasters/crs.h"

#include "io/rasters/well_known_text.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <optional>
#include <span>

namespace scanshade::rasters {

namespace {

// Keys of the GeoTIFF specification (OGC 19-008).
constexpr int model_type = 1024, raster_type = 1025, citation = 1026, geographic_crs = 2048, projected_crs = 3072,
              projected_citation = 3073, projected_unit = 3076, projected_unit_size = 3077, vertical_crs = 4096,
              vertical_unit = 4099;
constexpr int geographic_model = 2, pixel_is_area = 1, user_defined = 32767;
constexpr std::uint16_t here = 0, in_doubles = 34736, in_ascii = 34737; // where a value lies

struct UnitOfCodes {
    int first, last, unit;
};

#include "io/rasters/epsg_units.inc"

struct Unit {
    int code;
    double metres;
};

constexpr Unit units[] = {
    {9001, 1},                  // metre
    {9002, 0.3048},             // foot
    {9003, 1200.0 / 3937},      // US survey foot
    {9005, 0.3047972654},       // Clarke's foot
    {9031, 1.0000135965},       // German legal metre
    {9036, 1000},               // kilometre
    {9037, 0.9143917962},       // Clarke's yard
    {9039, 0.201166195164},     // Clarke's link
    {9040, 0.9143984146160287}, // British yard, Sears 1922
    {9041, 0.3047994715386762}, // British foot, Sears 1922
    {9042, 20.116765121552632}, // British chain, Sears 1922
    {9062, 20.116782494375872}, // British chain, Benoit 1895 B
    {9084, 0.9143985307444408}, // Indian yard
    {9094, 0.3047997101815088}, // Gold Coast foot
    {9095, 0.3048007491},       // British foot, 1936
    {9098, 0.201168},           // link
    {9301, 20.116756},          // British chain, Sears 1922 truncated
};

std::optional<double> metres_of(int unit) {
    const auto found = std::ranges::find(units, unit, &Unit::code);
    return found == std::end(units) ? std::nullopt : std::optional(found->metres);
}

/// Of an EPSG code; metres where the table does not have it.
double unit_of_code(std::span<const UnitOfCodes> table, int code) {
    for (const UnitOfCodes& row : table)
        if (code >= row.first && code <= row.last)
            return metres_of(row.unit).value_or(1);
    return 1;
}

void check(const GeoKeys& keys) {
    const auto& directory = keys.directory;
    if (directory.size() < 4 || directory[0] != 1)
        throw Error(
            fmt::format("a GeoTIFF key directory of {} numbers, expected at least 4 and version 1", directory.size()));
    if (directory.size() < 4 + 4 * std::size_t(directory[3]))
        throw Error(fmt::format("a GeoTIFF key directory of {} numbers, expected {} for its {} keys", directory.size(),
                                4 + 4 * std::size_t(directory[3]), directory[3]));
    for (std::size_t at = 4; at < 4 + 4 * std::size_t(directory[3]); at += 4) {
        const std::size_t end = std::size_t(directory[at + 2]) + directory[at + 3];
        if ((directory[at + 1] == in_doubles && end > keys.doubles.size()) ||
            (directory[at + 1] == in_ascii && end > keys.ascii.size() + 1)) // some count a final zero, some do not
            throw Error(fmt::format("GeoTIFF key {}: its value ends at {} of tag {}, which is shorter", directory[at],
                                    end, directory[at + 1]));
    }
}

/// The four numbers of a key whose value lies there, of the keys that the directory counts; null where it has none.
const std::uint16_t* row_of(const GeoKeys& keys, int key, std::uint16_t where) {
    const auto& directory = keys.directory;
    const std::size_t end = directory.size() < 4 ? 0 : std::min(directory.size(), 4 + 4 * std::size_t(directory[3]));
    for (std::size_t at = 4; at + 3 < end; at += 4)
        if (directory[at] == key && directory[at + 1] == where)
            return &directory[at];
    return nullptr;
}

/// The double of a key in tag 34736.
std::optional<double> double_of(const GeoKeys& keys, int key) {
    const std::uint16_t* const row = row_of(keys, key, in_doubles);
    return row && row[3] < keys.doubles.size() ? std::optional(keys.doubles[row[3]]) : std::nullopt;
}

/// The text of a key in tag 34737, without the bar that ends it.
std::string text_of(const GeoKeys& keys, int key) {
    const std::uint16_t* const row = row_of(keys, key, in_ascii);
    if (!row || row[3] >= keys.ascii.size())
        return "";
    const std::string text = keys.ascii.substr(row[3], row[2]);
    return text.substr(0, text.find('|'));
}

double usable_unit(double metres, const std::string& what) {
    if (!(metres > 0) || !std::isfinite(metres))
        throw Error(fmt::format("{} of {} metres, expected a length above 0", what, metres));
    return metres;
}

double plane_unit(const GeoKeys& keys) {
    const int unit = value_of(keys, projected_unit, 0);
    if (unit == user_defined)
        return usable_unit(double_of(keys, projected_unit_size).value_or(0), "GeoTIFF key 3077: a unit");
    if (unit != 0) {
        const auto metres = metres_of(unit);
        if (!metres)
            throw Error(
                fmt::format("GeoTIFF key 3076: unit {} of the coordinates is not known, expected 9001 (metres), "
                            "9002 or 9003 (feet)",
                            unit));
        return *metres;
    }
    return unit_of_code(units_of_projected, value_of(keys, projected_crs, 0));
}

constexpr std::string_view no_unit_named = "No unit of heights is named";

/// The unit of heights follows that of the plane where no other is named.
void take_plane_unit(Crs& crs) {
    crs.height_unit_m = crs.unit_m;
    if (crs.unit_m != 1)
        crs.notes.push_back(
            fmt::format("{}: they are taken as in the unit of the coordinates, {} m.", no_unit_named, crs.unit_m));
}

} // namespace

int value_of(const GeoKeys& keys, int key, int otherwise) {
    const std::uint16_t* const row = row_of(keys, key, here);
    return row ? row[3] : otherwise;
}

GeoKeys with_value(GeoKeys keys, int key, int value) {
    auto& directory = keys.directory;
    if (directory.empty())
        directory = {1, 1, 0, 0};
    std::size_t at = 4;
    while (at < directory.size() && directory[at] < key) // keys are in order
        at += 4;
    if (at >= directory.size() || directory[at] != key) {
        directory.insert(directory.begin() + static_cast<std::ptrdiff_t>(at),
                         {static_cast<std::uint16_t>(key), here, 1, 0});
        ++directory[3];
    }
    directory[at + 3] = static_cast<std::uint16_t>(value);
    return keys;
}

Crs crs_of_keys(GeoKeys keys) {
    check(keys);
    Crs crs;
    crs.known = true;
    crs.geographic = value_of(keys, model_type, 0) == geographic_model;
    crs.epsg = value_of(keys, crs.geographic ? geographic_crs : projected_crs, 0);
    crs.name = text_of(keys, projected_citation);
    if (crs.name.empty())
        crs.name = text_of(keys, citation);
    if (crs.epsg == user_defined)
        crs.epsg = 0;
    if (!crs.geographic)
        crs.unit_m = plane_unit(keys);
    const int unit = value_of(keys, vertical_unit, 0), vertical = value_of(keys, vertical_crs, 0);
    if (const auto metres = metres_of(unit))
        crs.height_unit_m = *metres;
    else if (vertical != 0 && vertical != user_defined)
        crs.height_unit_m = unit_of_code(units_of_vertical, vertical);
    else
        take_plane_unit(crs);
    crs.keys = std::move(keys);
    return crs;
}

Crs crs_of_text(std::string_view text) {
    const wkt::Node whole = wkt::parsed(text);
    const wkt::Node* horizontal = wkt::horizontal_part(whole);
    const wkt::Node* vertical = wkt::vertical_part(whole);
    Crs crs;
    crs.known = true;
    crs.geographic = horizontal == nullptr || wkt::is_geographic(*horizontal);
    if (!horizontal) {
        crs.text = text;
        return crs;
    }
    crs.epsg = wkt::epsg_of(*horizontal);
    if (!horizontal->values.empty())
        crs.name = horizontal->values[0];
    if (!crs.geographic)
        crs.unit_m = usable_unit(wkt::metres_in_unit(*horizontal).value_or(unit_of_code(units_of_projected, crs.epsg)),
                                 "a unit of the well-known text");
    const int vertical_code = vertical ? wkt::epsg_of(*vertical) : 0;
    if (vertical)
        crs.height_unit_m =
            usable_unit(wkt::metres_in_unit(*vertical).value_or(unit_of_code(units_of_vertical, vertical_code)),
                        "a unit of heights in the well-known text");
    else
        take_plane_unit(crs);
    constexpr int largest_code = 32766; // of keys
    if (crs.epsg == 0 || crs.epsg > largest_code || (vertical && vertical_code == 0)) {
        crs.text = text;
        crs.notes.push_back(
            "The coordinate system has no code of EPSG that keys of GeoTIFF could name: its text goes into a "
            "file beside each raster, NAME.tif.aux.xml.");
    }
    if (crs.epsg == 0 || crs.epsg > largest_code)
        return crs;
    GeoKeys keys = with_value({}, model_type, crs.geographic ? geographic_model : 1);
    keys = with_value(std::move(keys), raster_type, pixel_is_area);
    keys = with_value(std::move(keys), projected_crs, crs.epsg);
    if (vertical_code > 0 && vertical_code <= largest_code)
        keys = with_value(std::move(keys), vertical_crs, vertical_code);
    crs.keys = std::move(keys);
    return crs;
}

void take_height_unit(Crs& crs, const std::string& unit, std::vector<std::string>& notes) {
    struct Word {
        std::string_view word;
        double metres;
    };
    static constexpr Word words[] = {
        {"m", 1},
        {"metre", 1},
        {"meter", 1},
        {"metres", 1},
        {"meters", 1},
        {"ft", 0.3048},
        {"foot", 0.3048},
        {"feet", 0.3048},
        {"cm", 0.01},
        {"mm", 0.001},
        {"km", 1000},
        {"us-ft", 1200.0 / 3937},
        {"ftus", 1200.0 / 3937},
        {"us survey foot", 1200.0 / 3937},
        {"us survey feet", 1200.0 / 3937},
    };
    if (unit.empty())
        return;
    std::string lower = unit;
    std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
    const auto found = std::ranges::find(words, lower, &Word::word);
    if (found == std::end(words)) {
        notes.push_back(
            fmt::format("The unit of heights, {}, is not known: {} m are taken.", in_quotes(unit), crs.height_unit_m));
        return;
    }
    std::erase_if(notes, [](const std::string& note) { return note.starts_with(no_unit_named); });
    if (std::abs(found->metres - crs.height_unit_m) > 1e-9)
        notes.push_back(
            fmt::format("Heights are in {} as the band says, {} m, not {} m as its coordinate system has it.", unit,
                        found->metres, crs.height_unit_m));
    crs.height_unit_m = found->metres;
}

} // namespace scanshade::rasters
