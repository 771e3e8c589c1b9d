// Height fields beside the outputs of the Relief Visualization Toolbox, and dense rays: the folder relief beside the
// one that SCANSHADE_FIXTURES names.
#include "ao/horizon/horizon.h"
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

} // namespace
} // namespace scanshade
