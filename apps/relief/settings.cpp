#include "apps/relief/settings.h"

#include "apps/lists.h"
#include "projection/base/error.h"
#include "projection/base/nearest_word.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace scanshade::relief {

namespace {

constexpr std::array profile_words{Named{"exact", horizon::Profile::exact}, Named{"rvt", horizon::Profile::rvt}};
constexpr std::array definition_words{Named{"solid-angle", horizon::Definition::solid_angle},
                                      Named{"horizontal", horizon::Definition::horizontal},
                                      Named{"surface", horizon::Definition::surface}};
constexpr std::array noise_words{Named{"none", horizon::Noise::none}, Named{"low", horizon::Noise::low},
                                 Named{"medium", horizon::Noise::medium}, Named{"high", horizon::Noise::high}};
constexpr std::array level_words{Named{"low", horizon::Anisotropy::low}, Named{"high", horizon::Anisotropy::high}};
constexpr std::array surface_words{Named{"ground", Surface::ground}, Named{"top", Surface::top},
                                   Named{"all", Surface::all}};

} // namespace

std::vector<Stage> ReliefSettings::stages() {
    horizon::Settings& walk = maps.walk;
    return {{"input",
             {{.name = "surface",
               .help = "which points make the surface: classified ground, the highest of each cell, or the mean of all",
               .value = OneOf(&surface.surface, surface_words),
               .common = true},
              {.name = "cell",
               .help = "size of cells of a survey; 0: about a point each",
               .value = &surface.cell_m,
               .unit = "m",
               .low = 0,
               .common = true},
              {.name = "fill",
               .help = "cells without points take heights from around, if the nearest is no farther; 0: 3 m or 6 cells",
               .value = &surface.fill_m,
               .unit = "m",
               .low = 0},
              {.name = "memory",
               .help = "for points of a survey; larger ones are read twice, some files at a time",
               .value = &memory_mib,
               .unit = "MiB",
               .low = 0},
              {.name = "band",
               .help = "band of a raster that has the heights; 0: the only one",
               .value = &band,
               .low = 0,
               .high = 65535}}},
            {"maps",
             {{.name = "write",
               .help = fmt::format("maps to write, of {}; 8bit: each also stretched to bytes; points: the cloud with "
                                   "the values of its cells; svfs: a zip for SOLWEIG and UMEP",
                                   fmt::join(map_names(), ",")),
               .value = &write_,
               .common = true},
              {.name = "radius",
               .help = "how far a cell looks; 0: 10 cells",
               .value = &walk.radius,
               .unit = "m",
               .low = 0,
               .common = true},
              {.name = "directions",
               .help = "directions of a cell",
               .value = &walk.directions,
               .low = 4,
               .high = 1024,
               .common = true},
              {.name = "definition",
               .help = "of the sky-view factor: share of the solid angle, light on a horizontal plate, or light on the "
                       "surface",
               .value = OneOf(&walk.definition, definition_words),
               .common = true},
              {.name = "profile",
               .help = "exact: horizons on the bilinear surface; rvt: the cells, roundings and borders of the Relief "
                       "Visualization Toolbox",
               .value = OneOf(&walk.profile, profile_words),
               .common = true},
              {.name = "noise",
               .help = "leaves out the nearest 0, 10, 20 or 40 % of the radius",
               .value = OneOf(&walk.noise, noise_words)},
              {.name = "height-noise",
               .help = "sigma of heights, for expected errors; 0: the rounding of rasters, and what points of a cell "
                       "differ by",
               .value = &maps.height_noise_m,
               .unit = "m",
               .low = 0},
              {.name = "exaggeration",
               .help = "factor of heights",
               .value = &walk.exaggeration,
               .low = 0.001,
               .high = 1000},
              {.name = "asvf-level",
               .help = "how uneven the anisotropic sky is",
               .value = OneOf(&walk.anisotropy, level_words)},
              {.name = "asvf-azimuth",
               .help = "of its brightest part, clockwise from north",
               .value = &walk.azimuth,
               .unit = "degrees",
               .low = 0,
               .high = 360},
              {.name = "dominance",
               .help = "local dominance: least radius, largest, and step, in cells; degrees between directions (rvt); "
                       "observer's height in m",
               .value = &dominance_}}}};
}

void ReliefSettings::resolve() {
    maps.write.clear();
    for (const std::string& word : comma_separated(write_))
        if (word == "8bit")
            maps.bytes = true;
        else if (word == "points")
            points = true;
        else if (word == "svfs")
            maps.svfs = true;
        else if (std::ranges::find(map_names(), word) == map_names().end())
            throw Misuse(fmt::format("--write {}: no such map{}", word, suggestion(word, map_names())));
        else if (std::ranges::find(maps.write, word) == maps.write.end())
            maps.write.push_back(word);
    if (maps.write.empty() && (points || !maps.svfs))
        throw Misuse(points ? "--write points: name the maps, too, whose values the points get"
                            : "--write names no map");
    const std::vector<double> d = numbers("dominance", dominance_, 0);
    const auto whole = [](double value) { return value == std::floor(value) && value <= 4096; };
    if (d.size() != 5 || !std::all_of(d.begin(), d.begin() + 4, whole))
        throw Misuse(fmt::format("--dominance {}: expected five numbers such as 10,20,1,15,1.7, the first four whole",
                                 dominance_));
    maps.walk.dominance = {static_cast<int>(d[0]), static_cast<int>(d[1]), static_cast<int>(d[2]),
                           static_cast<int>(d[3]), d[4]};
}

} // namespace scanshade::relief
