// `scanshade relief`: names, stretches and units of maps, surfaces of points, and the program on files.
#include "apps/command.h"
#include "apps/relief/ground_filter.h"
#include "apps/relief/maps.h"
#include "apps/relief/surface.h"
#include "io/clouds/cloud_file.h"
#include "tests/support/files.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <random>

namespace scanshade::relief {
namespace {

namespace fs = std::filesystem;
using tests::refusal;
using tests::says;

/// What the toolbox calls its results.
TEST(Relief, maps_are_named_as_the_toolbox_names_them) {
    horizon::Settings s;
    const auto name = [&](const char* layer, bool bytes) { return map_file_name("dem", layer, s, 10, bytes); };
    EXPECT_EQ(name("svf", false), "dem_SVF_R10_D16.tif");
    EXPECT_EQ(name("svf", true), "dem_SVF_R10_D16_8bit.tif");
    EXPECT_EQ(name("asvf", false), "dem_SVF-A_R10_D16_A315_ALlow.tif");
    EXPECT_EQ(name("dominance", true), "dem_LD_R_M10-20_DI1_A15_OH1.7_8bit.tif");
    EXPECT_EQ(name("ao", false), "dem_AO_R10.tif");
    s.noise = horizon::Noise::high;
    EXPECT_EQ(name("openness", false), "dem_OPEN-POS_R10_D16_NRhigh.tif");
    EXPECT_EQ(name("openness-neg", true), "dem_OPEN-NEG_R10_D16_NRstrong_8bit.tif");
    EXPECT_EQ(name("asvf", false), "dem_SVF-A_R10_D16_A315_ALlow_NRhigh.tif");
    EXPECT_EQ(name("dominance", false), "dem_LD_R_M10-20_DI1_A15_OH1.7.tif");
}

TEST(Relief, stretches_reach_both_ends_and_unknown_is_255) {
    const cv::Mat1f svf = (cv::Mat1f(1, 4) << 0.5, 0.6375, 1, NAN);
    const cv::Mat1b bytes = stretched(svf, "svf");
    EXPECT_EQ(cv::norm(bytes, cv::Mat1b((cv::Mat1b(1, 4) << 0, 0, 255, 255)), cv::NORM_INF), 0);
    const cv::Mat1f degrees = (cv::Mat1f(1, 3) << 50, 77.5, 95);
    const cv::Mat1b inverted = stretched(degrees, "openness-neg");
    EXPECT_EQ(cv::norm(inverted, cv::Mat1b((cv::Mat1b(1, 3) << 255, 127, 0)), cv::NORM_INF), 0);
}

rasters::Crs crs_with(std::initializer_list<std::pair<int, int>> values) {
    rasters::GeoKeys keys;
    for (const auto& [key, value] : values)
        keys = rasters::with_value(std::move(keys), key, value);
    return rasters::crs_of_keys(std::move(keys));
}

TEST(Relief, radii_are_metres_and_heights_come_to_the_unit_of_the_plane) {
    rasters::Grid grid;
    grid.cell = 2;
    grid.crs = crs_with({{1024, 1}, {1025, 1}, {3072, 2264}, {4096, 5703}}); // US survey feet, heights in metres
    horizon::Settings settings;
    settings.radius = 10;
    const horizon::Settings own = in_units_of(grid, settings);
    const double foot = 1200.0 / 3937;
    EXPECT_NEAR(own.radius, 10 / foot, 1e-9);
    EXPECT_NEAR(own.exaggeration, 1 / foot, 1e-9);
    EXPECT_NEAR(own.dominance.observer, 1.7 / foot, 1e-9);
}

double ground_at(double x, double y) { return 100 + 0.3 * x - 0.2 * y; }

/// A sloping ground of 4 points a square metre, with a hole, and trees above.
SurveyPoints made_survey(bool classified) {
    SurveyPoints survey;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(0, 60);
    for (int i = 0; i < 60 * 60 * 4; ++i) {
        const double x = uniform(random), y = uniform(random);
        if (std::hypot(x - 15, y - 15) < 5)
            continue;
        const bool tree = std::hypot(x - 40, y - 40) < 4 && i % 3 != 0; // some pulses reach the ground
        survey.points.emplace_back(x, y, ground_at(x, y) + (tree ? 8 : 0));
        survey.classes.push_back(!classified ? 1 : tree ? 5 : 2);
    }
    survey.ground_classified = classified;
    return survey;
}

double worst_to_ground(const SurfaceRaster& surface, int margin) {
    double worst = 0;
    const rasters::Raster& raster = surface.raster;
    for (int r = margin; r < raster.z.rows - margin; ++r)
        for (int c = margin; c < raster.z.cols - margin; ++c)
            if (!std::isnan(raster.z(r, c)))
                worst = std::max(worst, std::abs(raster.z(r, c) + raster.base -
                                                 ground_at(raster.grid.x0 + (c + 0.5) * raster.grid.cell,
                                                           raster.grid.y0 - (r + 0.5) * raster.grid.cell)));
    return worst;
}

/// A plane stays a plane: triangles are read at the centres of cells, wherever their points lie.
TEST(Relief, ground_is_read_at_the_centres_of_cells) {
    const SurfaceRaster surface = surface_of(made_survey(true), {.cell_m = 0.5});
    EXPECT_EQ(surface.raster.z.size(), cv::Size(120, 120));
    EXPECT_EQ(surface.raster.grid.x0, 0);
    EXPECT_EQ(surface.raster.grid.y0, 60);
    EXPECT_LT(worst_to_ground(surface, 2), 1e-3);
}

TEST(Relief, gaps_are_filled_within_a_limit_and_marked) {
    const SurfaceRaster surface = surface_of(made_survey(true), {.cell_m = 1, .fill_m = 3});
    const auto source_at = [&](double x, double y) {
        return Source(surface.source(59 - static_cast<int>(y), static_cast<int>(x)));
    };
    EXPECT_EQ(source_at(15, 15), Source::nothing); // 5 m from the nearest point
    EXPECT_TRUE(std::isnan(surface.raster.z(59 - 15, 15)));
    EXPECT_EQ(source_at(15, 18), Source::interpolated);
    EXPECT_EQ(source_at(30, 30), Source::measured);
    const SurfaceRaster whole = surface_of(made_survey(true), {.cell_m = 1, .fill_m = 8});
    EXPECT_LT(worst_to_ground(whole, 1), 1e-3);
    EXPECT_EQ(cv::countNonZero(whole.source == 0), 0);
}

TEST(Relief, trees_are_the_top_and_no_ground_with_classes_or_without) {
    const auto at_tree = [](const SurfaceRaster& surface) {
        return surface.raster.z(59 - 40, 40) + surface.raster.base;
    };
    EXPECT_NEAR(at_tree(surface_of(made_survey(true), {.surface = Surface::top, .cell_m = 1})),
                ground_at(40.5, 40.5) + 8, 0.5);
    const SurfaceRaster unclassified = surface_of(made_survey(false), {.cell_m = 1});
    EXPECT_NEAR(at_tree(unclassified), ground_at(40.5, 40.5), 0.05);
    EXPECT_TRUE(tests::warned(unclassified.raster.notes, "progressive morphological filter"));
}

TEST(Relief, the_filter_removes_a_building_without_points_of_ground_below) {
    cv::Mat1f lowest(60, 60);
    for (int r = 0; r < 60; ++r)
        for (int c = 0; c < 60; ++c)
            lowest(r, c) = 100 + 0.1F * static_cast<float>(c) + (r > 20 && r < 30 && c > 20 && c < 35 ? 6.0F : 0.0F);
    lowest(5, 5) = NAN;
    const cv::Mat1f ground = opened_ground(lowest, 1, 20);
    EXPECT_LT(ground(25, 28), 100 + 2.8 + 2); // the building is gone, give or take the slope within a window
    EXPECT_NEAR(ground(50, 50), 105, 0.3);
}

TEST(Relief, survey_without_points_of_the_surface_is_refused) {
    SurveyPoints survey = made_survey(true);
    std::ranges::fill(survey.classes, std::uint8_t(5));
    EXPECT_TRUE(says(refusal([&] { (void)surface_of(survey, {.cell_m = 1}); }), "no point is of the surface"));
    EXPECT_TRUE(says(refusal([&] { (void)surface_of(made_survey(true), {.cell_m = 1e-4}); }), "larger --cell"));
}

/// A raster in memory, with hills, holes and a step.
rasters::Raster made_raster(cv::Size size) {
    rasters::Raster raster{cv::Mat1f(size), 0, {}, {}};
    for (int r = 0; r < size.height; ++r)
        for (int c = 0; c < size.width; ++c)
            raster.z(r, c) = static_cast<float>(300 + 3 * std::sin(r * 0.31) * std::cos(c * 0.23) + (c > 200 ? 4 : 0) +
                                                0.05 * ((r * 7 + c * 13) % 11));
    cv::Mat1f(raster.z, cv::Rect(30, 40, 5, 4) & cv::Rect(cv::Point(), size)).setTo(NAN);
    return raster;
}

/// Bands see what is beyond their rows, whatever their height: borders, mirrored borders, holes.
TEST(Relief, bands_have_the_bits_of_one_piece) {
    const rasters::Raster raster = made_raster({300, 130});
    MapSettings settings;
    settings.write = {"svf", "asvf", "openness", "openness-neg", "dominance", "ao", "dtm", "source", "error"};
    settings.height_noise_m = 0.02;
    settings.walk.radius = 7.5;
    settings.walk.directions = 8;
    for (const horizon::Profile profile : {horizon::Profile::exact, horizon::Profile::rvt}) {
        settings.walk.profile = profile;
        rasters::MemoryReader reader(raster);
        const Maps whole = maps_of({reader, {}}, settings);
        const horizon::Layers layers =
            horizon::layers_of({raster.z, raster.grid.cell}, settings.walk, {true, true, true, true, true, true});
        EXPECT_TRUE(std::equal(layers.ao.datastart, layers.ao.dataend, whole[5].values.datastart));
        for (const int rows : {1, 16, 64}) {
            rasters::MemoryReader again(raster);
            std::size_t differ = 0, seen = 0;
            compute_maps(
                {again, {}}, settings,
                [&](const std::string& layer, int first, const cv::Mat& part) {
                    const cv::Mat one = std::ranges::find(whole, layer, &NamedMap::name)
                                            ->values.rowRange(first, first + part.rows)
                                            .clone();
                    const cv::Mat other = part.clone();
                    differ += std::memcmp(one.data, other.data, one.total() * one.elemSize()) != 0;
                    ++seen;
                },
                rows);
            EXPECT_EQ(differ, 0U) << rows;
            EXPECT_EQ(seen, static_cast<std::size_t>((130 + rows - 1) / rows) * 9) << rows;
        }
    }
}

/// One cell wide, one cell alone, no height at all, cells of a millimetre and of a kilometre.
TEST(Relief, odd_rasters_have_values_where_they_have_heights) {
    MapSettings settings;
    settings.write = {"svf", "openness", "dominance", "ao", "error", "source"};
    for (const horizon::Profile profile : {horizon::Profile::exact, horizon::Profile::rvt})
        for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 90), cv::Size(90, 1), cv::Size(37, 53)})
            for (const double cell : {0.001, 1.0, 1000.0}) {
                rasters::Raster raster = made_raster(size);
                raster.z *= cell;
                raster.grid.cell = cell;
                settings.walk.profile = profile;
                settings.walk.radius = 0; // 10 cells
                rasters::MemoryReader reader(raster);
                for (const NamedMap& map : maps_of({reader, {}}, settings))
                    for (int r = 0; r < size.height; ++r)
                        for (int c = 0; c < size.width && map.name != "source"; ++c)
                            EXPECT_EQ(std::isnan(map.values.at<float>(r, c)), std::isnan(raster.z(r, c))) << map.name;
            }
    rasters::Raster nothing = made_raster({20, 30});
    nothing.z.setTo(NAN);
    rasters::MemoryReader reader(nothing);
    for (const NamedMap& map : maps_of({reader, {}}, settings))
        EXPECT_EQ(cv::countNonZero(map.name == "source" ? map.values : cv::Mat(map.values == map.values)), 0)
            << map.name;
}

/// A number for "no data" that the file does not declare is said, not guessed.
TEST(Relief, undeclared_numbers_for_no_data_are_reported) {
    const auto notes_of = [](float height, double base) {
        rasters::Raster raster = made_raster({90, 60});
        raster.z(cv::Rect(10, 10, 4, 5)).setTo(height - base);
        raster.base = base;
        rasters::MemoryReader reader(raster);
        (void)maps_of({reader, {}}, {});
        return reader.notes;
    };
    EXPECT_TRUE(tests::warned(notes_of(-9999, 0), "20 cells have a height of -9999"));
    EXPECT_TRUE(tests::warned(notes_of(-32768, 0), "-32768"));
    EXPECT_TRUE(tests::warned(notes_of(0, 0), "20 cells have a height of 0, all others"));
    EXPECT_TRUE(notes_of(NAN, 0).empty());
    EXPECT_TRUE(notes_of(280, 0).empty());
    EXPECT_TRUE(tests::warned(notes_of(-9999, 290), "20 cells have a height of -9999"));
    EXPECT_TRUE(tests::warned(notes_of(0, 290), "20 cells have a height of 0, all others"));
}

TEST(Relief, files_of_a_survey_without_classes_are_named) {
    SurveyPoints survey = made_survey(true);
    survey.files = {"east.las"}, survey.ends = {survey.points.size()};
    EXPECT_TRUE(surface_of(survey, {.cell_m = 1}).raster.notes.empty());
    survey.points.emplace_back(70, 30, 100);
    survey.classes.push_back(1);
    survey.files.emplace_back("west.las"), survey.ends.push_back(survey.points.size());
    EXPECT_TRUE(tests::warned(surface_of(survey, {.cell_m = 1}).raster.notes, "No point of west.las is classified"));
    EXPECT_TRUE(surface_of(survey, {.surface = Surface::all, .cell_m = 1}).raster.notes.empty());
    EXPECT_TRUE(tests::warned(surface_of(survey, {.surface = Surface::all, .cell_m = 0.1}).raster.notes, "m apart"));
}

/// False returns far below the ground, unclassified: a point of a cell alone, and a ditch, which goes on.
TEST(Relief, false_returns_below_the_ground_are_left_out_and_ditches_stay) {
    SurveyPoints survey = made_survey(false);
    for (const double x : {30.5, 50.5})
        survey.points.emplace_back(x, 20.5, ground_at(x, 20.5) - 25), survey.classes.push_back(1);
    for (Eigen::Vector3d& point : survey.points)
        if (point.y() > 50 && point.y() < 52)
            point.z() -= 4;
    const SurfaceRaster surface = surface_of(survey, {.cell_m = 1});
    const auto depth = [&](int x, int y) {
        return surface.raster.z(59 - y, x) + surface.raster.base - ground_at(x + 0.5, y + 0.5);
    };
    EXPECT_NEAR(depth(30, 20), 0, 0.1);
    EXPECT_NEAR(depth(50, 20), 0, 0.1);
    EXPECT_NEAR(depth(30, 50), -4, 0.3);
}

/// More noise, more error; none of it where nothing is seen. A survey knows its noise itself.
TEST(Relief, expected_errors_grow_with_noise_and_near_gaps) {
    const auto errors_with = [](double noise_m) {
        rasters::Raster raster = made_raster({100, 100});
        for (int r = 0; r < 100; ++r)
            for (int c = 0; c < 100; ++c)
                raster.z(r, c) = static_cast<float>(std::sin(r * 0.3)) + 0 * raster.z(r, c); // NaN stays
        rasters::MemoryReader reader(raster);
        MapSettings settings;
        settings.write = {"error"};
        settings.height_noise_m = noise_m;
        return cv::Mat1f(maps_of({reader}, settings)[0].values);
    };
    const cv::Mat1f exact = errors_with(0), noisy = errors_with(0.1);
    EXPECT_TRUE(std::isnan(noisy(41, 31)));
    EXPECT_GT(noisy(70, 70), 1.2 * exact(70, 70));
    EXPECT_GT(exact(50, 0), exact(50, 50)); // half of its surroundings are beyond the border

    SurveyPoints survey = made_survey(true);
    std::mt19937 random(5);
    std::normal_distribution<double> normal(0, 0.07);
    for (Eigen::Vector3d& point : survey.points)
        point.z() += normal(random);
    const SurfaceRaster surface = surface_of(survey, {.cell_m = 1, .fill_m = 8, .errors = true});
    EXPECT_TRUE(tests::warned(surface.raster.notes, "a noise of 0.07"));
    double sum = 0;
    for (int r = 40; r < 60; ++r) // no gap, no tree
        for (int c = 0; c < 30; ++c)
            sum += surface.errors(r - 40, c) * surface.errors(r - 40, c);
    EXPECT_NEAR(std::sqrt(sum / 600), 0.07 / 2, 0.01); // four points a cell
}

/// Four files of a quarter each, with classes. In cells of 10 cm it has several blocks.
std::vector<fs::path> made_tiles(const tests::TemporaryFolder& folder) {
    SurveyPoints survey = made_survey(true);
    std::mt19937 random(8);
    std::normal_distribution<double> normal(0, 0.03);
    std::vector<fs::path> files;
    for (int tile = 0; tile < 4; ++tile) {
        std::vector<Eigen::Vector3d> points;
        std::vector<float> classes;
        for (std::size_t i = 0; i < survey.points.size(); ++i)
            if (const Eigen::Vector3d& p = survey.points[i];
                (p.x() > 30) == (tile % 2 == 1) && (p.y() > 30) == (tile > 1)) {
                points.emplace_back(p + Eigen::Vector3d(0, 0, normal(random)));
                classes.push_back(survey.classes[i]);
            }
        files.push_back(folder / fmt::format("tile{}.ply", tile));
        write_new_ply(files.back(), points, {}, {{"classification", classes}});
    }
    return files;
}

/// Rows that are read when they are needed, files from the north on: the bits of one piece.
TEST(Relief, surveys_read_by_rows_have_the_bits_of_those_in_memory) {
    const tests::TemporaryFolder folder;
    const std::vector<fs::path> files = made_tiles(folder);
    for (const Surface kind : {Surface::ground, Surface::top, Surface::all}) {
        const SurfaceOptions options{.surface = kind, .cell_m = 0.1, .fill_m = 1.5, .errors = true};
        const SurfaceRaster whole = surface_of(read_survey(files), options);
        std::vector<std::string> warnings;
        const auto reader = open_surface(files, options, warnings);
        ASSERT_EQ(reader->size, whole.raster.z.size());
        EXPECT_EQ(reader->base, whole.raster.base);
        EXPECT_EQ(reader->grid.y0, whole.raster.grid.y0);
        const auto same = [](const cv::Mat& one, const cv::Mat& other) {
            const cv::Mat a = one.clone(), b = other.clone();
            return a.size() == b.size() && std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
        };
        for (int first = 0; first < reader->size.height; first += 77) {
            const cv::Range rows(first, std::min(first + 77, reader->size.height));
            cv::Mat1f z(rows.size(), reader->size.width);
            reader->read(first, z);
            EXPECT_TRUE(same(z, whole.raster.z.rowRange(rows))) << first;
            EXPECT_TRUE(same(reader->source, whole.source.rowRange(rows))) << first;
            EXPECT_TRUE(same(reader->errors, whole.errors.rowRange(rows))) << first;
        }
    }
}

/// Blocks lie on the map: a tile more changes nothing far from it.
TEST(Relief, a_piece_of_a_survey_has_the_bits_of_the_whole) {
    const tests::TemporaryFolder folder;
    const std::vector<fs::path> files = made_tiles(folder);
    const SurfaceOptions options{.cell_m = 0.1, .fill_m = 1.5};
    const SurfaceRaster whole = surface_of(read_survey(files), options),
                        south = surface_of(read_survey({files[0], files[1]}), options);
    ASSERT_EQ(south.raster.base, whole.raster.base);
    constexpr int far = 60; // cells: two fillings and more
    int differ = 0, known = 0;
    for (int r = far; r < south.raster.z.rows; ++r)
        for (int c = 0; c < south.raster.z.cols; ++c) {
            const float one = south.raster.z(r, c),
                        other = whole.raster.z(whole.raster.z.rows - south.raster.z.rows + r, c);
            differ += one != other && !(std::isnan(one) && std::isnan(other));
            known += !std::isnan(one);
        }
    EXPECT_EQ(differ, 0);
    EXPECT_GT(known, 100000);
}

TEST(Relief, the_program_reads_large_surveys_by_rows) {
    const tests::TemporaryFolder folder;
    made_tiles(folder);
    const auto maps = [&](const std::string& out, const std::string& more) {
        const tests::Ran ran =
            tests::run_program(fmt::format("relief {} -o {} --cell 0.5 --write svf,error,source {}",
                                           fs::path(folder / "").string(), (folder / out).string(), more));
        EXPECT_EQ(ran.exit_code, all_well) << ran.err;
        std::string bytes;
        for (const fs::directory_entry& file : fs::directory_iterator(folder / out))
            bytes += tests::file_bytes(file.path());
        return bytes;
    };
    const std::string in_memory = maps("a", ""), by_rows = maps("b", "--memory 0");
    EXPECT_GT(in_memory.size(), 1000U);
    EXPECT_EQ(in_memory, by_rows);
    const std::string unclassified = tests::write_file(folder / "c.xyz", "0 0 1\n3 0 1\n0 3 1\n").string();
    const tests::Ran ran =
        tests::run_program(fmt::format("relief {} -o {} --memory 0", unclassified, (folder / "c").string()));
    EXPECT_EQ(ran.exit_code, nothing_done);
    EXPECT_TRUE(says(ran.err, "--memory"));
}

tests::Ran run_relief(const std::string& words) { return tests::run_program("relief " + words); }

fs::path made_dem(const fs::path& file) {
    cv::Mat1f z(40, 50);
    cv::randu(z, 300, 304);
    z(4, 5) = NAN;
    rasters::Grid grid;
    grid.x0 = 500000.5, grid.y0 = 5200000, grid.cell = 0.5;
    grid.crs = crs_with({{1024, 1}, {1025, 1}, {3072, 32633}, {3076, 9001}});
    rasters::write_raster(file, z, grid, {});
    return file;
}

TEST(Relief, the_program_writes_maps_in_the_place_of_the_dem) {
    const tests::TemporaryFolder folder;
    const fs::path dem = made_dem(folder / "dem.of.1.tif");
    const tests::Ran ran =
        run_relief(fmt::format("{} -o {} --write svf,ao,dtm,8bit --radius 5", dem.string(), (folder / "out").string()));
    EXPECT_EQ(ran.exit_code, all_well) << ran.err;
    const rasters::Raster before = rasters::read_raster(dem);
    for (const char* name : {"dem_SVF_R10_D16.tif", "dem_AO_R10.tif", "dem_DTM.tif"}) {
        const rasters::Raster map = rasters::read_raster(folder / "out" / name);
        EXPECT_EQ(map.z.size(), before.z.size());
        EXPECT_EQ(map.grid.x0, before.grid.x0);
        EXPECT_EQ(map.grid.y0, before.grid.y0);
        EXPECT_EQ(map.grid.crs.keys.directory, before.grid.crs.keys.directory);
        EXPECT_TRUE(std::isnan(map.z(4, 5)));
        EXPECT_GT(map.z(20, 20), 0);
    }
    EXPECT_TRUE(fs::exists(folder / "out" / "dem_SVF_R10_D16_8bit.tif"));
}

/// Rasters beside each other: a virtual one of each map, which is read as they are.
TEST(Relief, maps_of_tiles_are_joined_by_virtual_rasters) {
    const tests::TemporaryFolder folder;
    fs::create_directories(folder / "tiles");
    const rasters::Raster west = rasters::read_raster(made_dem(folder / "tiles" / "a.tif"));
    rasters::Grid grid = west.grid;
    grid.x0 += 50 * grid.cell, grid.y0 += 3 * grid.cell;
    rasters::write_raster(folder / "tiles" / "b.tif", west.z, grid, {});
    ASSERT_EQ(run_relief(fmt::format("{} -o {} --write svf,source,8bit", (folder / "tiles").string(),
                                     (folder / "out").string()))
                  .exit_code,
              all_well);
    const rasters::Raster joined = rasters::read_raster(folder / "out" / "tiles_SVF_R10_D16.vrt"),
                          tile = rasters::read_raster(folder / "out" / "b_SVF_R10_D16.tif");
    EXPECT_EQ(joined.z.size(), cv::Size(100, 43));
    EXPECT_EQ(joined.grid.x0, west.grid.x0);
    EXPECT_EQ(joined.grid.y0, grid.y0);
    EXPECT_EQ(joined.grid.crs.epsg, 32633);
    EXPECT_EQ(joined.z(7, 57), tile.z(7, 7));
    EXPECT_TRUE(std::isnan(joined.z(4, 55)) && std::isnan(joined.z(0, 0)) && !std::isnan(joined.z(3, 0)));
    EXPECT_TRUE(fs::exists(folder / "out" / "tiles_SVF_R10_D16_8bit.vrt"));
    EXPECT_TRUE(fs::exists(folder / "out" / "tiles_SOURCE.vrt"));
}

TEST(Relief, exit_codes_tell_misuse_from_bad_inputs) {
    const tests::TemporaryFolder folder;
    const std::string dem = made_dem(folder / "dem.tif").string(), out = (folder / "out").string();
    const std::string bad = tests::write_file(folder / "bad.tif", std::string("II*\0garbage", 11)).string();
    EXPECT_EQ(run_relief(dem).exit_code, misuse);
    EXPECT_EQ(run_relief(fmt::format("{} -o {} --write sfv", dem, out)).exit_code, misuse);
    EXPECT_EQ(run_relief(fmt::format("{} -o {} --dominance 1,2", dem, out)).exit_code, misuse);
    EXPECT_EQ(run_relief(fmt::format("{} -o {} --radius 0.1", dem, out)).exit_code, misuse); // less than a cell
    const tests::Ran some = run_relief(fmt::format("{} {} -o {}", dem, bad, out));
    EXPECT_EQ(some.exit_code, some_failed);
    EXPECT_TRUE(says(some.err, "bad.tif"));
    const tests::Ran again = run_relief(fmt::format("{} -o {}", dem, out));
    EXPECT_EQ(again.exit_code, nothing_done);
    EXPECT_TRUE(says(again.err, "--overwrite"));
    EXPECT_EQ(run_relief(fmt::format("{} -o {} --overwrite", dem, out)).exit_code, all_well);
}

TEST(Relief, the_program_maps_any_cloud) {
    const tests::TemporaryFolder folder;
    const SurveyPoints survey = made_survey(false);
    write_new_ply(folder / "scan.ply", survey.points, {}, {});
    const tests::Ran ran = run_relief(fmt::format("{} -o {} --surface top --cell 1 --write svf,source,dtm",
                                                  (folder / "scan.ply").string(), (folder / "out").string()));
    EXPECT_EQ(ran.exit_code, all_well) << ran.err;
    EXPECT_TRUE(says(ran.err, "no coordinate system"));
    EXPECT_EQ(rasters::read_raster(folder / "out" / "scan_SOURCE.tif").z.size(), cv::Size(60, 60));
    EXPECT_LT(rasters::read_raster(folder / "out" / "scan_SVF_R10_D16.tif").z(59 - 35, 40), 0.9F); // beside the trees
}

/// The corner of a cell on a steep slope lies far above the cell's centre, and is ground.
TEST(Relief, points_of_a_slope_are_of_its_surface) {
    SurveyPoints survey;
    for (int i = 0; i < 4000; ++i) {
        const int column = i % 80, row = i / 80;
        const double x = column * 0.25, y = row * 0.4;
        survey.points.emplace_back(x, y, 2 * x - y);
    }
    survey.classes.assign(survey.points.size(), 2);
    survey.ground_classified = true;
    survey.points[100].z() += 0.5;
    survey.classes[100] = 5;
    const std::vector<int> cells = cells_of_points(survey, surface_of(survey, {.cell_m = 2}), Surface::ground);
    EXPECT_EQ(std::ranges::count(cells, -1), 1);
    EXPECT_EQ(cells[100], -1);
}

/// Every point gets the value of its cell; one far above the surface is none of it.
TEST(Relief, values_of_cells_come_back_to_points) {
    const tests::TemporaryFolder folder;
    SurveyPoints survey = made_survey(true);
    survey.points.emplace_back(30, 30, ground_at(30, 30) + 5);
    survey.points.emplace_back(NAN, NAN, NAN);
    write_new_ply(folder / "a.ply", survey.points, {}, {{"gps", std::vector<float>(survey.points.size(), 7)}});
    write_new_ply(folder / "b.ply", {{61.5, 30.5, ground_at(61.5, 30.5)}}, {}, {});
    const tests::Ran ran =
        run_relief(fmt::format("{} {} -o {} --cell 1 --write openness-neg,ao,source,points",
                               (folder / "a.ply").string(), (folder / "b.ply").string(), (folder / "out").string()));
    ASSERT_EQ(ran.exit_code, all_well) << ran.err;
    std::vector<std::string> warnings;
    const fs::path file = folder / "out" / "a_POINTS.ply", other = folder / "out" / "b_POINTS.ply";
    const Cloud cloud = read_cloud(file, warnings);
    ASSERT_EQ(cloud.points.size(), survey.points.size());
    EXPECT_EQ(recorded_field(cloud, "gps", file)[0], 7);
    const std::string name = fs::path(folder / "x").parent_path().filename().string();
    const cv::Mat1f ao = rasters::read_raster(folder / "out" / (name.substr(0, name.find('.')) + "_AO_R10.tif")).z;
    const std::vector<float> values = recorded_field(cloud, "ambient_occlusion", file);
    ASSERT_EQ(ao.rows, 60);
    int known = 0;
    for (std::size_t i = 0; i + 2 < values.size(); ++i) {
        const int row = 59 - static_cast<int>(survey.points[i].y()), column = static_cast<int>(survey.points[i].x());
        if (survey.classes[i] == 2) {
            EXPECT_TRUE(values[i] == ao(row, column) || std::isnan(ao(row, column))) << i;
            known += !std::isnan(values[i]);
        }
    }
    EXPECT_GT(known, 13000);
    EXPECT_TRUE(std::isnan(values[values.size() - 2]));
    EXPECT_TRUE(std::isnan(values.back()));
    EXPECT_GT(recorded_field(cloud, "openness_neg", file)[0], 60);
    EXPECT_EQ(recorded_field(read_cloud(other, warnings), "source", other)[0], 1);
    EXPECT_EQ(run_relief(fmt::format("{} -o {} --write svf,points", made_dem(folder / "dem.tif").string(),
                                     (folder / "maps").string()))
                  .exit_code,
              misuse);
}

/// Readers of zips other than ours: the entries of the central directory, and Python's sums where it is there.
TEST(Relief, views_of_the_halves_of_the_sky_are_a_zip) {
    const tests::TemporaryFolder folder;
    ASSERT_EQ(run_relief(fmt::format("{} -o {} --write svfs --radius 5", made_dem(folder / "dem.tif").string(),
                                     (folder / "out").string()))
                  .exit_code,
              all_well);
    const fs::path zip = folder / "out" / "dem_svfs.zip";
    EXPECT_EQ(std::distance(fs::directory_iterator(folder / "out"), fs::directory_iterator()), 1); // nothing else
    const std::string bytes = tests::file_bytes(zip);
    std::vector<std::string> names;
    for (auto at = bytes.find("PK\1\2"); at != std::string::npos; at = bytes.find("PK\1\2", at + 4))
        names.push_back(bytes.substr(at + 46, static_cast<unsigned char>(bytes[at + 28])));
    ASSERT_EQ(names.size(), 15U);
    EXPECT_EQ(names[0], "svf.tif");
    EXPECT_EQ(names[1], "svfN.tif");
    const auto first = bytes.find("svf.tif") + 7, second = bytes.find("PK\3\4", first);
    const rasters::Raster svf =
        rasters::read_raster(tests::write_file(folder / "svf.tif", bytes.substr(first, second - first)));
    const rasters::Raster dem = rasters::read_raster(folder / "dem.tif");
    EXPECT_EQ(svf.grid.x0, dem.grid.x0);
    horizon::Settings settings;
    settings.radius = 5, settings.definition = horizon::Definition::horizontal;
    const cv::Mat1f expected = horizon::layers_of({dem.z, dem.grid.cell}, settings, {.svf = true}).svf;
    EXPECT_EQ(svf.z(20, 20), expected(20, 20));
    const int tested = std::system(
        fmt::format("python3 -m zipfile -t {} > /dev/null 2>&1", zip.string()).c_str()); // NOLINT(cert-env33-c)
    EXPECT_TRUE(tested == 0 || std::system("python3 --version > /dev/null 2>&1") != 0);  // NOLINT(cert-env33-c)
}

/// GDAL, where it is installed, finds the maps where the DEM lies.
TEST(Relief, gdalinfo_reads_the_same_place) {
    if (std::system("gdalinfo --version > /dev/null 2>&1") != 0) // NOLINT(cert-env33-c)
        GTEST_SKIP() << "gdalinfo is not installed (Debian: gdal-bin)";
    const tests::TemporaryFolder folder;
    const fs::path dem = made_dem(folder / "dem.tif");
    ASSERT_EQ(
        run_relief(fmt::format("{} -o {} --write svf,source,8bit --radius 5", dem.string(), (folder / "out").string()))
            .exit_code,
        all_well);
    const auto told = [&](const fs::path& file) {
        const std::string command = fmt::format("gdalinfo {} > {} 2>&1", file.string(), (folder / "told.txt").string());
        EXPECT_EQ(std::system(command.c_str()), 0); // NOLINT(cert-env33-c)
        const std::string text = tests::file_bytes(folder / "told.txt");
        EXPECT_EQ(text.find("Warning"), std::string::npos) << text;
        const auto begin = text.find("Coordinate System is:"), metadata = text.find("Metadata:", begin);
        return text.substr(begin, metadata - begin);
    };
    const std::string place = told(dem);
    EXPECT_TRUE(says(place, "ID[\"EPSG\",32633]]"));
    EXPECT_TRUE(says(place, "Origin = (500000.5"));
    for (const char* name : {"dem_SVF_R10_D16.tif", "dem_SVF_R10_D16_8bit.tif", "dem_SOURCE.tif"})
        EXPECT_EQ(told(folder / "out" / name), place) << name;
}

} // namespace
} // namespace scanshade::relief
