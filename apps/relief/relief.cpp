// `scanshade relief`: DEMs, or points of a survey, become rasters of sky view, openness, dominance and AO.
#include "apps/command.h"
#include "apps/relief/points.h"
#include "apps/relief/settings.h"
#include "io/clouds/format.h"
#include "io/files.h"
#include "io/rasters/vrt.h"
#include "io/text.h"
#include "projection/base/error.h"
#include "projection/base/stopwatch.h"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <set>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace relief;

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
        std::vector<Stage> stages = settings_.stages();
        stages.push_back(
            {"output",
             {{.name = "out", .help = "folder of the maps", .value = &out_, .common = true, .writes = Writes::folder},
              {.name = "overwrite", .help = "replace earlier maps", .value = &overwrite_},
              {.name = "quiet", .help = "prints only failures", .value = &quiet_}}});
        return stages;
    }

    int run() override {
        if (out_.empty())
            throw Misuse("relief needs -o FOLDER for the maps");
        settings_.resolve();
        const Inputs inputs = inputs_of(paths_);
        if (settings_.points && inputs.clouds.empty())
            throw Misuse("--write points: no input has points");
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
        if (tiles_.size() > 1)
            attempt([&] { join_tiles(name_of(fs::absolute(inputs.rasters.front()).parent_path())); });
        if (!inputs.clouds.empty())
            attempt([&] { map_survey(inputs.clouds); });
        return failed == 0 ? all_well : done == 0 ? nothing_done : some_failed;
    }

  private:
    void map_raster(const fs::path& file) {
        const Stopwatch stopwatch;
        const std::unique_ptr<rasters::RasterReader> heights = rasters::open_raster(file, settings_.band);
        during(file.string(), [&] {
            claim(map_files(name_of(file), heights->grid, settings_.maps, out_));
            map(name_of(file), file.string(), {*heights, {}}, stopwatch, nullptr);
            tiles_.push_back({name_of(file), heights->size, heights->grid});
            tile_files_.push_back(map_files(name_of(file), heights->grid, settings_.maps, out_));
        });
    }

    void map_survey(const std::vector<fs::path>& files) {
        const Stopwatch stopwatch;
        const std::string what =
            files.size() == 1 ? files.front().string() : fmt::format("{} files of points", files.size());
        // Many files are named by their folder.
        const std::string name =
            files.size() == 1 ? name_of(files.front()) : name_of(fs::absolute(files.front()).parent_path());
        SurfaceOptions options = settings_.surface;
        options.errors = std::ranges::find(settings_.maps.write, "error") != settings_.maps.write.end();
        options.height_noise_m = settings_.maps.height_noise_m;
        SurveyPoints survey;
        const bool fits = read_within(files, survey);
        if (!fits) {
            survey = {};
            const auto heights = during(what, [&] { return open_surface(files, options, survey.warnings); });
            print(survey.warnings);
            during(what, [&] {
                claim(map_files(name, heights->grid, settings_.maps, out_));
                map(name, what, {*heights, heights.get()}, stopwatch, nullptr);
            });
            return;
        }
        print(survey.warnings);
        const SurfaceRaster surface = during(what, [&] { return surface_of(survey, options); });
        SurfaceInMemory heights(surface);
        heights.notes.insert(heights.notes.begin(), survey.notes.begin(), survey.notes.end());
        Maps maps;
        during(what, [&] {
            claim(map_files(name, heights.grid, settings_.maps, out_));
            if (settings_.points)
                claim(point_files(survey, out_));
            map(name, what, {heights, &heights}, stopwatch, settings_.points ? &maps : nullptr);
        });
        if (!settings_.points)
            return;
        write_points(survey, cells_of_points(survey, surface, settings_.surface.surface), maps,
                     point_files(survey, out_));
        report(point_files(survey, out_));
    }

    /// False where the points do not fit into memory, unless they are to be written.
    bool read_within(const std::vector<fs::path>& files, SurveyPoints& survey) const {
        constexpr double bytes_each = 26;
        const double most = settings_.memory_mib * (1 << 20) / bytes_each;
        for (const fs::path& file : files) {
            add_file(survey, file);
            if (!settings_.points && static_cast<double>(survey.points.size()) > most)
                return false;
        }
        finish_notes(survey);
        return true;
    }

    static void print(const std::vector<std::string>& warnings) {
        for (const std::string& warning : warnings)
            fmt::print(stderr, "{}\n", warning);
    }

    /// A virtual raster of each kind of map, where rasters lie on one grid.
    void join_tiles(const std::string& name) {
        if (!rasters::share_a_grid(tiles_))
            return;
        for (std::size_t i = 0; i < tile_files_.front().size(); ++i) {
            const std::string first = tile_files_.front()[i].filename().string();
            if (!first.ends_with(".tif"))
                continue; // svfs.zip
            std::vector<rasters::VrtTile> parts = tiles_;
            for (std::size_t t = 0; t < parts.size(); ++t)
                parts[t].file = tile_files_[t][i];
            const std::string map = first.substr(tiles_.front().file.string().size(),
                                                 first.size() - 4 - tiles_.front().file.string().size());
            const fs::path file = fs::path(out_) / (name + map + ".vrt");
            claim({file});
            rasters::write_vrt(file, parts, map.ends_with("_8bit") || map == "_SOURCE" ? CV_8UC1 : CV_32FC1);
            report({file});
        }
    }

    /// Files to be written, which must be new.
    void claim(const std::vector<fs::path>& files) {
        for (const fs::path& file : files) {
            if (!written_.insert(file.string()).second)
                throw Error(fmt::format("another input has made {} already", file.string()));
            if (!overwrite_ && is_there(file))
                throw Error(
                    fmt::format("{} exists already: --overwrite replaces it, or choose another folder", file.string()));
        }
    }

    void map(const std::string& name, const std::string& what, const Heights& heights, const Stopwatch& stopwatch,
             Maps* kept) {
        const rasters::RasterReader& rows = heights.rows;
        std::size_t printed = 0;
        const auto print_notes = [&] {
            for (; printed < rows.notes.size(); ++printed)
                fmt::print(stderr, "{}: {}\n", what, rows.notes[printed]);
        };
        print_notes();
        const Written written = write_maps(name, heights, settings_.maps, out_, kept);
        print_notes();
        if (written.known == 0)
            fmt::print(stderr, "{}: no cell has a height: the maps are empty\n", what);
        if (!quiet_)
            fmt::print(stderr, "{}: {} x {} cells of {:.6g} m, {:.2f} s\n", what, rows.size.width, rows.size.height,
                       rows.grid.cell * rows.grid.crs.unit_m, stopwatch.seconds());
        report(written.files);
    }

    void report(const std::vector<fs::path>& files) const {
        for (const fs::path& file : files)
            if (!quiet_)
                fmt::print(stderr, "  -> {}\n", file.string());
    }

    std::vector<std::string> paths_;
    std::string out_;
    bool overwrite_ = false, quiet_ = false;
    ReliefSettings settings_;
    std::set<std::string> written_;
    std::vector<rasters::VrtTile> tiles_; ///< rasters that were mapped, by the name of their maps
    std::vector<std::vector<fs::path>> tile_files_;
};

} // namespace

std::unique_ptr<Command> relief_command() { return std::make_unique<Relief>(); }

} // namespace scanshade
