// `scanshade relief`: DEMs, or points of a survey, become rasters of sky view, openness, dominance and AO.
#include "apps/command.h"
#include "apps/lists.h"
#include "apps/relief/maps.h"
#include "apps/relief/surface.h"
#include "io/clouds/format.h"
#include "io/files.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/nearest_word.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <set>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace relief;

constexpr std::array profile_words{Named{"exact", horizon::Profile::exact}, Named{"rvt", horizon::Profile::rvt}};
constexpr std::array definition_words{Named{"solid-angle", horizon::Definition::solid_angle},
                                      Named{"horizontal", horizon::Definition::horizontal},
                                      Named{"surface", horizon::Definition::surface}};
constexpr std::array noise_words{Named{"none", horizon::Noise::none}, Named{"low", horizon::Noise::low},
                                 Named{"medium", horizon::Noise::medium}, Named{"high", horizon::Noise::high}};
constexpr std::array level_words{Named{"low", horizon::Anisotropy::low}, Named{"high", horizon::Anisotropy::high}};
constexpr std::array surface_words{Named{"ground", Surface::ground}, Named{"top", Surface::top},
                                   Named{"all", Surface::all}};

/// Up to its first dot, as the toolbox names results.
std::string name_of(const fs::path& file) {
    const std::string name = file.filename().string();
    return name.substr(0, name.find('.'));
}

/// Files of points are one survey; each raster is a map of its own.
struct Inputs {
    std::vector<fs::path> rasters, clouds;
};

void add_input(Inputs& inputs, const fs::path& path, bool must_be) {
    if (rasters::is_tiff(path) || (must_be && lower_extension(path) == ".vrt"))
        inputs.rasters.push_back(path);
    else if (has_cloud_extension(path))
        inputs.clouds.push_back(path);
    else if (must_be)
        throw Error(path.string() + ": neither a TIFF nor a cloud");
}

Inputs inputs_of(const std::vector<std::string>& paths) {
    Inputs inputs;
    for (const fs::path path : paths) {
        if (!is_folder(path)) {
            if (!is_there(path))
                throw Error(path.string() + ": no such file");
            add_input(inputs, path, true);
            continue;
        }
        std::error_code trouble;
        std::set<std::string> names; // in order
        for (const FolderItem& item : items_in(path, trouble))
            if (item.kind == FolderItem::Kind::file)
                names.insert(item.name);
        if (trouble)
            fail_to_read(path, trouble);
        for (const std::string& name : names)
            add_input(inputs, path / name, false);
    }
    if (inputs.rasters.empty() && inputs.clouds.empty())
        throw Error(fmt::format("{}: no TIFF and no cloud in it", fmt::join(paths, ", ")));
    return inputs;
}

class Relief final : public Command {
  public:
    Words words() override {
        return {"INPUT",
                "GeoTIFFs of heights, each a map of its own; or LAS, LAZ and other clouds, together one survey; or "
                "folders of them",
                &paths_, 1, 1 << 20};
    }

    std::vector<Stage> stages() override {
        horizon::Settings& walk = settings_.walk;
        return {
            {"input",
             {{.name = "surface",
               .help = "which points make the surface: classified ground, the highest of each cell, or the mean of all",
               .value = OneOf(&surface_.surface, surface_words),
               .common = true},
              {.name = "cell",
               .help = "size of cells of a survey; 0: about a point each",
               .value = &surface_.cell_m,
               .unit = "m",
               .low = 0,
               .common = true},
              {.name = "fill",
               .help = "cells without points take heights from around, if the nearest is no farther; 0: 3 m or 6 cells",
               .value = &surface_.fill_m,
               .unit = "m",
               .low = 0},
              {.name = "band",
               .help = "band of a raster that has the heights; 0: the only one",
               .value = &band_,
               .low = 0,
               .high = 65535}}},
            {"maps",
             {{.name = "write",
               .help =
                   fmt::format("maps to write, of {}; 8bit: each also stretched to bytes", fmt::join(map_names(), ",")),
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
               .value = &dominance_}}},
            {"output",
             {{.name = "out", .help = "folder of the maps", .value = &out_, .common = true, .writes = Writes::folder},
              {.name = "overwrite", .help = "replace earlier maps", .value = &overwrite_},
              {.name = "quiet", .help = "prints only failures", .value = &quiet_}}}};
    }

    int run() override {
        if (out_.empty())
            throw Misuse("relief needs -o FOLDER for the maps");
        take_lists();
        const Inputs inputs = inputs_of(paths_);
        std::size_t failed = 0, done = 0;
        const auto attempt = [&](const auto& action) {
            try {
                action();
                ++done;
            } catch (const Misuse&) {
                throw;
            } catch (const Outage&) {
                throw;
            } catch (const Error& failure) {
                fmt::print(stderr, "scanshade: {}\n", failure.what());
                ++failed;
            }
        };
        for (const fs::path& file : inputs.rasters)
            attempt([&] { map_raster(file); });
        if (!inputs.clouds.empty())
            attempt([&] { map_survey(inputs.clouds); });
        return failed == 0 ? all_well : done == 0 ? nothing_done : some_failed;
    }

  private:
    void take_lists() {
        settings_.write.clear();
        for (const std::string& word : comma_separated(write_))
            if (word == "8bit")
                settings_.bytes = true;
            else if (std::ranges::find(map_names(), word) == map_names().end())
                throw Misuse(fmt::format("--write {}: no such map{}", word, suggestion(word, map_names())));
            else if (std::ranges::find(settings_.write, word) == settings_.write.end())
                settings_.write.push_back(word);
        if (settings_.write.empty())
            throw Misuse("--write names no map");
        const std::vector<double> d = numbers("dominance", dominance_, 0);
        const auto whole = [](double value) { return value == std::floor(value) && value <= 4096; };
        if (d.size() != 5 || !std::all_of(d.begin(), d.begin() + 4, whole))
            throw Misuse(fmt::format(
                "--dominance {}: expected five numbers such as 10,20,1,15,1.7, the first four whole", dominance_));
        settings_.walk.dominance = {static_cast<int>(d[0]), static_cast<int>(d[1]), static_cast<int>(d[2]),
                                    static_cast<int>(d[3]), d[4]};
    }

    void map_raster(const fs::path& file) {
        const Stopwatch stopwatch;
        const rasters::Raster raster = rasters::read_raster(file, band_);
        during(file.string(), [&] { map(name_of(file), file.string(), raster, {}, stopwatch); });
    }

    void map_survey(const std::vector<fs::path>& files) {
        const Stopwatch stopwatch;
        const SurveyPoints survey = read_survey(files);
        for (const std::string& warning : survey.warnings)
            fmt::print(stderr, "{}\n", warning);
        const std::string what =
            files.size() == 1 ? files.front().string() : fmt::format("{} files of points", files.size());
        SurfaceRaster surface = during(what, [&] { return surface_of(survey, surface_); });
        surface.raster.notes.insert(surface.raster.notes.begin(), survey.notes.begin(), survey.notes.end());
        // Many files are named by their folder.
        const std::string name =
            files.size() == 1 ? name_of(files.front()) : name_of(fs::absolute(files.front()).parent_path());
        during(what, [&] { map(name, what, surface.raster, surface.source, stopwatch); });
    }

    void map(const std::string& name, const std::string& what, const rasters::Raster& raster, const cv::Mat1b& source,
             const Stopwatch& stopwatch) {
        for (const fs::path& file : map_files(name, raster.grid, settings_, out_)) {
            if (!written_.insert(file.string()).second)
                throw Error(fmt::format("another input has made {} already", file.string()));
            if (!overwrite_ && is_there(file))
                throw Error(
                    fmt::format("{} exists already: --overwrite replaces it, or choose another folder", file.string()));
        }
        for (const std::string& note : raster.notes)
            fmt::print(stderr, "{}: {}\n", what, note);
        const std::vector<fs::path> files = write_maps(name, raster, source, settings_, out_);
        if (quiet_)
            return;
        fmt::print(stderr, "{}: {} x {} cells of {:.6g} m, {:.2f} s\n", what, raster.z.cols, raster.z.rows,
                   raster.grid.cell * raster.grid.crs.unit_m, stopwatch.seconds());
        for (const fs::path& file : files)
            fmt::print(stderr, "  -> {}\n", file.string());
    }

    std::vector<std::string> paths_;
    std::string out_, write_ = "svf", dominance_ = "10,20,1,15,1.7";
    int band_ = 0;
    bool overwrite_ = false, quiet_ = false;
    MapSettings settings_{.walk = {.radius = 0, .dominance = {}}};
    SurfaceOptions surface_;
    std::set<std::string> written_;
};

} // namespace

std::unique_ptr<Command> relief_command() { return std::make_unique<Relief>(); }

} // namespace scanshade
