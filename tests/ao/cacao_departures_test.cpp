// Where CACAO's profile `scan` departs from AMD's: it must hold each property, and `reference` must fail on the same
// input. What concerns holes is in cacao_holes_test.
#include "tests/support/cacao_runs.h"
#include "tests/support/scenes.h"

#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace scanshade {
namespace {

using namespace tests;
using cacao_scan = CacaoTest;

TEST_F(cacao_scan, visibility_comes_out_as_computed) {
    // All slices say 0.5, so the map must say 0.5. AMD raises it to 2.2 on the way out, but not in every quality.
    const Given half{{}, [](int, const Slice& made) { return Slice{cv::Mat1f(made.ao.size(), 0.5F), made.edges}; }};
    const double dark = std::pow(128.0 / 255, 2.2);
    for (const auto& [quality, expected] : {std::pair(Quality::low, 128.0 / 255), {Quality::high, dark}}) {
        CacaoOptions o = options(quality);
        o.blur_passes = 0;
        const Both maps = both(o, flat(camera_of(125), 3), half);
        measured(name_of(quality), average(maps.scan.visibility), average(maps.reference.visibility));
        EXPECT_NEAR(lowest(maps.scan.visibility), 0.5, 1e-4);
        EXPECT_NEAR(highest(maps.scan.visibility), 0.5, 1e-4);
        EXPECT_NEAR(average(maps.reference.visibility), expected, 0.005);
    }
}

TEST_F(cacao_scan, mips_know_the_radius) {
    // A scene and radius eight times as large give the same map. Every length scales by a power of two, so not even
    // rounding changes. AMD's mip weight ignores the radius and cuts at one unit: it blends poles 15 cm before a wall
    // with the wall, but not poles 1.2 m before it.
    DepthImage fence = flat(camera_of(125), 0.5F);
    for (int x = 0; x < usual.width; ++x)
        if (x % 12 < 3)
            fence.z_m.col(x) = 0.35F;
    const auto at = [&](float scale) {
        CacaoOptions o = options();
        o.radius = 0.8F * scale;
        return both(o, {fence.camera, cv::Mat1f(fence.z_m * scale), {}});
    };
    const Both one = at(1), large = at(8);
    measured("eight times as large, mean difference", average(difference(one.scan.visibility, large.scan.visibility)),
             average(difference(one.reference.visibility, large.reference.visibility)));
    EXPECT_LE(highest(difference(one.scan.visibility, large.scan.visibility)), 1e-4);
    EXPECT_LE(highest(difference(one.scan.visibility, at(0.125F).scan.visibility)), 1e-4);
    EXPECT_GT(average(difference(one.reference.visibility, large.reference.visibility)), 0.01);
}

TEST_F(cacao_scan, distance_alone_takes_nothing_away) {
    // A hall 400 m away, with the radius scaled alike, gives the same map as a room 2 m away. By default AMD's AO fades
    // out from 50 to 300 m: depths of games, not of scans.
    const DepthImage near = wall_corner(test_camera(usual));
    const auto at = [&](float scale) {
        CacaoOptions o = options();
        o.radius = 0.5F * scale;
        return both(o, {near.camera, cv::Mat1f(near.z_m * scale), {}});
    };
    const Both room = at(1), hall = at(256);
    const auto darkness = [](const cv::Mat1f& v) { return 1 - average(v); };
    measured("256 times as large, darkness left", darkness(hall.scan.visibility) / darkness(room.scan.visibility),
             darkness(hall.reference.visibility) / darkness(room.reference.visibility));
    EXPECT_LE(highest(difference(room.scan.visibility, hall.scan.visibility)), 1e-4);
    EXPECT_GT(darkness(room.reference.visibility), 0.05);
    EXPECT_LT(darkness(hall.reference.visibility), 0.001);
}

TEST_F(cacao_scan, what_lies_outside_the_image_is_unknown) {
    // A plane that recedes out of the image is open up to the rim. The reference repeats the depth of the rim outside
    // the image, which is above the plane.
    const DepthImage depth = tilted_plane(camera_of(200), 60);
    const Both maps = both(options(), depth, {plane_normals(usual, 60), {}});
    const cv::Rect inside(60, 0, 40, 120);
    measured("darkest at the rim", lowest(maps.scan.visibility), lowest(maps.reference.visibility));
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_GE(lowest(maps.reference.visibility(inside)), 0.98) << "away from the rim";
    EXPECT_LT(lowest(maps.reference.visibility), 0.8);
}

TEST_F(cacao_scan, taps_look_from_the_texel_they_read) {
    // A tap of mip m reads the mean of 2^m texels across. At the centre of that texel, this depth is on the plane. At
    // the position of the tap, as in the reference, a slope becomes a staircase. Full strength and a horizon angle of 0
    // keep the steps visible.
    const cv::Size size(320, 240);
    const DepthImage depth = tilted_plane(camera_of(693, size), 60);
    const Given given{plane_normals(size, 60), {}};
    CacaoOptions o = options();
    o.radius = 1;
    o.horizon_angle = 0;
    o.shadow_multiplier = 2.3F;
    o.shadow_power = 5;
    const Both maps = both(o, depth, given);
    const cv::Rect inside(155, 0, 10, 240); // no tap of these leaves the image sideways
    o.quality = Quality::medium;
    o.profile = CacaoProfile::reference;
    measured("slope by mips", lowest(maps.scan.visibility(inside)), lowest(maps.reference.visibility(inside)));
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_LT(lowest(maps.reference.visibility(inside)), 0.9);
    EXPECT_GE(lowest(run(o, depth, given).visibility(inside)), 0.98) << "the same without mips";
}

TEST_F(cacao_scan, a_grazing_plane_is_one_surface) {
    // 1/z is linear across any plane, so a plane has no edges, however it is tilted; z is not.
    const double tilt = 80;
    const DepthImage depth = tilted_plane(camera_of(125), tilt);
    const Both maps = both(options(), depth);
    const cv::Vec3f truth = plane_normals({1, 1}, tilt)(0, 0);
    const auto found = [&](const Seen& seen) {
        int whole = 0, texels = 0;
        double worst = 0;
        for (std::size_t a = 0; a < 4; ++a)
            for (int y = 1; y + 1 < seen.k.slice.y; ++y)
                for (int x = 2; x + 2 < seen.k.slice.x; ++x) {
                    const cv::Mat1f& z = seen.depth[a][0];
                    if (lowest(z(cv::Rect(x - 2, y - 1, 5, 3))) == 0)
                        continue; // the last texel before a hole has no slope
                    ++texels;
                    whole += seen.raw[a].edges(y, x) == 0xff;
                    const double cosine = cv::normalize(seen.normals[a](y, x)).dot(truth);
                    worst = std::max(worst, std::acos(std::min(1.0, cosine)) * 180 / std::numbers::pi);
                }
        return std::pair(static_cast<double>(whole) / texels, worst);
    };
    const auto [scan_whole, scan_worst] = found(maps.scan);
    const auto [amd_whole, amd_worst] = found(maps.reference);
    measured("share of texels without an edge", scan_whole, amd_whole);
    measured("worst normal, degrees", scan_worst, amd_worst);
    EXPECT_EQ(scan_whole, 1);
    EXPECT_LT(amd_whole, 0.9);
    EXPECT_LT(scan_worst, 1);
    EXPECT_GT(amd_worst, 10);
}

TEST_F(cacao_scan, nothing_leaks_across_a_cut_edge) {
    // Left all open, right all closed, a metre apart in depth: no blur step may mix them. AMD lets 1 - sharpness
    // through every cut edge.
    const DepthImage depth = step(camera_of(125), 1, 3);
    const Given sides{{}, [](int, const Slice& made) {
                          Slice s{cv::Mat1f(made.ao.size(), 0.0F), made.edges};
                          s.ao.colRange(0, s.ao.cols / 2) = 1;
                          return s;
                      }};
    CacaoOptions o = options();
    o.blur_passes = 8;
    o.sharpness = 0.98F;
    const Both maps = both(o, depth, sides);
    const auto leak = [](const Seen& seen) {
        double bright = 1, dark = 0;
        for (const Slice& s : seen.blurred) {
            bright = std::min(bright, lowest(s.ao.colRange(0, s.ao.cols / 2)));
            dark = std::max(dark, highest(s.ao.colRange(s.ao.cols / 2, s.ao.cols)));
        }
        return std::pair(bright, dark);
    };
    measured("bright side after eight passes", leak(maps.scan).first, leak(maps.reference).first);
    measured("dark side after eight passes", leak(maps.scan).second, leak(maps.reference).second);
    EXPECT_EQ(leak(maps.scan), std::pair(1.0, 0.0));
    EXPECT_LT(leak(maps.reference).first, 0.99);
    EXPECT_GT(leak(maps.reference).second, 0.01);
}

/// Replaces generated AO by columns of the AO grid. All edges are open, or those found in depth.
Given columns(const std::function<float(int)>& value, bool found_edges = false) {
    return {{}, [=](int slice, const Slice& made) {
                Slice s{cv::Mat1f(made.ao.size()), found_edges ? made.edges : cv::Mat1b(made.ao.size(), 255)};
                for (int x = 0; x < s.ao.cols; ++x)
                    s.ao.col(x) = value(2 * x + slice % 2);
                return s;
            }};
}

CacaoOptions upsampling(Quality quality) {
    CacaoOptions o = options(quality, true);
    o.blur_passes = 0;
    return o;
}

TEST_F(cacao_scan, the_left_rim_knows_nothing_of_the_right) {
    // AMD's unsigned coordinates wrap: its halo left of the image shows AO of the right rim.
    const Both maps =
        both(upsampling(Quality::high), flat(camera_of(125), 3), columns([](int g) { return g < 70 ? 1.0F : 0.0F; }));
    const cv::Rect left(0, 0, 4, 120);
    measured("left rim, open, with the right rim closed", lowest(maps.scan.visibility(left)),
             lowest(maps.reference.visibility(left)));
    EXPECT_GE(lowest(maps.scan.visibility(left)), 0.9999);
    EXPECT_LT(lowest(maps.reference.visibility(left)), 0.9);
}

TEST_F(cacao_scan, upsampled_ao_stays_where_it_was_computed) {
    // One closed column of the grid must darken the pixels left and right of it alike. AMD's nearest samples fall on
    // texel borders, where the hardware chooses a side, and the map moves by half a grid pixel. (The window of five is
    // lopsided itself, by 0.02, at odd pixels.)
    for (const int column : {34, 35}) {
        const Both maps = both(upsampling(Quality::low), flat(camera_of(125), 3),
                               columns([&](int g) { return g == column ? 0.0F : 1.0F; }));
        const auto lopsided = [&](const Seen& seen) {
            double most = 0;
            for (int d = 1; d <= 4; ++d)
                most = std::max(most, std::abs(average(seen.visibility.col(2 * column - d)) -
                                               average(seen.visibility.col(2 * column + d))));
            return most;
        };
        measured(fmt::format("left against right of grid column {}", column), lopsided(maps.scan),
                 lopsided(maps.reference));
        EXPECT_LT(lopsided(maps.scan), 0.025);
        EXPECT_GT(lopsided(maps.reference), 0.1);
    }
}

TEST_F(cacao_scan, the_upsampler_compares_with_the_depth_of_the_same_column) {
    // A near open surface is left, a far closed one right, and their depths keep them apart. AMD reads the depth of odd
    // columns one slice texel to the right, so it takes the near rim for the far wall.
    const Both maps = both(upsampling(Quality::high), step(camera_of(125), 1, 3),
                           columns([](int g) { return g < 40 ? 1.0F : 0.0F; }, true));
    const cv::Rect left(6, 0, 74, 120), right(80, 0, 74, 120);
    measured("darkest left of the step", lowest(maps.scan.visibility(left)), lowest(maps.reference.visibility(left)));
    measured("brightest right of the step", highest(maps.scan.visibility(right)),
             highest(maps.reference.visibility(right)));
    EXPECT_GE(lowest(maps.scan.visibility(left)), 0.9999);
    EXPECT_LE(highest(maps.scan.visibility(right)), 0.0001);
    EXPECT_GT(highest(maps.reference.visibility(right)), 0.05);
}

TEST_F(cacao_scan, the_last_odd_column_counts) {
    // AMD reads the depth of the last column one column too far right, too. That is outside the image, so the column
    // has no weight.
    const auto closed = [](int column) { return columns([=](int g) { return g == column ? 0.0F : 1.0F; }); };
    const DepthImage depth = flat(camera_of(125), 3);
    const Both last = both(upsampling(Quality::high), depth, closed(79)),
               inner = both(upsampling(Quality::high), depth, closed(39));
    const auto darkening = [](const Seen& seen, int x) { return 1 - average(seen.visibility.col(x)); };
    const double scan = darkening(last.scan, 158) / darkening(inner.scan, 78),
                 amd = darkening(last.reference, 158) / darkening(inner.reference, 78);
    measured("effect of the last column against an inner one", scan, amd);
    EXPECT_GT(scan, 0.9);
    EXPECT_LT(amd, 0.6);
}

TEST_F(cacao_scan, pixels_are_where_they_are_at_odd_sizes) {
    // 33 pixels are 9 slice texels of four, 36 pixels: AMD's kernel squeezes its rays by 33/36, and a plane no longer
    // fits its own normals. At 36 pixels it does.
    const double tilt = 50;
    CacaoOptions o = options(Quality::low, true);
    o.radius = 0.8F;
    o.horizon_angle = 0;
    const auto inner = [&](const Seen& seen) { return lowest(seen.visibility(cv::Rect(12, 12, 9, 9))); };
    const auto of = [&](int width) {
        const cv::Size size(width, width);
        return both(o, tilted_plane(camera_of(40, size), tilt), {plane_normals(size, tilt), {}});
    };
    const Both odd = of(33), even = of(36);
    measured("plane of 33 pixels", inner(odd.scan), inner(odd.reference));
    measured("plane of 36 pixels", inner(even.scan), inner(even.reference));
    EXPECT_GE(lowest(odd.scan.visibility), 0.999);
    EXPECT_GE(inner(even.reference), 0.98);
    EXPECT_LT(inner(odd.reference), 0.95);
}

TEST_F(cacao_scan, depth_is_precise_from_near_to_far) {
    // A plane is open at any tilt and distance. Through a telephoto lens a pixel is 2 cm wide at 65 m. There binary16
    // has steps of 6 cm and AMD's bias covers 5, so a slope becomes a staircase. 32 bits have no such steps.
    CacaoOptions o = options();
    o.fade_from = 1e4F;
    o.fade_to = 1e5F;
    for (const double tilt : {3.0, 45.0, 80.0})
        for (const double z : {0.3, 3.0, 65.0, 100.0}) {
            const DepthImage depth = tilted_plane(camera_of(3200), tilt, z);
            o.profile = CacaoProfile::scan;
            const Seen seen = run(o, depth, {plane_normals(usual, tilt), {}});
            EXPECT_GE(lowest(seen.visibility), 0.999) << tilt << " degrees, " << z << " m";
        }
    const DepthImage slope = tilted_plane(camera_of(3200), 3, 65);
    const Both maps = both(o, slope, {plane_normals(usual, 3), {}});
    const cv::Rect inside(60, 30, 40, 60);
    measured("slope at 65 m", lowest(maps.scan.visibility(inside)), lowest(maps.reference.visibility(inside)));
    const auto error = [&](const Seen& seen) { // of slice 0, even pixels of even rows
        double most = 0;
        for (int y = 0; y < seen.k.slice.y; ++y)
            for (int x = 0; x < seen.k.slice.x; ++x)
                most = std::max<double>(most, std::abs(seen.depth[0][0](y, x) - slope.z_m(2 * y, 2 * x)));
        return most;
    };
    measured("largest error of depth, m", error(maps.scan), error(maps.reference));
    EXPECT_EQ(error(maps.scan), 0);
    EXPECT_GT(error(maps.reference), 0.05);
    EXPECT_LT(lowest(maps.reference.visibility(inside)), 0.98);
}

TEST_F(cacao_scan, the_radius_is_metric_at_close_range) {
    // A step 0.3 m aside and 0.1 m higher shades a wall within a radius of 0.5 m, at half a metre from the camera as
    // at five. The reference shrinks its radius, to less than 0.3 m here, where it would cover much of the screen.
    // How dark is not compared: perspective shows the two cameras different parts of the step.
    const auto aside = [](const Seen& seen, double pixel_m) {
        return average(seen.visibility(cv::Rect(80 + static_cast<int>(0.3 / pixel_m), 40, 1, 40)));
    };
    const Both close = both(options(), step(camera_of(125), 0.4F, 0.5F)),
               far = both(options(), step(camera_of(500), 4.9F, 5));
    measured("0.3 m from a step, camera at 0.5 m", aside(close.scan, 0.004), aside(close.reference, 0.004));
    measured("0.3 m from a step, camera at 5 m", aside(far.scan, 0.01), aside(far.reference, 0.01));
    EXPECT_LT(aside(close.scan, 0.004), 0.96);
    EXPECT_LT(aside(far.scan, 0.01), 0.98);
    EXPECT_LT(aside(far.reference, 0.01), 0.96);
    EXPECT_GE(aside(close.reference, 0.004), 0.999);
}

TEST_F(cacao_scan, pixels_need_not_be_square) {
    // The same view, sampled twice as finely down as across, shows the same shadows. AMD's disc is as high as wide in
    // pixels.
    const cv::Size tall(160, 240);
    const Both square = both(options(), ball_on_floor(camera_of(125)));
    const Both high = both(options(), ball_on_floor({125, 250, 79.5, 119.5, tall}));
    const auto apart = [](const Seen& a, const Seen& b) {
        cv::Mat1f halved;
        cv::resize(b.visibility, halved, a.visibility.size(), 0, 0, cv::INTER_AREA);
        return average(difference(a.visibility, halved).rowRange(70, 110)); // where the floor meets the wall
    };
    measured("mean difference", apart(square.scan, high.scan), apart(square.reference, high.reference));
    EXPECT_LT(apart(square.scan, high.scan), 0.02);
    EXPECT_GT(apart(square.reference, high.reference), 0.03);
}

TEST_F(cacao_scan, lowest_reads_nothing_beyond_an_odd_image) {
    // In an odd image, the last column has no partner in the other slice. AMD loads depth 0 for it, a wall at the
    // camera.
    CacaoOptions o = options(Quality::lowest);
    o.radius = 2;
    const Both odd = both(o, flat(camera_of(40, {41, 31}), 0.3F));
    o.profile = CacaoProfile::reference;
    const Seen even = run(o, flat(camera_of(40, {42, 32}), 0.3F));
    measured("darkest pixel of a plane of 41x31", lowest(odd.scan.visibility), lowest(odd.reference.visibility));
    EXPECT_GE(lowest(odd.scan.visibility), 0.999);
    EXPECT_LT(lowest(odd.reference.visibility), 0.9);
    EXPECT_GE(lowest(even.visibility), 0.98);
}

} // namespace
} // namespace scanshade
