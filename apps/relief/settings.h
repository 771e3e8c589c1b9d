// Settings of relief, as the program's flags and as the library's names.
#pragma once

#include "apps/command.h"
#include "apps/relief/maps.h"
#include "apps/relief/surface.h"

namespace scanshade::relief {

struct ReliefSettings {
    SurfaceOptions surface;
    MapSettings maps{.walk = {.radius = 0, .dominance = {}}};
    int band = 0;             ///< of a raster; 0 = the only one
    bool points = false;      ///< the cloud with values, too
    double memory_mib = 1024; ///< for points of a survey

    /// "input": of files. "maps": what is computed.
    [[nodiscard]] std::vector<Stage> stages();
    /// Takes the lists apart once all rows are set. Throws Misuse naming the flag.
    void resolve();

  private:
    std::string write_ = "svf", dominance_ = "10,20,1,15,1.7";
};

} // namespace scanshade::relief
