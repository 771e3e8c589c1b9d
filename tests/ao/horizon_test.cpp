// Horizons of height fields: closed forms of shapes, laws, and dense sampling of the same surface.
#include "ao/horizon/horizon.h"
#include "ao/horizon/padded.h"
#include "ao/horizon/tables.h"
#include "projection/base/error.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>
#include <opencv2/core.hpp>
#include <random>

namespace scanshade::horizon {
namespace {

constexpr double pi = std::numbers::pi, degree = pi / 180;
constexpr Wanted all_layers{true, true, true, true, true, true};

/// A field of odd size; the shape is a height at (east, north) of its middle, in cells.
HeightField made(int size, const std::function<double(double east, double north)>& shape, int columns = 0) {
    HeightField field{cv::Mat1f(size, columns > 0 ? columns : size), 1};
    for (int r = 0; r < field.z.rows; ++r)
        for (int c = 0; c < field.z.cols; ++c) {
            const int east = c - field.z.cols / 2, north = field.z.rows / 2 - r;
            field.z(r, c) = static_cast<float>(shape(east, north));
        }
    return field;
}

HeightField rough(int rows, int columns, double height, unsigned seed = 5) {
    HeightField field{cv::Mat1f(rows, columns), 0.5};
    std::mt19937 random(seed);
    std::uniform_real_distribution<float> uniform(0, static_cast<float>(height));
    for (float& z : field.z)
        z = 300 + uniform(random);
    return field;
}

Settings exact(double radius, int directions, Definition definition = Definition::solid_angle) {
    Settings settings;
    settings.radius = radius;
    settings.directions = directions;
    settings.definition = definition;
    return settings;
}

Settings rvt(double radius, int directions) {
    Settings settings = exact(radius, directions);
    settings.profile = Profile::rvt;
    return settings;
}

float svf_at(const HeightField& field, int row, int column, const Settings& settings) {
    return layers_of(field, settings, {.svf = true}).svf(row, column);
}

int unknown_of(const cv::Mat1f& map) {
    return static_cast<int>(std::ranges::count_if(map, [](float value) { return std::isnan(value); }));
}

double worst(const cv::Mat1f& a, const cv::Mat1f& b) { return cv::norm(a, b, cv::NORM_INF); }
double worst_from(const cv::Mat1f& map, double value) {
    return worst(map, cv::Mat1f(map.size(), static_cast<float>(value)));
}

double mean(int directions, const std::function<double(double azimuth)>& value) {
    double sum = 0;
    for (int k = 0; k < directions; ++k)
        sum += value((k + 0.5) * 2 * pi / directions);
    return sum / directions;
}

TEST(Horizon, a_level_plane_is_open_in_every_layer) {
    const HeightField field = made(33, [](double, double) { return 3000.25; });
    for (const Profile profile : {Profile::exact, Profile::rvt})
        for (const Definition definition : {Definition::solid_angle, Definition::horizontal, Definition::surface}) {
            Settings settings = exact(10, 16, definition);
            settings.profile = profile;
            const Layers layers = layers_of(field, settings, all_layers);
            for (const cv::Mat1f& map : {layers.svf, layers.asvf, layers.ao})
                EXPECT_LT(worst_from(map, 1), 1e-6);
            EXPECT_LT(worst_from(layers.dominance, 1), 1e-4); // RVT's sum of height and observer is rounded
            for (const cv::Mat1f& map : {layers.openness, layers.openness_neg})
                EXPECT_LT(worst_from(map, 90), 1e-4);
        }
}

/// Equal values up to the border: where a ray meets no surface, the cell's own plane goes on.
TEST(Horizon, a_tilted_plane_has_its_closed_forms_up_to_the_border) {
    const double slope = 25 * degree, toward = 120 * degree;
    const HeightField field =
        made(41, [&](double e, double n) { return std::tan(slope) * (e * std::sin(toward) + n * std::cos(toward)); });
    const Wanted sky{.svf = true, .openness = true, .openness_neg = true, .ao = true};
    const Layers solid = layers_of(field, exact(10, 256), sky);
    EXPECT_LT(worst_from(solid.svf, 1 - slope / pi), 1e-4);
    EXPECT_LT(worst_from(solid.openness, 90), 1e-3);
    EXPECT_LT(worst_from(solid.openness_neg, 90), 1e-3);
    EXPECT_LT(worst_from(solid.ao, 1), 1e-4);
    EXPECT_LT(worst_from(layers_of(field, exact(10, 256, Definition::horizontal), sky).svf, (1 + std::cos(slope)) / 2),
              1e-4);
    EXPECT_LT(worst_from(layers_of(field, exact(10, 256, Definition::surface), sky).svf, 1), 1e-4);
    const Slopes slopes = slopes_of(field);
    EXPECT_LT(worst_from(slopes.east, std::tan(slope) * std::sin(toward)), 1e-5);
    EXPECT_LT(worst_from(slopes.north, std::tan(slope) * std::cos(toward)), 1e-5);
}

/// A wall that ends with the raster is seen within an angle psi to both sides.
struct Wall {
    double k, psi;
    [[nodiscard]] double solid_angle() const { return std::asin(k * std::sin(psi) / std::sqrt(1 + k * k)) / pi; }
    [[nodiscard]] double horizontal() const {
        const double root = std::sqrt(1 + k * k);
        return psi / pi - std::atan(std::tan(psi) / root) / (pi * root);
    }
    [[nodiscard]] double openness() const { // numerically: degrees that the wall takes
        const int steps = 20000;
        double sum = 0;
        for (int i = 0; i < steps; ++i)
            sum += std::atan(k * std::cos((i + 0.5) / steps * psi));
        return sum / steps * psi / pi / degree;
    }
};

TEST(Horizon, a_street_takes_what_its_two_walls_take) {
    const double height = 12;
    const int west = 8, east = 6; // of the middle; a bilinear wall has its upper edge at the first cells of full height
    const int rows = 301, columns = 21, row = rows / 2, column = columns / 2, directions = 512;
    const HeightField field = made(
        rows, [&](double e, double) { return e <= -west || e >= east ? height : 0; }, columns);
    const double beyond = 160, half = row;
    const Wall left{height / west, std::atan(half / west)}, right{height / east, std::atan(half / east)};
    const double solid = 1 - left.solid_angle() - right.solid_angle();
    const double level = 1 - left.horizontal() - right.horizontal();
    EXPECT_NEAR(svf_at(field, row, column, exact(beyond, directions)), solid, 5e-4);
    for (const Definition definition : {Definition::horizontal, Definition::surface})
        EXPECT_NEAR(svf_at(field, row, column, exact(beyond, directions, definition)), level, 5e-4);
    const Layers layers = layers_of(field, exact(beyond, directions), {.openness = true, .ao = true});
    EXPECT_NEAR(layers.openness(row, column), 90 - left.openness() - right.openness(), 0.03);
    EXPECT_NEAR(layers.ao(row, column), level, 5e-4);
}

/// Points of a high wall at distance d count up to the height sqrt(R² - t²): with t = d / cos psi the elevation has the
/// cosine t / R, and 1 - cos² integrates to (2 psi - (d / R)² 2 tan psi) / 2 pi, up to cos psi = d / R.
TEST(Horizon, occlusion_ends_at_the_ball) {
    const double radius = 10;
    const HeightField field = made(65, [](double e, double) { return e >= 1 ? 5000 : 0; });
    const Layers layers = layers_of(field, exact(radius, 512), {.ao = true});
    for (const int d : {2, 4, 6, 9}) {
        const double share = d / radius, psi = std::acos(share);
        EXPECT_NEAR(layers.ao(32, 32 - d), 1 - (2 * psi - share * share * 2 * std::tan(psi)) / (2 * pi), 2e-3) << d;
    }
    EXPECT_FLOAT_EQ(layers.ao(32, 10), 1);
}

TEST(Horizon, a_valley_has_the_same_view_at_its_bottom_and_on_its_flanks) {
    const double slope = 25 * degree;
    const int size = 201, middle = size / 2;
    const HeightField field = made(size, [&](double e, double) { return std::tan(slope) * std::abs(e); });
    const auto at = [&](int column, Definition definition) {
        return svf_at(field, middle, column, exact(150, 64, definition));
    };
    EXPECT_NEAR(at(middle, Definition::solid_angle), 1 - 2 * slope / pi, 5e-4);
    EXPECT_NEAR(at(middle, Definition::horizontal), std::cos(slope), 5e-4);
    EXPECT_NEAR(at(middle, Definition::surface), std::cos(slope), 5e-4);
    // From a flank, the end of the other is seen (L - a) / (L + a) as steep as the flank, with L = 100, a = 1.
    EXPECT_NEAR(at(middle + 1, Definition::solid_angle), 1 - 2 * slope / pi, 4e-3);
    EXPECT_NEAR(at(middle + 1, Definition::horizontal), std::cos(slope), 4e-3);
    EXPECT_NEAR(at(middle + 1, Definition::surface), std::pow(std::cos(slope), 2), 4e-3);
}

/// 1 - d / 2r everywhere in a bowl of depth d and radius r: half in a half sphere. Needs normals, and horizons below
/// the horizontal. The error of the bilinear bowl falls with the cell.
TEST(Horizon, a_half_sphere_sees_half_of_the_sky_everywhere) {
    double error_before = 1;
    for (const int radius : {26, 104}) {
        const HeightField field = made(2 * radius + 13, [&](double e, double n) {
            const double inside = radius * radius - e * e - n * n;
            return inside > 0 ? -std::sqrt(inside) : 0;
        });
        const cv::Mat1f svf = layers_of(field, exact(3.0 * radius, 64, Definition::surface), {.svf = true}).svf;
        double error = 0;
        const int middle = field.z.cols / 2;
        for (int c = middle - radius / 2; c <= middle + radius / 2; ++c)
            error = std::max(error, std::abs(svf(middle, c) - 0.5));
        EXPECT_LT(error, radius == 26 ? 0.012 : 0.0035);
        EXPECT_LT(error, error_before / 2);
        error_before = error;
    }
}

TEST(Horizon, peaks_and_pits_open_by_their_slope) {
    const double slope = 25 * degree, t = std::tan(slope);
    const auto cone = [&](double sign) {
        return made(65, [=](double e, double n) { return sign * t * std::hypot(e, n); });
    };
    const Wanted sky{.svf = true, .openness = true, .openness_neg = true};
    const Layers peak = layers_of(cone(-1), exact(60, 64), sky);
    EXPECT_NEAR(peak.svf(32, 32), 1, 1e-6);
    // The bilinear apex has a kink: there the first square's slope is (|sin| + |cos|) tan, as steep as or steeper than
    // the cone.
    const double along_squares =
        mean(64, [&](double a) { return std::atan((std::abs(std::sin(a)) + std::abs(std::cos(a))) * t); });
    EXPECT_NEAR(peak.openness_neg(32, 32), 90 - along_squares / degree, 1e-3);
    const Layers pit = layers_of(cone(1), exact(60, 64), sky);
    EXPECT_NEAR(
        pit.svf(32, 32),
        mean(64,
             [&](double a) { return 1 - std::sin(std::atan((std::abs(std::sin(a)) + std::abs(std::cos(a))) * t)); }),
        1e-5);
    EXPECT_NEAR(pit.openness(32, 32), peak.openness_neg(32, 32), 1e-4);
    EXPECT_NEAR(pit.openness_neg(32, 32), peak.openness(32, 32), 1e-4);
    EXPECT_NEAR(peak.openness(32, 32), 90 + 25, 0.2); // farther samples have the cone's own slope
}

/// A wall lowers the anisotropic view most where the sky is brightest: in the north-west, as counted clockwise.
TEST(Horizon, anisotropy_counts_azimuths_clockwise) {
    const auto corner = [](double east, double north) {
        return made(41, [=](double e, double n) { return e * east + n * north >= 7 ? 15 : 0; });
    };
    Settings settings = exact(15, 64);
    settings.anisotropy = Anisotropy::high;
    const auto at = [&](const HeightField& field) { return layers_of(field, settings, {.asvf = true}).asvf(20, 20); };
    const float north_west = at(corner(-1, 1)), north_east = at(corner(1, 1)), south_east = at(corner(1, -1));
    EXPECT_LT(north_west, north_east - 0.05);
    EXPECT_LT(north_east, south_east - 0.05);
    // RVT counts counterclockwise.
    settings.profile = Profile::rvt;
    EXPECT_LT(at(corner(1, 1)), at(corner(-1, 1)) - 0.05);
}

/// A long wall in the north takes from the northern half alone.
TEST(Horizon, halves_of_the_sky_are_those_of_their_sides) {
    const HeightField field = made(81, [](double, double north) { return north >= 12 ? 12 : 0; });
    for (Settings settings : {exact(40, 64, Definition::horizontal), rvt(40, 64)}) {
        const auto view = [&](Sky sky) {
            settings.sky = sky;
            return svf_at(field, 40, 40, settings);
        };
        const float whole = view(Sky::whole), north = view(Sky::north), east = view(Sky::east);
        EXPECT_EQ(view(Sky::south), 1);
        EXPECT_LT(whole, 0.95F);
        EXPECT_NEAR(1 - north, 64.0 / 31 * (1 - whole), 0.01); // 31 directions; two lie between the halves
        EXPECT_NEAR(east, view(Sky::west), 1e-5);
        EXPECT_NEAR(east, whole, 0.01);
    }
}

/// Height of the bilinear surface; NaN outside and in squares that lack a corner.
double bilinear(const cv::Mat1f& z, double row, double column) {
    const double r = std::floor(row), c = std::floor(column);
    const int i = static_cast<int>(r), j = static_cast<int>(c);
    if (i < 0 || j < 0 || i + 1 >= z.rows || j + 1 >= z.cols)
        return std::nan("");
    const double y = row - r, x = column - c;
    return (1 - y) * ((1 - x) * z(i, j) + x * z(i, j + 1)) + y * ((1 - x) * z(i + 1, j) + x * z(i + 1, j + 1));
}

/// Mean elevation of the horizons, in degrees, by many samples along each ray.
double sampled_openness(const HeightField& field, int row, int column, const Settings& settings, double from) {
    return mean(settings.directions, [&](double azimuth) {
        const double radius = settings.radius / field.cell;
        double highest = -INFINITY;
        for (double t = std::max(from, 1e-4); t <= radius; t += 1e-3) {
            const double z = bilinear(field.z, row - t * std::cos(azimuth), column + t * std::sin(azimuth));
            if (!std::isnan(z))
                highest = std::max(highest, (z - field.z(row, column)) / (t * field.cell));
        }
        return 90 - std::atan(highest) / degree;
    });
}

TEST(Horizon, exact_is_what_dense_sampling_finds) {
    for (const bool holes : {false, true})
        for (const Noise noise : {Noise::none, Noise::high}) {
            HeightField field = rough(40, 45, 1.5);
            if (holes)
                for (int i = 0; i < 60; ++i)
                    field.z((i * 13) % 40, (i * 29) % 45) = NAN;
            field.z(20, 21) = field.z(11, 30) = 300.7F;
            // Steps of three cells' height from cell to cell: here the middles of squares are not always enough.
            // Sampling cannot take the first step of 0.7: so the places have surface around them.
            for (int r = -1; r <= 1; ++r)
                for (int c = -1; c <= 1; ++c)
                    for (const cv::Point place : {cv::Point(21, 20), cv::Point(30, 11)})
                        if (float& z = field.z(place.y + r, place.x + c); std::isnan(z))
                            z = 300.2F;
            Settings settings = exact(4.3, 24);
            settings.noise = noise;
            const cv::Mat1f openness = layers_of(field, settings, {.openness = true}).openness;
            const double from = noise == Noise::none ? 0 : least_distance(8.6, noise);
            for (const cv::Point place : {cv::Point(21, 20), cv::Point(30, 11)})
                EXPECT_NEAR(openness(place), sampled_openness(field, place.y, place.x, settings, from), 0.15);
        }
}

TEST(Horizon, cells_without_data_stay_without_and_change_nothing_out_of_reach) {
    HeightField field = rough(60, 700, 2);
    const Settings settings = exact(5, 8);
    const Layers whole = layers_of(field, settings, all_layers);
    field.z(30, 40) = NAN;
    const Layers holed = layers_of(field, settings, all_layers);
    for (const auto& [a, b] : {std::pair(whole.svf, holed.svf), std::pair(whole.openness_neg, holed.openness_neg),
                               std::pair(whole.ao, holed.ao), std::pair(whole.dominance, holed.dominance)}) {
        EXPECT_EQ(unknown_of(b), 1);
        EXPECT_TRUE(std::isnan(b(30, 40)));
        EXPECT_EQ(worst(a.colRange(70, 700), b.colRange(70, 700)), 0); // some of them in the same rows and blocks
        EXPECT_EQ(worst(a.rowRange(0, 9), b.rowRange(0, 9)), 0);
    }
    EXPECT_GT(worst(whole.openness.colRange(0, 40), holed.openness.colRange(0, 40)), 0.1);
}

TEST(Horizon, a_field_of_holes_alone_and_single_cells_have_values_only_where_there_are_heights) {
    HeightField field{cv::Mat1f(5, 5, NAN), 1};
    EXPECT_EQ(unknown_of(layers_of(field, exact(3, 8), all_layers).svf), 25);
    field.z(2, 2) = 7;
    for (const Settings& settings : {exact(3, 8), rvt(3, 8)}) {
        const Layers layers = layers_of(field, settings, all_layers);
        EXPECT_EQ(layers.svf(2, 2), 1); // nothing occludes
        EXPECT_TRUE(std::isnan(layers.svf(2, 3)));
    }
}

TEST(Horizon, laws_of_shifts_turns_scales_and_flips) {
    const HeightField field = rough(50, 50, 1.2);
    Settings settings = exact(5, 16);
    const Layers layers = layers_of(field, settings, all_layers);
    const auto layers_with = [&](const cv::Mat& z, double cell) {
        return layers_of({z.clone(), cell}, settings, all_layers);
    };
    EXPECT_LT(worst(layers_with(field.z + 512, field.cell).svf, layers.svf), 1e-4); // single precision
    const Layers flipped = layers_with(-field.z, field.cell);
    EXPECT_LT(worst(flipped.openness, layers.openness_neg), 1e-4);
    EXPECT_LT(worst(flipped.openness_neg, layers.openness), 1e-4);
    settings.radius = 10;
    EXPECT_EQ(worst(layers_with(field.z * 2, 2 * field.cell).ao, layers.ao), 0);
    settings.radius = 5;
    settings.azimuth += 90;
    cv::Mat1f turned_z, expected;
    cv::rotate(field.z, turned_z, cv::ROTATE_90_CLOCKWISE);
    const Layers turned = layers_with(turned_z, field.cell);
    cv::rotate(layers.svf, expected, cv::ROTATE_90_CLOCKWISE);
    EXPECT_LT(worst(turned.svf, expected), 1e-5);
    cv::rotate(layers.asvf, expected, cv::ROTATE_90_CLOCKWISE);
    EXPECT_LT(worst(turned.asvf, expected), 1e-5);
}

TEST(Horizon, exaggeration_multiplies_heights_and_views_close_with_the_radius) {
    const HeightField field = rough(50, 50, 1.2);
    const HeightField higher{cv::Mat1f(field.z * 2), field.cell};
    Settings twice = exact(5, 16);
    twice.exaggeration = 2;
    EXPECT_EQ(worst(layers_of(field, twice, {.svf = true}).svf, layers_of(higher, exact(5, 16), {.svf = true}).svf), 0);
    const cv::Mat1f near = layers_of(field, exact(3, 16), {.svf = true}).svf;
    const cv::Mat1f far = layers_of(field, exact(8, 16), {.svf = true}).svf;
    // The surface at the nearer end of a search may stand above those places on it that a farther search looks at.
    EXPECT_LE(cv::norm(cv::max(far - near, 0), cv::NORM_INF), 1e-3);
    const cv::Mat1f level = layers_of(field, exact(8, 16, Definition::horizontal), {.svf = true}).svf;
    EXPECT_LE(cv::norm(cv::max(far - level, 0), cv::NORM_INF), 1e-6); // cos² h >= 1 - sin h
}

TEST(Horizon, rvt_looks_at_as_many_cells_as_the_toolbox) {
    const auto cells = [](int radius, int directions) {
        std::size_t count = 0;
        for (const auto& offsets : rvt_offsets(directions, radius, 1, 1000))
            count += offsets.size();
        return count;
    };
    EXPECT_EQ(cells(5, 8), 36U);
    EXPECT_EQ(cells(10, 8), 68U);
    EXPECT_EQ(cells(10, 16), 156U);
    EXPECT_EQ(cells(10, 32), 348U);
    EXPECT_EQ(cells(20, 16), 312U);
    EXPECT_EQ(cells(20, 32), 688U);
    EXPECT_EQ(cells(40, 16), 632U);
}

/// Known of the toolbox: rounding beside the direction closes a plane of 25 degrees by 0.029 and 3.1 degrees.
TEST(Horizon, rvt_closes_a_plane_as_the_toolbox_does) {
    const HeightField field = made(65, [&](double e, double n) {
        return std::tan(25 * degree) * (e * std::sin(120 * degree) + n * std::cos(120 * degree));
    });
    const Layers layers = layers_of(field, rvt(10, 16), {.svf = true, .openness = true});
    EXPECT_NEAR(layers.svf(32, 32), 1 - 25.0 / 180 - 0.029, 5e-4);
    EXPECT_NEAR(layers.openness(32, 32), 90 - 3.08, 0.05);
}

TEST(Horizon, borders_are_mirrored_without_the_border_cell_again_and_again) {
    EXPECT_EQ(index_within(-1, 5, Border::mirrored), 1);
    EXPECT_EQ(index_within(5, 5, Border::mirrored), 3);
    EXPECT_EQ(index_within(-9, 5, Border::mirrored), 1);
    EXPECT_EQ(index_within(-7, 2, Border::mirrored), 1);
    EXPECT_EQ(index_within(3, 1, Border::mirrored), 0);
    EXPECT_EQ(index_within(-3, 5, Border::repeated), 0);
    EXPECT_EQ(index_within(-3, 5, Border::nothing), -1);
}

TEST(Horizon, dominance_of_a_hill_is_above_one_and_of_a_pit_below) {
    const auto hill = [](double height) {
        return made(65, [=](double e, double n) { return height * std::exp(-(e * e + n * n) / 50); });
    };
    for (const Settings& settings : {exact(10, 24), rvt(10, 24)}) {
        EXPECT_GT(layers_of(hill(5), settings, {.dominance = true}).dominance(32, 32), 2);
        EXPECT_LT(layers_of(hill(-5), settings, {.dominance = true}).dominance(32, 32), 0.1);
    }
}

TEST(Horizon, impossible_settings_are_refused) {
    const HeightField field = rough(9, 9, 1);
    for (const Settings& settings : {exact(0.3, 16), exact(1e9, 16), exact(5, 0), exact(std::nan(""), 16)})
        EXPECT_THROW((void)layers_of(field, settings, {.svf = true}), Misuse);
    Settings settings = exact(5, 16);
    settings.dominance.most = 3;
    EXPECT_THROW((void)layers_of(field, settings, {.dominance = true}), Misuse);
}

} // namespace
} // namespace scanshade::horizon
