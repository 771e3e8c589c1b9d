// `developers_bench relief-errors`: whether sky view of generated terrain errs as much as expected.
//
// Each case has mainly one source of error. Its factor in the code is right where found / expected is 1.
#include "tests/bench/relief_errors.h"

#include "apps/lists.h"
#include "apps/relief/maps.h"
#include "apps/relief/surface.h"
#include "tests/bench/part.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <opencv2/imgproc.hpp>
#include <random>

namespace scanshade::bench {
namespace {

constexpr int side = 128; ///< cells of a terrain

const std::array sources = {
    HeightSource{.name = "raster, 0.5 m cells"},
    HeightSource{.name = "raster, 1 m cells", .cell_m = 1},
    HeightSource{.name = "raster, 2 m cells", .cell_m = 2, .radius_cells = 6},
    HeightSource{.name = "20 cells' radius", .radius_cells = 20},
    HeightSource{.name = "8 directions", .directions = 8},
    HeightSource{.name = "noise of 2 cm", .sigma_m = 0.02},
    HeightSource{.name = "noise of 5 cm", .sigma_m = 0.05},
    HeightSource{.name = "noise of 20 cm", .sigma_m = 0.2},
    HeightSource{.name = "whole decimetres", .rounding = 0.1},
    HeightSource{.name = "missing discs", .missing = 12},
    HeightSource{.name = "toolbox's profile", .directions = 16, .profile = horizon::Profile::rvt},
    HeightSource{
        .name = "toolbox's, noise of 5 cm", .sigma_m = 0.05, .directions = 16, .profile = horizon::Profile::rvt},
    HeightSource{.name = "4 points/m2, 3 cm", .sigma_m = 0.03, .density = 4},
    HeightSource{.name = "12 points/m2, 3 cm", .sigma_m = 0.03, .density = 12},
    HeightSource{.name = "1 point/m2, 2 cm", .sigma_m = 0.02, .density = 1},
    HeightSource{.name = "4 points/m2, gaps", .sigma_m = 0.03, .density = 4, .gaps = 14},
    HeightSource{.name = "4 points/m2, unclassified", .sigma_m = 0.03, .density = 4, .classified = false},
};

/// RMS of many cells.
struct Sums {
    double expected = 0, found = 0, count = 0;
    void add(const ErrorPair& pair) {
        expected += double(pair.expected) * pair.expected, found += double(pair.found) * pair.found, ++count;
    }
    [[nodiscard]] double rms_expected() const { return std::sqrt(expected / std::max(count, 1.0)); }
    [[nodiscard]] double rms_found() const { return std::sqrt(found / std::max(count, 1.0)); }
    [[nodiscard]] double ratio() const { return rms_found() / std::max(rms_expected(), 1e-9); }
};

/// Low plants and trees that were not told from ground.
std::vector<Eigen::Vector3d> with_plants(std::vector<Eigen::Vector3d> points, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (Eigen::Vector3d& point : points) {
        const double tree = std::sin(point.x() * 0.4) * std::sin(point.y() * 0.37);
        if (uniform(random) < 0.1)
            point.z() += uniform(random) * 1.5;
        else if (tree > 0.5 && uniform(random) < 0.7)
            point.z() += 3 + 8 * uniform(random);
    }
    return points;
}

relief::Maps maps_of_source(const HeightSource& source, const Terrain& terrain, unsigned seed, int cells) {
    relief::MapSettings settings;
    settings.write = {"svf", "error"};
    settings.walk.radius = source.radius_cells * source.cell_m, settings.walk.directions = source.directions;
    settings.walk.profile = source.profile;
    const double side_m = cells * source.cell_m;
    if (source.density > 0) {
        relief::SurveyPoints survey;
        survey.points =
            scan_of(terrain, side_m, source.density, source.sigma_m, discs_of(side_m, source.gaps, 6, seed), seed + 1);
        if (!source.classified)
            survey.points = with_plants(std::move(survey.points), seed);
        survey.points.emplace_back(1e-3, 1e-3, terrain(0, side_m)); // the whole square
        survey.points.emplace_back(side_m - 1e-3, side_m - 1e-3, terrain(side_m, 0));
        survey.classes.assign(survey.points.size(), source.classified ? 2 : 1);
        survey.ground_classified = source.classified;
        const relief::SurfaceRaster surface =
            relief::surface_of(survey, {.cell_m = source.cell_m, .fill_m = 8, .errors = true});
        relief::SurfaceInMemory reader(surface);
        return relief::maps_of({reader, &reader}, settings);
    }
    std::mt19937 random(seed);
    std::normal_distribution<float> normal(0, static_cast<float>(source.sigma_m));
    rasters::Raster raster{heights_of(terrain, cells, source.cell_m), 0, {}, {}};
    raster.grid.cell = source.cell_m;
    for (float& z : raster.z)
        z += source.sigma_m > 0 ? normal(random) : 0;
    if (source.rounding > 0)
        for (float& z : raster.z)
            z = static_cast<float>(std::round(z / source.rounding) * source.rounding);
    for (const Eigen::Vector3d& disc : discs_of(cells, source.missing, 8, seed))
        cv::circle(raster.z, cv::Point(static_cast<int>(disc.x()), static_cast<int>(disc.y())),
                   static_cast<int>(disc.z()), cv::Scalar(NAN), cv::FILLED);
    settings.height_noise_m = source.sigma_m;
    rasters::MemoryReader reader(raster);
    reader.step = source.rounding;
    return relief::maps_of({reader}, settings);
}

class ReliefErrors final : public Part {
  public:
    Words words() override {
        return {"TERRAIN", fmt::format("generated terrain, of {}", fmt::join(terrain_names(), ",")), &terrains_, 1,
                100};
    }

  private:
    std::vector<Parameter> rows() override { return {{"seeds", "seeds, with commas", &seeds_}}; }

    int measure(const std::string&) override {
        std::vector<ErrorPair> all;
        std::map<std::pair<std::string, std::string>, Sums> of_both;
        for (const std::string& name : terrains_)
            for (const int seed : whole_numbers("seeds", seeds_, 0)) {
                const Terrain terrain = terrain_named(name, static_cast<unsigned>(seed));
                std::map<std::pair<double, double>, cv::Mat1f> truths;
                for (const HeightSource& source : sources) {
                    cv::Mat1f& truth = truths[{source.cell_m, source.radius_cells}];
                    if (truth.empty())
                        truth = true_view(terrain, side, source.cell_m, source.radius_cells * source.cell_m);
                    for (const ErrorPair& pair : errors_of(source, terrain, static_cast<unsigned>(seed), truth)) {
                        all.push_back(pair);
                        of_both[{source.name, name}].add(pair);
                    }
                }
            }
        print_ratios(of_both);
        print_bins(all);
        return all_well;
    }

    /// Found / expected, and found, by source and terrain.
    void print_ratios(const std::map<std::pair<std::string, std::string>, Sums>& of_both) const {
        std::vector<std::string> heads{"source"};
        heads.insert(heads.end(), terrains_.begin(), terrains_.end());
        Table table(heads);
        for (const HeightSource& source : sources) {
            std::vector<std::string> cells{source.name};
            for (const std::string& name : terrains_) {
                const Sums& sums = of_both.at({source.name, name});
                cells.push_back(fmt::format("{:.2f} of {:.4f}", sums.ratio(), sums.rms_expected()));
            }
            table.row(cells);
        }
    }

    static void print_bins(std::vector<ErrorPair>& pairs) {
        std::ranges::sort(pairs, {}, &ErrorPair::expected);
        constexpr std::size_t bins = 8;
        Table table({"expected from", "expected", "found", "found / expected"});
        for (std::size_t bin = 0; bin < bins; ++bin) {
            Sums sums;
            for (std::size_t i = pairs.size() * bin / bins; i < pairs.size() * (bin + 1) / bins; ++i)
                sums.add(pairs[i]);
            table.row({fmt::format("{:.4f}", pairs[pairs.size() * bin / bins].expected),
                       fmt::format("{:.4f}", sums.rms_expected()), fmt::format("{:.4f}", sums.rms_found()),
                       fmt::format("{:.2f}", sums.ratio())});
        }
    }

    std::vector<std::string> terrains_;
    std::string seeds_ = "1,2";
};

} // namespace

std::vector<ErrorPair> errors_of(const HeightSource& source, const Terrain& terrain, unsigned seed,
                                 const cv::Mat1f& truth) {
    const relief::Maps maps = maps_of_source(source, terrain, seed, truth.rows);
    const cv::Mat1f svf = maps[0].values, error = maps[1].values;
    std::vector<ErrorPair> pairs;
    for (int r = 0; r < std::min(truth.rows, svf.rows); ++r)
        for (int c = 0; c < std::min(truth.cols, svf.cols); ++c)
            if (!std::isnan(svf(r, c)))
                pairs.push_back({error(r, c), svf(r, c) - truth(r, c)});
    return pairs;
}

double ratio_of(const std::vector<ErrorPair>& pairs) {
    Sums sums;
    for (const ErrorPair& pair : pairs)
        sums.add(pair);
    return sums.ratio();
}

std::unique_ptr<Command> relief_errors_part() { return std::make_unique<ReliefErrors>(); }

} // namespace scanshade::bench
