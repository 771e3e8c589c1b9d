// Height fields in, sky view and openness out: horizons of every cell by a walk over the surface, in plan view.
//
// Two readings of the surface. `exact`: bilinear between the centres of four cells, and every ray's largest slope found
// where it crosses lines of the grid, at the limit t -> 0, and at stationary points within near squares. `rvt`: the
// nearest cells that the Relief Visualization Toolbox (RVT_py 2) looks at, with its borders and its rounding.
// Sky view: Zaksek, Ostir, Kokalj 2011 (solid angle); Lindberg, Grimmond 2010 (horizontal); Dozier, Frew 1990, without
// its approximation (surface). Openness: Yokoyama, Shirasawa, Pike 2002. Local dominance: Hesse 2016.
#pragma once

#include <array>
#include <opencv2/core.hpp>

namespace scanshade::horizon {

/// Heights of cell centres. Row 0 is the north, column 0 the west; NaN = no data. Heights and cell in one unit.
struct HeightField {
    cv::Mat1f z;
    double cell = 1;
};

enum class Profile { exact, rvt };

/// Three quantities of one name. With h the horizon, not below 0:
enum class Definition {
    solid_angle, ///< mean(1 - sin h): the share of the upper half sphere's solid angle
    horizontal,  ///< mean(cos² h): the share of a uniform sky's light on a horizontal plate
    surface,     ///< the same on the tilted surface, which sees below the horizontal downhill
};

/// The nearest relief is left out, up to this share of the radius: 0, 0.1, 0.2, 0.4; never less than a cell where > 0.
enum class Noise { none, low, medium, high };

enum class Anisotropy { low, high };

/// The directions that count: all of them, or those towards one side.
enum class Sky { whole, north, east, south, west };

/// Local dominance: radii in cells, and the observer's height in the unit of the heights.
struct Dominance {
    int least = 10, most = 20, step = 1; ///< cells
    int angle = 15;                      ///< degrees between directions; profile rvt alone
    double observer = 1.7;
};

struct Settings {
    Profile profile = Profile::exact;
    double radius = 10; ///< in the unit of the cell; profile rvt rounds it to whole cells
    int directions = 16;
    Noise noise = Noise::none;
    double exaggeration = 1; ///< of heights, before anything else
    Definition definition = Definition::solid_angle;
    Sky sky = Sky::whole; ///< of all layers but dominance
    Anisotropy anisotropy = Anisotropy::low;
    double azimuth = 315; ///< degrees clockwise from north, of the anisotropic sky's brightest part. RVT counts it
                          ///< counterclockwise; so does profile rvt
    Dominance dominance;
};

/// Layers to compute.
struct Wanted {
    bool svf = false, asvf = false, openness = false, openness_neg = false, dominance = false, ao = false;
};

/// Profile exact: rounded to 2^-17, openness to 2^-10 degrees. As wide as the field, a row for each that was asked for;
/// those not wanted are empty. NaN where the field has no data, and only there.
struct Layers {
    cv::Mat1f svf;          ///< 0 .. 1
    cv::Mat1f asvf;         ///< anisotropic, of the solid angle: 0 .. 1
    cv::Mat1f openness;     ///< degrees, 0 .. 180; a plane has 90
    cv::Mat1f openness_neg; ///< the same of the field upside down
    cv::Mat1f dominance;    ///< a level plane has 1
    cv::Mat1f ao; ///< visibility as in the rest of scanshade: light on the surface, occluders within a ball of the
                  ///< radius. Of the bilinear surface in both profiles
};

/// Works on all processors (oneTBB). The same field gives the same bits however many there are. Throws Misuse for
/// settings out of range: a radius below one cell or above 4096, directions outside 1 .. 4096, and so on. `rows`: those
/// to compute. Where the field is a part of a larger one, they have the bits of the whole if reach_of() rows of it are
/// known on either side.
[[nodiscard]] Layers layers_of(const HeightField& field, const Settings& settings, const Wanted& wanted,
                               cv::Range rows = cv::Range::all());

[[nodiscard]] int reach_of(double cell, const Settings& settings, const Wanted& wanted);

/// Slopes of the least-squares plane through the known of the 3x3 cells around each: towards the east, towards the
/// north. 0 with fewer than three or those in one line; NaN where the cell is.
struct Slopes {
    cv::Mat1f east, north;
};
[[nodiscard]] Slopes slopes_of(const HeightField& field, double exaggeration = 1);

} // namespace scanshade::horizon
