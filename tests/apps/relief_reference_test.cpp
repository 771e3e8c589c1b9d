// Height fields beside the outputs of the Relief Visualization Toolbox, and dense rays: the folder relief beside the
// one that SCANSHADE_FIXTURES names.
#include "ao/horizon/horizon.h"
#include "ao/horizon/view_error.h"
#include "apps/relief/maps.h"
#include "apps/relief/surface.h"
#include "io/rasters/raster.h"
#include "io/text.h"

#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

fs::path fixtures() {
    const char* named = std::getenv("SCANSHADE_FIXTURES");
    return named && *named ? fs::path(named).parent_path() / "relief" : fs::path("SCANSHADE_FIXTURES is not set");
}

#define NEEDS_FIXTURES()                                                                                               \
    if (!fs::exists(fixtures() / "cases.json"))                                                                        \
    GTEST_SKIP() << "no recorded maps: SCANSHADE_FIXTURES names the folder beside theirs"

json cases() { return json::parse(read_bytes(fixtures() / "cases.json")); }

horizon::HeightField field_of(const fs::path& file) {
    const rasters::Raster raster = rasters::read_raster(file);
    return {raster.z, raster.grid.cell * raster.grid.crs.unit_m};
}

horizon::Settings settings_of(const json& row) {
    horizon::Settings settings;
    settings.profile = row.at("profile") == "rvt" ? horizon::Profile::rvt : horizon::Profile::exact;
    settings.radius = row.value("radius", 10.0);
    settings.directions = row.value("directions", 64);
    settings.noise = static_cast<horizon::Noise>(row.value("noise", 0));
    settings.exaggeration = row.value("exaggeration", 1.0);
    return settings;
}

/// The layer of a band's name.
cv::Mat1f layer_named(const std::string& name, const horizon::HeightField& field, horizon::Settings settings) {
    using namespace horizon;
    if (name == "svf_horizontal")
        settings.definition = Definition::horizontal;
    if (name == "svf_surface")
        settings.definition = Definition::surface;
    if (name == "asvf_high")
        settings.anisotropy = Anisotropy::high;
    if (name.starts_with("svf"))
        return layers_of(field, settings, {.svf = true}).svf;
    if (name.starts_with("asvf"))
        return layers_of(field, settings, {.asvf = true}).asvf;
    if (name == "openness")
        return layers_of(field, settings, {.openness = true}).openness;
    if (name == "openness_neg")
        return layers_of(field, settings, {.openness_neg = true}).openness_neg;
    return layers_of(field, settings, {.ao = true}).ao;
}

struct Difference {
    double rmse = 0, worst = 0, bias = 0;
    int cells = 0, holes_differ = 0;
};

Difference difference(const cv::Mat1f& map, const cv::Mat1f& reference, int margin) {
    Difference d;
    for (int r = 0; r < map.rows; ++r)
        for (int c = 0; c < map.cols; ++c)
            d.holes_differ += std::isnan(map(r, c)) != std::isnan(reference(r, c));
    for (int r = margin; r < map.rows - margin; ++r)
        for (int c = margin; c < map.cols - margin; ++c)
            if (const double e = double(map(r, c)) - reference(r, c); !std::isnan(e)) {
                d.rmse += e * e, d.bias += e, d.worst = std::max(d.worst, std::abs(e));
                ++d.cells;
            }
    if (d.cells > 0)
        d.rmse = std::sqrt(d.rmse / d.cells), d.bias /= d.cells;
    return d;
}

bool in_degrees(const std::string& band) { return band.starts_with("openness"); }

/// 1e-5, of radians for angles, and half a step of what the fixtures are rounded to: 2^-20, and 2^-13 degrees.
TEST(ReliefReference, profile_rvt_is_the_toolbox) {
    NEEDS_FIXTURES();
    int compared = 0;
    for (const json& row : cases()) {
        if (row.at("profile") != "rvt")
            continue;
        const horizon::HeightField field = field_of(fixtures() / row.at("dem"));
        int band = 0;
        for (const std::string name : row.at("bands")) {
            const cv::Mat1f reference = rasters::read_raster(fixtures() / row.at("reference"), ++band).z;
            const Difference d = difference(layer_named(name, field, settings_of(row)), reference, 0);
            const double limit = in_degrees(name) ? 1e-5 * 180 / CV_PI + std::ldexp(1, -14) : 1e-5;
            EXPECT_LE(d.worst, limit) << row.at("name") << " " << name;
            EXPECT_EQ(d.holes_differ, 0) << row.at("name") << " " << name;
            ++compared;
        }
    }
    EXPECT_GE(compared, 100);
}

/// Cities: steps of a building's height within a cell, where the number of directions counts.
bool is_built(const std::string& dem) {
    return dem.find("wall") != std::string::npos || dem.find("canyon") != std::string::npos;
}

TEST(ReliefReference, profile_exact_is_dense_rays) {
    NEEDS_FIXTURES();
    std::map<std::string, double> worst;
    for (const json& row : cases()) {
        if (row.at("profile") != "exact" || !row.contains("dem"))
            continue;
        const horizon::HeightField field = field_of(fixtures() / row.at("dem"));
        int band = 0;
        for (const std::string name : row.at("bands")) {
            const cv::Mat1f reference = rasters::read_raster(fixtures() / row.at("reference"), ++band).z;
            const bool whole = row.at("margin").get<int>() * 2 >= field.z.rows; // R beyond the raster
            const Difference d = difference(layer_named(name, field, settings_of(row)), reference,
                                            whole ? 0 : row.at("margin").get<int>());
            const double limit = (is_built(row.at("dem")) ? 0.004 : 0.002) * (in_degrees(name) ? 90 : 1);
            EXPECT_LE(d.rmse, limit) << row.at("name") << " " << name << ", worst " << d.worst << ", bias " << d.bias;
            EXPECT_EQ(d.holes_differ, 0) << row.at("name") << " " << name;
            if (std::getenv("RELIEF_TABLE"))
                fmt::print("{:32} {:15} rmse {:.5f} bias {:+.5f} worst {:.4f} cells {}\n",
                           row.at("name").get<std::string>(), name, d.rmse, d.bias, d.worst, d.cells);
        }
    }
}

TEST(ReliefReference, local_dominance_is_the_toolbox_and_dense_rays) {
    NEEDS_FIXTURES();
    for (const json& row : cases()) {
        if (row.at("profile") != "dominance")
            continue;
        const horizon::HeightField field = field_of(fixtures() / row.at("dem"));
        horizon::Settings settings;
        const auto& d = row.at("dominance");
        settings.dominance = {d[0], d[1], d[2], d[3], d[4]};
        settings.directions = 256; // each radius is looked at in as many places
        const auto compared = [&](horizon::Profile profile, int band, int margin) {
            settings.profile = profile;
            return difference(layers_of(field, settings, {.dominance = true}).dominance,
                              rasters::read_raster(fixtures() / row.at("reference"), band).z, margin);
        };
        const Difference rvt = compared(horizon::Profile::rvt, 1, 0),
                         truth = compared(horizon::Profile::exact, 2, row.at("margin"));
        EXPECT_LE(rvt.worst, 1e-5) << row.at("name");
        EXPECT_LE(truth.rmse, 0.002) << row.at("name");
        EXPECT_EQ(rvt.holes_differ, 0);
    }
}

/// The same heights in other files: every layout, area and point, integers with a scale, feet.
TEST(ReliefReference, the_same_terrain_in_any_file_has_the_same_view) {
    NEEDS_FIXTURES();
    horizon::Settings settings;
    settings.radius = 5;
    const auto view = [&](const std::string& name) {
        const rasters::Raster raster = rasters::read_raster(fixtures() / "dem" / name);
        return horizon::layers_of({raster.z, raster.grid.cell}, relief::in_units_of(raster.grid, settings),
                                  {.svf = true})
            .svf;
    };
    const cv::Mat1f terrain = view("terrain.tif"), holes = view("terrain_holes_nan.tif");
    for (const char* name : {"terrain_big_endian.tif", "terrain_bigtiff.tif", "terrain_cog.tif", "terrain_point.tif",
                             "terrain_tiled_lzw.tif", "terrain_tiepoint_inside.tif", "terrain_transformation.tif",
                             "terrain_half_offset.tif", "no_crs.tif", "terrain_two.vrt"})
        EXPECT_EQ(difference(view(name), terrain, 0).worst, 0) << name;
    for (const char* name : {"terrain_us_feet.tif", "terrain_feet_z_metres.tif"}) // heights rounded in feet
        EXPECT_LT(difference(view(name), terrain, 0).worst, 2e-4) << name;
    EXPECT_LT(difference(view("terrain_int16_cm.tif"), terrain, 0).rmse, 0.005); // heights of whole centimetres
    for (const char* name : {"terrain_holes_9999.tif", "terrain_holes_huge.tif"}) {
        EXPECT_EQ(difference(view(name), holes, 0).worst, 0) << name;
        EXPECT_EQ(difference(view(name), holes, 0).holes_differ, 0) << name;
    }
    const rasters::Grid area = rasters::read_raster(fixtures() / "dem" / "terrain.tif").grid;
    for (const char* name : {"terrain_point.tif", "terrain_tiepoint_inside.tif", "terrain_transformation.tif"}) {
        const rasters::Grid grid = rasters::read_raster(fixtures() / "dem" / name).grid;
        EXPECT_EQ(grid.x0, area.x0) << name;
        EXPECT_EQ(grid.y0, area.y0) << name;
    }
}

/// A value at the edge of two bytes may fall on either side, as it is rounded to 1e-5.
TEST(ReliefReference, bytes_are_those_of_the_toolbox) {
    NEEDS_FIXTURES();
    const horizon::HeightField field = field_of(fixtures() / "dem/tm1_crop.tif");
    horizon::Settings settings;
    settings.profile = horizon::Profile::rvt;
    const horizon::Layers layers = horizon::layers_of(field, settings, {true, true, true, true, true, false});
    const auto compared = [&](const cv::Mat1f& map, const std::string& layer) {
        const cv::Mat1b bytes = relief::stretched(map, layer);
        const cv::Mat1f reference = rasters::read_raster(fixtures() / "rvt_names" /
                                                         relief::map_file_name("tm1_crop", layer, settings, 10, true))
                                        .z;
        int other = 0;
        for (int r = 0; r < bytes.rows; ++r)
            for (int c = 0; c < bytes.cols; ++c) {
                EXPECT_LE(std::abs(bytes(r, c) - reference(r, c)), 1) << layer << " " << r << " " << c;
                other += static_cast<float>(bytes(r, c)) != reference(r, c);
            }
        EXPECT_LE(other, 30) << layer;
    };
    compared(layers.svf, "svf"), compared(layers.asvf, "asvf"), compared(layers.openness, "openness");
    compared(layers.openness_neg, "openness-neg"), compared(layers.dominance, "dominance");
}

/// Ground of points with 3 cm of noise, where cells are no holes: a TIN of all ground points is 0.024 m off.
TEST(ReliefReference, ground_of_points_is_the_true_ground) {
    NEEDS_FIXTURES();
    for (const json& row : cases()) {
        if (!row.contains("cloud"))
            continue;
        std::vector<fs::path> files;
        for (const std::string file : row.at("cloud"))
            files.push_back(fixtures() / file);
        const relief::SurveyPoints survey = relief::read_survey(files);
        const relief::SurfaceRaster surface =
            relief::surface_of(survey, {.cell_m = row.at("cell").get<double>(), .errors = true});
        const fs::path truth = fixtures() / row.at("reference");
        const rasters::Raster dtm = rasters::read_raster(truth, 1);
        const rasters::Grid& grid = surface.raster.grid;
        ASSERT_EQ(surface.raster.z.size(), dtm.z.size());
        EXPECT_NEAR(grid.x0, dtm.grid.x0, 1e-6);
        EXPECT_NEAR(grid.y0, dtm.grid.y0, 1e-6);
        EXPECT_EQ(grid.crs.epsg, dtm.grid.crs.epsg);
        EXPECT_NEAR(grid.crs.unit_m, row.at("unit").get<double>(), 1e-12);
        const cv::Mat1f mask = rasters::read_raster(truth, 10).z;
        const int margin = row.at("margin");
        cv::Mat1f heights = surface.raster.z.clone(), true_heights = dtm.z.clone();
        true_heights.setTo(NAN, mask != 0);
        for (float& height : heights)
            height = static_cast<float>((double(height) + surface.raster.base) * grid.crs.height_unit_m);
        const Difference height = difference(heights, true_heights, margin);
        horizon::Settings settings;
        settings.radius = row.at("radius");
        settings.directions = 32;
        const horizon::Layers layers = horizon::layers_of(
            {surface.raster.z, grid.cell}, relief::in_units_of(grid, settings), {.svf = true, .ao = true});
        const auto outside_holes_rms = [&](const cv::Mat1f& error) {
            cv::Mat1f zero(error.size(), 0.0F);
            zero.setTo(NAN, mask != 0);
            return difference(error, zero, margin).rmse;
        };
        const auto outside_holes = [&](const cv::Mat1f& map, int band) {
            cv::Mat1f reference = rasters::read_raster(truth, band).z;
            reference.setTo(NAN, mask != 0);
            return difference(map, reference, margin);
        };
        const cv::Mat1f error =
            horizon::svf_error_of({surface.raster.z, grid.cell}, relief::in_units_of(grid, settings), surface.errors,
                                  {0, surface.raster.z.rows});
        const double expected = outside_holes_rms(error);
        const Difference svf = outside_holes(layers.svf, 2), ao = outside_holes(layers.ao, 9);
        if (std::getenv("RELIEF_TABLE"))
            fmt::print("{}: heights {:.4f} m (bias {:+.4f}), svf {:.4f} (expected {:.4f}), ao {:.4f}\n",
                       row.at("name").get<std::string>(), height.rmse, height.bias, svf.rmse, expected, ao.rmse);
        const bool classed = row.at("classed");
        EXPECT_LT(height.rmse, classed ? 0.03 : 0.06) << row.at("name");
        EXPECT_NEAR(svf.rmse / expected, 1, 0.25) << row.at("name");
        EXPECT_LT(svf.rmse, classed ? 0.017 : 0.045) << row.at("name");
        EXPECT_LT(ao.rmse, classed ? 0.005 : 0.04) << row.at("name");
    }
}

} // namespace
} // namespace scanshade
