#include "apps/relief/maps.h"

#include "ao/horizon/view_error.h"
#include "apps/relief/doubtful_heights.h"
#include "apps/relief/gridding.h"
#include "apps/relief/svfs.h"
#include "projection/base/memory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <tbb/task_group.h>

namespace scanshade::relief {

namespace fs = std::filesystem;
using namespace horizon;

namespace {

/// Before the names of views.
const std::string views_folder = "svfs/";

/// A layer's part of a file name, and its stretch.
struct MapRow {
    std::string_view name;
    float from = 0, to = 1; ///< of 8 bits
    bool inverted = false;
    cv::Mat1f Layers::*layer = nullptr; ///< null: not of the walk
    bool Wanted::*wanted = nullptr;
};

const std::array map_rows = {
    MapRow{"svf", 0.6375F, 1, false, &Layers::svf, &Wanted::svf},
    MapRow{"asvf", 0.7F, 0.9F, false, &Layers::asvf, &Wanted::asvf},
    MapRow{"openness", 60, 95, false, &Layers::openness, &Wanted::openness},
    MapRow{"openness-neg", 60, 95, true, &Layers::openness_neg, &Wanted::openness_neg},
    MapRow{"dominance", 0.5F, 1.8F, false, &Layers::dominance, &Wanted::dominance},
    MapRow{"ao", 0, 1, false, &Layers::ao, &Wanted::ao},
    MapRow{"error"},
    MapRow{"dtm"},
    MapRow{"source"},
};

const MapRow& row_of(const std::string& layer) { return *std::ranges::find(map_rows, layer, &MapRow::name); }

std::string noise_suffix(const std::string& layer, Noise noise) {
    switch (noise) {
    case Noise::none:
        return "";
    case Noise::low:
        return "_NRlow";
    case Noise::medium:
        return "_NRmedium";
    case Noise::high:
        return layer == "openness-neg" ? "_NRstrong" : "_NRhigh"; // as the toolbox has it
    }
    return "";
}

std::string stem_of(const std::string& layer, const Settings& s, double radius) {
    const std::string walk = fmt::format("R{:.6g}_D{}", radius, s.directions);
    if (layer == "svf")
        return "SVF_" + walk;
    if (layer == "error")
        return "SVF_ERROR_" + walk;
    if (layer == "asvf")
        return fmt::format("SVF-A_{}_A{:g}_AL{}", walk, s.azimuth, s.anisotropy == Anisotropy::low ? "low" : "high");
    if (layer == "openness")
        return "OPEN-POS_" + walk;
    if (layer == "openness-neg")
        return "OPEN-NEG_" + walk;
    if (layer == "dominance")
        return fmt::format("LD_R_M{}-{}_DI{}_A{}_OH{:g}", s.dominance.least, s.dominance.most, s.dominance.step,
                           s.dominance.angle, s.dominance.observer);
    if (layer == "ao")
        return fmt::format("AO_R{:.6g}", radius);
    return layer == "dtm" ? "DTM" : "SOURCE";
}

std::string definition_word(Definition definition) {
    return definition == Definition::solid_angle  ? "solid-angle"
           : definition == Definition::horizontal ? "horizontal"
                                                  : "surface";
}

std::string description_of(const std::string& layer, const Settings& s) {
    const std::string rvt = s.profile == Profile::rvt ? " as RVT computes it" : "";
    if (layer == "svf")
        return "sky-view factor, " + definition_word(s.definition) + rvt;
    if (layer == "error")
        return "expected RMSE of the sky-view factor, " + definition_word(s.definition) + rvt;
    if (layer == "asvf")
        return fmt::format("anisotropic sky-view factor, solid angle, brightest at {:g} degrees {} from north{}",
                           s.azimuth, s.profile == Profile::rvt ? "counterclockwise" : "clockwise", rvt);
    if (layer == "openness")
        return "positive openness, degrees" + rvt;
    if (layer == "openness-neg")
        return "negative openness, degrees" + rvt;
    if (layer == "dominance")
        return "local dominance" + rvt;
    if (layer == "ao")
        return "visibility: 1 open, 0 closed; cosine-weighted, occluders within a ball of the radius";
    return layer == "dtm" ? "heights" : "0 no data, 1 measured, 2 interpolated";
}

rasters::RasterText text_of(const std::string& layer, const Settings& s) {
    rasters::RasterText text{description_of(layer, s), {{"SOFTWARE", "scanshade " SCANSHADE_VERSION}}};
    if (layer == "dtm" || layer == "source")
        return text;
    if (layer == "svf" || layer == "error")
        text.items.emplace_back("SVF_DEFINITION", definition_word(s.definition));
    text.items.emplace_back("PROFILE", s.profile == Profile::rvt ? "rvt" : "exact");
    if (layer != "dominance")
        text.items.emplace_back("RADIUS_M", fmt::format("{:g}", s.radius));
    text.items.emplace_back("DIRECTIONS", fmt::format("{}", s.directions));
    text.items.emplace_back("EXAGGERATION", fmt::format("{:g}", s.exaggeration));
    return text;
}

/// What `source` says of a raster: 1 where it has heights.
cv::Mat1b measured_cells(const cv::Mat1f& z) {
    cv::Mat1b measured(z.size());
    std::transform(z.begin(), z.end(), measured.begin(), [](float height) { return std::isnan(height) ? 0 : 1; });
    return measured;
}

/// The radius in metres that is asked for; 10 cells where none is.
Settings with_radius(Settings settings, const rasters::Grid& grid) {
    constexpr double usual_cells = 10;
    if (settings.radius == 0)
        settings.radius = usual_cells * grid.cell * grid.crs.unit_m;
    return settings;
}

double radius_in_cells(const Settings& settings, const rasters::Grid& grid) {
    const double radius = settings.radius / (grid.cell * grid.crs.unit_m);
    return settings.profile == Profile::rvt ? std::nearbyint(radius) : radius;
}

/// The views of svfs.zip are of the horizontal definition.
Settings of_sky(Settings settings, Sky sky) {
    settings.definition = Definition::horizontal;
    settings.sky = sky;
    return settings;
}

int type_of(const std::string& layer) { return layer == "source" ? CV_8UC1 : CV_32FC1; }

Maps empty_maps(const MapSettings& settings, cv::Size size) {
    const auto cells = static_cast<std::uint64_t>(size.width) * static_cast<std::uint64_t>(size.height);
    require_memory(cells * sizeof(float) * settings.write.size(), "the maps");
    Maps maps;
    for (const std::string& layer : settings.write)
        maps.push_back({layer, cv::Mat(size, type_of(layer))});
    return maps;
}

void put(Maps& maps, const std::string& layer, int first, const cv::Mat& rows) {
    rows.copyTo(std::ranges::find(maps, layer, &NamedMap::name)->values.rowRange(first, first + rows.rows));
}

/// Standard deviation of a raster's heights, in the file's unit: as it is set, and by their rounding.
double sigma_of(const rasters::RasterReader& raster, double noise_m) {
    constexpr double alike = 0.75; // roundings of neighbours are: fitted (`developers_bench relief-errors`)
    const double rounding = alike * raster.step / std::sqrt(12.0);
    return std::hypot(noise_m / raster.grid.crs.height_unit_m, rounding);
}

/// Errors of a raster's heights, drawn.
cv::Mat1f drawn_errors(double sigma, int first, cv::Size size) {
    if (sigma == 0)
        return {};
    constexpr unsigned stream = 5;
    cv::Mat1f errors(size);
    for (int r = 0; r < errors.rows; ++r)
        for (int c = 0; c < errors.cols; ++c)
            errors(r, c) = static_cast<float>(sigma) * drawn_error(first + r, c, 0, stream);
    return errors;
}

/// The rows of a raster that a band needs, each read once.
class RowWindow {
  public:
    explicit RowWindow(const Heights& heights) : heights_(heights) {}
    /// Bands follow one another: neither number falls. What is not known of a raster stays empty.
    SurfaceRows rows(int begin, int end) {
        const cv::Size size(heights_.rows.size.width, end - begin);
        SurfaceRows more{cv::Mat1f(size), {}, {}};
        const int from = std::max(begin, end_), kept = std::max(end_ - begin, 0);
        cv::Mat1f z = more.z.rowRange(kept, size.height);
        if (!z.empty())
            heights_.rows.read(from, z);
        take_over(rows_.z, {}, begin, kept, more.z);
        if (const SurfaceReader* surface = heights_.surface) {
            more.source.create(size);
            take_over(rows_.source, z.empty() ? cv::Mat() : cv::Mat(surface->source), begin, kept, more.source);
            if (!surface->errors.empty() || !rows_.errors.empty()) {
                more.errors.create(size);
                take_over(rows_.errors, z.empty() ? cv::Mat() : cv::Mat(surface->errors), begin, kept, more.errors);
            }
        }
        rows_ = more, begin_ = begin, end_ = end;
        return more;
    }

  private:
    void take_over(const cv::Mat& before, const cv::Mat& read, int begin, int kept, const cv::Mat& rows) const {
        if (kept > 0)
            before.rowRange(begin - begin_, end_ - begin_).copyTo(rows.rowRange(0, kept));
        if (!read.empty())
            read.copyTo(rows.rowRange(kept, rows.rows));
    }

    const Heights& heights_;
    SurfaceRows rows_;
    int begin_ = 0, end_ = 0; ///< rows in it
};

/// Bands are written while the next one is read and computed.
class Writing {
  public:
    Writing() = default;
    Writing(const Writing&) = delete;
    Writing& operator=(const Writing&) = delete;
    ~Writing() {
        tasks_.cancel(); // only a failure leaves any
        (void)tasks_.wait();
    }
    template <class Action>
    void add(int band, Action action) {
        if (band != band_)
            wait();
        band_ = band;
        tasks_.run(std::move(action));
    }
    /// Throws what the actions have thrown.
    void wait() { tasks_.wait(); }

  private:
    tbb::task_group tasks_;
    int band_ = -1;
};

} // namespace

const std::vector<std::string>& map_names() {
    static const std::vector<std::string> names = [] {
        std::vector<std::string> all;
        for (const MapRow& row : map_rows)
            all.emplace_back(row.name);
        return all;
    }();
    return names;
}

Settings in_units_of(const rasters::Grid& grid, const Settings& settings) {
    Settings own = settings;
    own.radius /= grid.crs.unit_m;
    own.exaggeration *= grid.crs.height_unit_m / grid.crs.unit_m;
    own.dominance.observer /= grid.crs.unit_m;
    return own;
}

std::string map_file_name(const std::string& name, const std::string& layer, const Settings& settings,
                          double radius_cells, bool bytes) {
    const bool walks = layer == "error" || (row_of(layer).layer != nullptr && layer != "dominance" && layer != "ao");
    return name + "_" + stem_of(layer, settings, radius_cells) + (walks ? noise_suffix(layer, settings.noise) : "") +
           (bytes ? "_8bit" : "") + ".tif";
}

cv::Mat1b stretched(const cv::Mat1f& values, const std::string& layer) {
    const MapRow& row = row_of(layer);
    cv::Mat1b bytes(values.size());
    for (int r = 0; r < values.rows; ++r)
        for (int c = 0; c < values.cols; ++c) {
            float share = std::clamp((values(r, c) - row.from) / (row.to - row.from), 0.0F, 1.0F);
            share = row.inverted ? 1 - share : share;
            bytes(r, c) = std::isnan(values(r, c)) ? 255 : static_cast<std::uint8_t>(std::floor(255.9999F * share));
        }
    return bytes;
}

std::vector<fs::path> map_files(const std::string& name, const rasters::Grid& grid, const MapSettings& settings,
                                const fs::path& folder) {
    const Settings walk = with_radius(settings.walk, grid);
    std::vector<fs::path> files;
    for (const std::string& layer : settings.write) {
        files.push_back(folder / map_file_name(name, layer, walk, radius_in_cells(walk, grid), false));
        if (settings.bytes && row_of(layer).layer)
            files.push_back(folder / map_file_name(name, layer, walk, radius_in_cells(walk, grid), true));
    }
    if (settings.svfs)
        files.push_back(folder / (name + "_svfs.zip"));
    return files;
}

std::int64_t compute_maps(const Heights& heights, const MapSettings& settings, const TakeRows& take, int band_rows) {
    rasters::RasterReader& raster = heights.rows;
    const Settings walk = in_units_of(raster.grid, with_radius(settings.walk, raster.grid));
    Wanted wanted;
    for (const std::string& layer : settings.write)
        if (row_of(layer).wanted)
            wanted.*row_of(layer).wanted = true;
    RowWindow window(heights);
    DoubtfulHeights doubtful;
    const bool error = std::ranges::find(settings.write, "error") != settings.write.end();
    const double sigma = sigma_of(raster, settings.height_noise_m);
    const int reach =
        std::max(reach_of(raster.grid.cell, walk, wanted), error ? error_reach_of(raster.grid.cell, walk) : 0);
    for (int first = 0; first < raster.size.height; first += band_rows) {
        const int last = std::min(first + band_rows, raster.size.height);
        const int begin = std::max(first - reach, 0), end = std::min(last + reach, raster.size.height);
        const SurfaceRows rows = window.rows(begin, end);
        const HeightField field{rows.z, raster.grid.cell};
        const cv::Range own(first - begin, last - begin);
        const cv::Mat1f z = field.z.rowRange(own);
        doubtful.add(z, raster.base);
        const Layers layers = layers_of(field, walk, wanted, own);
        for (const std::string& layer : settings.write)
            if (const MapRow& row = row_of(layer); row.layer)
                take(layer, first, layers.*row.layer);
            else if (layer == "error")
                take(layer, first,
                     svf_error_of(field, walk,
                                  heights.surface ? rows.errors : drawn_errors(sigma, begin, field.z.size()), own,
                                  begin));
            else if (layer == "dtm")
                take(layer, first, raster.base == 0 ? cv::Mat(z) : cv::Mat(z + raster.base));
            else
                take(layer, first, heights.surface ? rows.source.rowRange(own) : measured_cells(z));
        for (std::size_t i = 0; settings.svfs && i < svfs_views().size(); ++i)
            take(views_folder + svfs_views()[i].name, first,
                 layers_of(field, of_sky(walk, svfs_views()[i].sky), {.svf = true}, own).svf);
    }
    std::ranges::move(doubtful.notes(), std::back_inserter(raster.notes));
    return doubtful.known();
}

Maps maps_of(const Heights& heights, const MapSettings& settings) {
    Maps maps = empty_maps(settings, heights.rows.size);
    compute_maps(heights, settings,
                 [&](const std::string& layer, int first, const cv::Mat& rows) { put(maps, layer, first, rows); });
    return maps;
}

Written write_maps(const std::string& name, const Heights& heights, const MapSettings& settings, const fs::path& folder,
                   Maps* kept) {
    const rasters::Grid& grid = heights.rows.grid;
    const Settings walk = with_radius(settings.walk, grid);
    struct Output {
        std::string layer;
        bool bytes = false;
        rasters::RasterWriter writer;
    };
    std::vector<Output> outputs;
    std::vector<fs::path> files = map_files(name, grid, settings, folder);
    auto file = files.begin();
    const auto add = [&](const std::string& layer, bool bytes) {
        const bool nearest = layer == "source";
        outputs.push_back({layer, bytes,
                           rasters::RasterWriter(*file++, heights.rows.size, bytes ? CV_8UC1 : type_of(layer), grid,
                                                 text_of(layer, walk),
                                                 nearest ? rasters::Overviews::nearest : rasters::Overviews::mean)});
    };
    for (const std::string& layer : settings.write) {
        add(layer, false);
        if (settings.bytes && row_of(layer).layer)
            add(layer, true);
    }
    std::optional<SvfsZip> zip;
    if (settings.svfs)
        zip.emplace(*file, heights.rows.size, grid, text_of("svf", of_sky(walk, Sky::whole)));
    if (kept)
        *kept = empty_maps(settings, heights.rows.size);
    Writing writing;
    const std::int64_t known =
        compute_maps(heights, settings, [&](const std::string& layer, int first, const cv::Mat& rows) {
            for (std::size_t i = 0; zip && i < svfs_views().size(); ++i)
                if (layer == views_folder + svfs_views()[i].name)
                    return zip->write(i, rows);
            for (Output& output : outputs)
                if (output.layer == layer)
                    writing.add(first, [&output, rows] {
                        output.writer.write(output.bytes ? cv::Mat(stretched(rows, output.layer)) : rows);
                    });
            if (kept)
                put(*kept, layer, first, rows);
        });
    writing.wait();
    for (Output& output : outputs)
        output.writer.finish();
    if (zip)
        zip->finish();
    return {std::move(files), known};
}

} // namespace scanshade::relief
