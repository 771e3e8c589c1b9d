// CACAO among holes: with profile `scan` they do not occlude, are no open space and bend no normals. `reference` must
// fail on the same input.
#include "tests/support/cacao_runs.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using namespace tests;
using cacao_scan = CacaoTest;

TEST_F(cacao_scan, holes_do_not_occlude_and_have_no_visibility) {
    // A plane with holes is still open. A hole has depth 0, the position of the camera. If that is within the radius,
    // the reference takes the hole for an occluder in front of the plane.
    DepthImage depth = with_holes(flat(camera_of(125), 0.3F), 0.1);
    CacaoOptions o = options();
    o.radius = 2;
    const Both maps = both(o, depth);
    const cv::Mat surface = depth.z_m > 0;
    measured("darkest pixel of a plane with holes", lowest(maps.scan.visibility, surface),
             lowest(maps.reference.visibility, surface));
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_LT(lowest(maps.reference.visibility, surface), 0.2);
    EXPECT_EQ(cv::countNonZero((maps.scan.visibility == maps.scan.visibility) != surface), 0)
        << "NaN at holes, only there";
    EXPECT_GT(cv::countNonZero((maps.reference.visibility == maps.reference.visibility) & ~surface), 0);
}

TEST_F(cacao_scan, holes_are_not_open_space) {
    // A corner stays as dark when pixels are removed, at random or one whole slice of the four. Beyond the radius the
    // reference counts a hole as a ray without a hit, and loses a quarter of the darkness. (Scan still loses 1 % where
    // 40 % of the pixels are missing. The tolerance comes from that measurement, not from a derivation.)
    const Pinhole camera = camera_of(125);
    const DepthImage corner = wall_corner(camera);
    DepthImage sliced{camera, corner.z_m.clone(), {}};
    for (int y = 1; y < usual.height; y += 2)
        for (int x = 1; x < usual.width; x += 2)
            sliced.z_m(y, x) = 0;
    cv::Mat3f normals(usual);
    const float s = std::numbers::sqrt2_v<float> / 2;
    for (int x = 0; x < usual.width; ++x)
        normals.col(x) = cv::Vec3f(x < camera.cx ? s : -s, 0, -s);
    CacaoOptions o = options(); // weak and linear: a strong effect brightens where fewer taps make it noisier
    o.shadow_multiplier = 0.5F;
    o.shadow_power = 1;
    const Both whole = both(o, corner, {normals, {}});
    for (const DepthImage& punched : {with_holes(corner, 0.4), sliced}) {
        const Both rest = both(o, punched, {normals, {}});
        cv::Mat near = cv::Mat::zeros(usual, CV_8U);
        near.colRange(60, 100) = 255;
        near &= punched.z_m > 0;
        const auto darkness = [&](const cv::Mat1f& v) { return 1 - average(v, near); };
        const double scan = darkness(rest.scan.visibility) / darkness(whole.scan.visibility);
        const double amd = darkness(rest.reference.visibility) / darkness(whole.reference.visibility);
        measured("darkness of a corner left by holes", scan, amd);
        EXPECT_NEAR(scan, 1, 0.02);
        EXPECT_LT(amd, 0.8);
    }
}

TEST_F(cacao_scan, a_checkerboard_of_holes_changes_nothing) {
    // Every other pixel is missing, so no pixel has a neighbour, and two of the four slices are empty. Scan
    // interpolates 1/z across a hole of one pixel: normals use the pixel beyond it, and the filled hole serves as an
    // occluder.
    const DepthImage corner = wall_corner(test_camera(usual));
    DepthImage board{corner.camera, corner.z_m.clone(), {}};
    for (int y = 0; y < usual.height; ++y)
        for (int x = (y + 1) % 2; x < usual.width; x += 2)
            board.z_m(y, x) = 0;
    const cv::Mat left = board.z_m > 0;
    const auto changed = [&](const Seen& with, const Seen& without) {
        return std::sqrt(cv::norm(with.visibility, without.visibility, cv::NORM_L2SQR, left) / cv::countNonZero(left));
    };
    for (const Quality quality : {Quality::lowest, Quality::low, Quality::high, Quality::highest}) {
        const CacaoOptions o = options(quality);
        const Both whole = both(o, corner), punched = both(o, board);
        measured(fmt::format("{}, RMS change", name_of(quality)), changed(punched.scan, whole.scan),
                 changed(punched.reference, whole.reference));
        EXPECT_LT(changed(punched.scan, whole.scan), 0.005);
        EXPECT_GT(changed(punched.reference, whole.reference), 0.1);
        EXPECT_EQ(cv::countNonZero((punched.scan.visibility == punched.scan.visibility) != left), 0)
            << "holes get no visibility";
    }
}

TEST_F(cacao_scan, a_hole_of_device_depth_is_a_hole) {
    // 0 in the depth image is no surface (projection/maps.h), in device depth, too. With reverse-Z a cleared buffer
    // holds 0, which means infinitely far.
    for (const CacaoDepthInput kind : {CacaoDepthInput::normal_z, CacaoDepthInput::reverse_z})
        for (const Quality quality : {Quality::lowest, Quality::high})
            for (const bool downsampled : {false, true}) {
                CacaoOptions o = options(quality, downsampled);
                o.depth_input = kind;
                o.radius = 2;
                const float d =
                    kind == CacaoDepthInput::normal_z ? 0.66673334F : 0.33326666F; // 0.3 m between 0.1 and 1000 m
                DepthImage depth = flat(camera_of(125), d);
                depth.z_m(cv::Rect(60, 40, 20, 20)) = 0;
                const cv::Mat1f v = run(o, depth).visibility;
                const std::string run_name = fmt::format("{} {} {}", name_of(kind), name_of(quality), downsampled);
                EXPECT_TRUE(std::isnan(v(50, 70))) << run_name << ": " << v(50, 70);
                EXPECT_GE(lowest(v), 0.999) << run_name;
            }
}

TEST_F(cacao_scan, a_hole_does_not_poison_the_mips) {
    // The mean of the known depths of a wall at 3 m is 3 m. The reference takes the nearest of each four, and a hole is
    // nearest: one missing pixel empties 16x16 of them in mip 3.
    DepthImage depth = flat(camera_of(125), 3);
    depth.z_m(40, 40) = 0;
    const Both maps = both(options(), depth);
    for (std::size_t m = 1; m < 4; ++m) {
        EXPECT_EQ(lowest(maps.scan.depth[0][m]), 3) << "mip " << m;
        EXPECT_EQ(lowest(maps.reference.depth[0][m]), 0) << "mip " << m;
    }
    measured("mip 3 over one hole", maps.scan.depth[0][3](2, 2), maps.reference.depth[0][3](2, 2));
}

TEST_F(cacao_scan, normals_beside_holes_are_true_or_absent) {
    // More than half of a slope is missing. A complete quadrant gives the normal of the plane. Without one, scan takes
    // the neighbours' normals, or none. AMD guesses a normal that faces the camera.
    const double tilt = 60;
    const DepthImage depth = with_holes(tilted_plane(camera_of(200), tilt), 0.6);
    const Both maps = both(options(), depth);
    const cv::Vec3f truth = plane_normals({1, 1}, tilt)(0, 0);
    const auto found = [&](const Seen& seen) {
        int wrong = 0, none = 0, texels = 0;
        for (std::size_t a = 0; a < 4; ++a)
            for (int y = 1; y + 1 < seen.k.slice.y; ++y)
                for (int x = 1; x + 1 < seen.k.slice.x; ++x) {
                    if (seen.depth[a][0](y, x) == 0)
                        continue;
                    ++texels;
                    const cv::Vec3f n = seen.normals[a](y, x);
                    none += cv::norm(n) < 0.5;
                    wrong += cv::norm(n) >= 0.5 && cv::normalize(n).dot(truth) < std::cos(2 * std::numbers::pi / 180);
                }
        return std::pair(static_cast<double>(wrong) / texels, static_cast<double>(none) / texels);
    };
    measured("share of wrong normals", found(maps.scan).first, found(maps.reference).first);
    measured("share of absent normals", found(maps.scan).second, found(maps.reference).second);
    EXPECT_EQ(found(maps.scan).first, 0);
    EXPECT_GT(found(maps.reference).first, 0.02);
}

} // namespace
} // namespace scanshade
