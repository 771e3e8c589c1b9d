// Classes of pixels by which bench tells errors apart (place, distance from edges, angle), and the bias that a curve
// leaves.
#include "ao/compare.h"
#include "apps/compare/error_classes.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

/// A wall at 3 m, and before it at 2 m a board from column 20 to column 59 and a pole 3 pixels wide: at 525 pixels of
/// focal length 1.1 cm.
struct WallWithPole {
    Pinhole camera{525, 525, 59.5, 39.5, {120, 80}};
    cv::Mat1f z_m = cv::Mat1f(80, 120, 3.0F), truth = cv::Mat1f(80, 120, 1.0F);
    WallWithPole() {
        z_m.colRange(20, 60).setTo(2);
        z_m.colRange(90, 93).setTo(2);
    }
    [[nodiscard]] cv::Mat1b places(const cv::Mat1f& recorded) const {
        return by_place(z_m, recorded, truth, camera).of;
    }
};

TEST(PlaceTest, a_pole_is_thin_and_a_board_is_not) {
    const WallWithPole scene;
    const cv::Mat1b of = scene.places(scene.z_m);
    EXPECT_EQ(cv::countNonZero(of == thin_thing), 3 * 80) << "the pole, and nothing else";
    EXPECT_EQ(of(40, 91), thin_thing);
    EXPECT_EQ(of(40, 22), near_edge);
    EXPECT_EQ(of(40, 40), open_flat) << "20 pixels from the board's edges";
}

TEST(PlaceTest, the_first_class_that_fits_counts) {
    WallWithPole scene;
    cv::Mat1f recorded = scene.z_m.clone();
    recorded(cv::Rect(38, 38, 2, 2)).setTo(0);
    scene.truth(42, 41) = 0.1F; // in a corner beside the hole
    scene.truth(42, 36) = std::nanf("");
    const cv::Mat1b of = scene.places(recorded);
    EXPECT_EQ(of(40, 36), near_hole);
    EXPECT_EQ(of(42, 41), deep_corner);
    EXPECT_EQ(of(42, 36), PixelClasses::none) << "nothing to compare with";
    EXPECT_EQ(of(40, 45), open_flat) << "6 pixels from the hole";
    scene.truth.setTo(0.5);
    EXPECT_EQ(scene.places(scene.z_m)(40, 40), between_them);
    EXPECT_EQ(cv::countNonZero(scene.places(scene.z_m) == near_hole), 0)
        << "where there is no hole, nothing is near one";
}

TEST(PairSumsTest, knows_the_bias_that_a_curve_leaves) {
    PairSums pairs;
    for (int i = 0; i < 100; ++i)
        pairs.add(0.5F, 0.2F);
    EXPECT_NEAR(pairs.bias({}), 0.3, 1e-6);
    EXPECT_NEAR(pairs.bias({1, 2}), 0.25 - 0.2, 1e-6);
    EXPECT_TRUE(std::isnan(PairSums().bias({})));
}

TEST(ErrorClassTest, the_pixels_at_a_step_are_the_nearest_to_an_edge) {
    cv::Mat1f z_m(20, 40, 1.0F);
    z_m.colRange(20, 40) = 2.0F;
    const PixelClasses classes = by_edge_distance(z_m);
    EXPECT_EQ(classes.of(10, 19), 0);
    EXPECT_EQ(classes.of(10, 20), 0);
    EXPECT_EQ(classes.names[classes.of(10, 18)], "1 .. 2 px");
    EXPECT_EQ(classes.names[classes.of(10, 5)], "8 .. 16 px");
    z_m(3, 3) = 0;
    EXPECT_EQ(by_edge_distance(z_m).of(3, 3), PixelClasses::none);
    EXPECT_EQ(by_edge_distance(z_m).of(3, 4), 0) << "depth ends at a hole";
}

/// A plane through (0, 0, 2) whose normal is tilted by `degrees` from the optical axis.
cv::Mat1f tilted_plane(const Pinhole& camera, double degrees) {
    const double slope = std::tan(degrees * std::numbers::pi / 180);
    cv::Mat1f z_m(camera.size);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 0; u < z_m.cols; ++u)
            z_m(v, u) = static_cast<float>(2 / (1 - slope * camera.ray(u, v).x()));
    return z_m;
}

TEST(ErrorClassTest, a_tilted_plane_has_its_angle_and_no_edges) {
    const Pinhole camera{500, 500, 31.5, 23.5, {64, 48}};
    const cv::Mat1f z_m = tilted_plane(camera, 52); // rays are up to 4 degrees off the axis: 48 .. 56
    const PixelClasses angles = by_grazing_angle(z_m, camera), edges = by_edge_distance(z_m);
    for (int v = 0; v < z_m.rows; ++v)
        for (int u = 8; u < z_m.cols - 8; ++u) {
            EXPECT_EQ(angles.names[angles.of(v, u)], "45 .. 60 deg");
            EXPECT_EQ(edges.of(v, u), edges.names.size() - 1);
        }
}

} // namespace
} // namespace scanshade
