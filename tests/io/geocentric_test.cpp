// Places on the Earth, against closed forms of ellipsoid and transverse Mercator projection.
#include "io/rasters/geocentric.h"
#include "projection/base/error.h"
#include "tests/support/says.h"

#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <numbers>

namespace scanshade::rasters {
namespace {

using Eigen::Vector3d;

constexpr double degree = std::numbers::pi / 180, equator = 6378137, flattening = 1 / 298.257223563,
                 squared = flattening * (2 - flattening); // of the eccentricity

Vector3d on_ellipsoid(double longitude, double latitude, double height) {
    const double across = equator / std::sqrt(1 - squared * std::pow(std::sin(latitude), 2));
    return {(across + height) * std::cos(latitude) * std::cos(longitude),
            (across + height) * std::cos(latitude) * std::sin(longitude),
            (across * (1 - squared) + height) * std::sin(latitude)};
}

/// Krueger's series (1912) to the fourth order, exact to less than a millimetre.
Vector3d utm(double longitude, double latitude, double height, double central) {
    const double n = flattening / (2 - flattening), e = std::sqrt(squared), sine = std::sin(latitude);
    const double t = std::sinh(std::atanh(sine) - e * std::atanh(e * sine)), along = longitude - central;
    const double xi = std::atan2(t, std::cos(along)), eta = std::atanh(std::sin(along) / std::sqrt(1 + t * t));
    const std::array<double, 4> alpha{n / 2 - 2 * n * n / 3 + 5 * std::pow(n, 3) / 16 + 41 * std::pow(n, 4) / 180,
                                      13 * n * n / 48 - 3 * std::pow(n, 3) / 5 + 557 * std::pow(n, 4) / 1440,
                                      61 * std::pow(n, 3) / 240 - 103 * std::pow(n, 4) / 140,
                                      49561 * std::pow(n, 4) / 161280};
    double x = eta, y = xi;
    for (std::size_t k = 0; k < alpha.size(); ++k) {
        const double j = 2 * (static_cast<double>(k) + 1);
        x += alpha[k] * std::cos(j * xi) * std::sinh(j * eta);
        y += alpha[k] * std::sin(j * xi) * std::cosh(j * eta);
    }
    const double radius = 0.9996 * equator / (1 + n) * (1 + n * n / 4 + std::pow(n, 4) / 64);
    return {500000 + radius * x, radius * y, height};
}

Vector3d placed(const Geocentric& earth, Vector3d point) {
    earth.place({&point, 1});
    return point;
}

TEST(Geocentric, places_a_projected_survey_to_a_millimetre) {
    const Geocentric earth(crs_of_code("EPSG:32633"));
    for (const double longitude : {12.1, 14.9, 17.5})
        for (const double latitude : {1.0, 52.5, 70.0}) {
            const Vector3d point = utm(longitude * degree, latitude * degree, 40, 15 * degree);
            EXPECT_LT((placed(earth, point) - on_ellipsoid(longitude * degree, latitude * degree, 40)).norm(), 1e-3);
        }
    EXPECT_EQ(earth.system(), "EPSG:32633");
    EXPECT_TRUE(tests::says(earth.heights(), "heights are taken as ellipsoidal"));
}

TEST(Geocentric, takes_degrees_with_longitude_first) {
    const Geocentric earth(crs_of_code("EPSG:4326"));
    EXPECT_LT((placed(earth, {13, 52, 40}) - on_ellipsoid(13 * degree, 52 * degree, 40)).norm(), 1e-3);
}

TEST(Geocentric, takes_heights_in_their_unit) {
    Crs feet = crs_of_code("EPSG:2227"); // California, feet of the US survey
    feet.height_unit_m = 1200.0 / 3937;
    const Geocentric earth(feet);
    const double rise = (placed(earth, {6e6, 2.1e6, 100}) - placed(earth, {6e6, 2.1e6, 0})).norm();
    EXPECT_NEAR(rise, 120000.0 / 3937, 1e-4);
}

TEST(Geocentric, uses_a_geoid_that_is_installed_and_reports_one_that_is_not) {
    const auto with_heights = [](std::uint16_t code) {
        Crs crs = crs_of_code("EPSG:32633");
        crs.keys.directory = {1, 1, 0, 1, 4096, 0, 1, code};
        return crs;
    };
    const Vector3d point = utm(14 * degree, 52 * degree, 40, 15 * degree);
    const Geocentric missing(with_heights(7837)); // DHHN2016, whose grid is not in Debian
    EXPECT_TRUE(tests::says(missing.heights(), "the geoid of the heights (EPSG:7837) is not installed"));
    EXPECT_LT((placed(missing, point) - on_ellipsoid(14 * degree, 52 * degree, 40)).norm(), 1e-3);
    const Geocentric egm(with_heights(5773)); // EGM96: about 41 m above the ellipsoid here
    if (!egm.heights().empty())
        GTEST_SKIP() << "PROJ's grid egm96_15.gtx is not there";
    EXPECT_NEAR((placed(egm, point) - on_ellipsoid(14 * degree, 52 * degree, 40)).norm(), 41, 2);
}

TEST(Geocentric, refuses_unknown_systems_and_marks_points_without_a_place) {
    EXPECT_TRUE(tests::says(tests::refusal([] { (void)Geocentric(crs_of_code("EPSG:1")); }),
                            "PROJ knows no way from the coordinate system \"EPSG:1\""));
    for (const char* words : {"32633", "EPSG:", "EPSG:x", "EPSG:12x", "EPSG:-3"})
        EXPECT_TRUE(tests::says(tests::refusal([&] { (void)crs_of_code(words); }), "expected a code")) << words;
    const Geocentric earth(crs_of_code("EPSG:32633"));
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(placed(earth, {nan, nan, nan}).array().isNaN().all());
    EXPECT_TRUE(placed(earth, {1e30, 1e30, 0}).array().isNaN().all());
}

TEST(Geocentric, axes_at_a_place_are_east_north_and_up) {
    for (const auto& [longitude, latitude] : {std::pair(0.2, 0.9), {-2.0, -0.3}, {0.0, std::numbers::pi / 2}}) {
        const Vector3d place = on_ellipsoid(longitude, latitude, 300);
        const Eigen::Isometry3d axes = east_north_up(place);
        EXPECT_NEAR(axes.linear().determinant(), 1, 1e-12);
        EXPECT_LT((axes.linear() * axes.linear().transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
        EXPECT_LT((axes * Vector3d(0, 0, 100) - on_ellipsoid(longitude, latitude, 400)).norm(), 1e-4);
        EXPECT_GE((axes.linear() * Vector3d(0, 1, 0)).z(), 0) << "north";
    }
}

} // namespace
} // namespace scanshade::rasters
