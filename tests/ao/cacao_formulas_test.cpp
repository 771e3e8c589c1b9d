// CACAO's shaders agree with the formulas of AMD's documentation, computed once more on the CPU.
#include "tests/reference/cacao_cpu.h"
#include "tests/support/cacao_runs.h"
#include "tests/support/scenes.h"

#include <array>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;
using reference::Around;
using cacao_formulas = CacaoTest;

constexpr float near_enough = 1e-6F;

TEST_F(cacao_formulas, every_setting_that_amds_host_takes_is_taken) {
    // Section 2 of the specification: documented ranges, and what the host clamps to where that is wider. A radius of 0
    // is left out, since AMD's constants are then infinite.
    struct Case {
        const char* name;
        std::vector<const char*> values;
    };
    for (const Case& of : {Case{"radius", {"0.0001", "100000"}},
                           {"shadow-multiplier", {"0", "5"}},
                           {"shadow-power", {"0", "10"}},
                           {"shadow-clamp", {"0", "1"}},
                           {"horizon-angle", {"0", "0.3", "1"}},
                           {"fade-to", {"0.001", "1e30"}},
                           {"adaptive-limit", {"0", "1"}},
                           {"blur-passes", {"0", "8"}},
                           {"sharpness", {"0", "1"}},
                           {"detail-strength", {"0", "5", "100"}},
                           {"sigma-squared", {"0.001", "1e6"}},
                           {"depth-sigma-squared", {"1e-9", "1e6"}}})
        for (const char* value : of.values)
            for (const CacaoProfile profile : {CacaoProfile::scan, CacaoProfile::reference}) {
                CacaoOptions o = options(Quality::high, false, profile);
                bool found = false;
                for (const Parameter& row : o.parameters())
                    if (row.name == of.name) {
                        found = true;
                        EXPECT_NO_THROW(set(row, std::string(value))) << of.name << " " << value;
                    }
                EXPECT_TRUE(found) << of.name;
                EXPECT_NO_THROW(Cacao(device(), o)) << of.name << " " << value;
            }
}

TEST_F(cacao_formulas, a_horizon_of_one_occludes_nothing) {
    // No sample is higher above the surface than straight up, whose sine is 1.
    CacaoOptions o = options();
    const DepthImage depth = step(camera_of(125), 1.8F, 2);
    EXPECT_LT(lowest(both(o, depth).scan.visibility), 0.9);
    o.horizon_angle = 1;
    const Both maps = both(o, depth);
    EXPECT_GE(lowest(maps.scan.visibility), 0.999);
    EXPECT_GE(lowest(maps.reference.visibility), 0.999);
}

TEST_F(cacao_formulas, a_power_of_zero_leaves_numbers) {
    // Full strength without a clamp makes visibility 0, and 0 to the power 0 is no number in shaders.
    CacaoOptions o = options();
    o.shadow_multiplier = 5;
    o.shadow_clamp = 1;
    o.shadow_power = 0;
    const DepthImage depth = step(camera_of(125), 1.8F, 2);
    const Both maps = both(o, depth);
    EXPECT_EQ(cv::countNonZero(maps.scan.visibility == maps.scan.visibility), depth.z_m.size().area());
    EXPECT_EQ(cv::countNonZero(maps.reference.visibility == maps.reference.visibility), depth.z_m.size().area());
}

TEST_F(cacao_formulas, the_cpu_reference_has_the_documented_values) {
    // The specification's worked values check the formulas with which the tests below compare the shaders.
    const Around e = reference::edges(2, {2.1F, 1.95F, 2, 3});
    EXPECT_NEAR(e.left, 0.675, 2e-6);
    EXPECT_NEAR(e.right, 0.675, 2e-6);
    EXPECT_EQ(e.top, 1);
    EXPECT_EQ(e.bottom, 0);
    EXPECT_EQ(reference::packed({1, 0.5F, 0.2F, 0}), 228);
    EXPECT_NEAR(reference::nearest_mean({2, 2.5F, 3.2F, 2.1F}, -1), 2.172993, near_enough);
    const Around weights = reference::unpacked(reference::packed({1, 0, 0.6F, 0.3F}), 0.02F);
    EXPECT_NEAR(weights.right, 0.02, near_enough);
    EXPECT_NEAR(weights.top, 0.686667, near_enough);
    EXPECT_NEAR(weights.bottom, 0.353333, near_enough);
    EXPECT_NEAR(reference::blurred(0.8F, {0.7F, 0.2F, 0.9F, 0.4F}, weights), 0.727865, near_enough);
    CacaoConstants k{};
    k.shadow_strength = 4.3F;
    k.shadow_clamp = 0.98F;
    k.shadow_power = 1.5F;
    EXPECT_NEAR(reference::visibility(k, 0.12F, 1), 0.336719, near_enough);
    EXPECT_NEAR(std::pow(reference::visibility(k, 0.12F, 1), 2.2), 0.091199, near_enough);
}

TEST_F(cacao_formulas, constants_follow_the_camera) {
    // Section 7 of the specification works one camera through, section 11.1 one texel and one tap of it.
    CacaoOptions o = options(Quality::high, false, CacaoProfile::reference);
    const Pinhole camera{525, 525, 319.5, 239.5, {640, 480}};
    const CacaoConstants k = constants_from(o, camera);
    EXPECT_NEAR(k.view_mul.x, 1.2190476, near_enough);
    EXPECT_NEAR(k.view_mul.y, -0.9142857, near_enough);
    EXPECT_NEAR(k.view_add.x, -0.6095238, near_enough);
    EXPECT_NEAR(k.view_add.y, 0.4571429, near_enough);
    EXPECT_NEAR(k.near_limit_rec, 0.7619048, near_enough);
    o.quality = Quality::low;
    EXPECT_NEAR(constants_from(o, camera).near_limit_rec, 0.5079365, near_enough);

    const std::array<cv::Mat1f, 4> depth{cv::Mat1f(240, 320, 2.0F), {}, {}, {}};
    const reference::High slice{k, 2, depth, {}};
    const auto t = slice.texel(100, 60);
    EXPECT_NEAR(t.u, 0.3140625, near_enough);
    EXPECT_NEAR(t.v, 0.2520833, near_enough);
    EXPECT_NEAR(t.point[0], -0.453333, near_enough);
    EXPECT_NEAR(t.point[1], 0.453333, near_enough);
    EXPECT_EQ(t.radius, 0.5F);
    EXPECT_NEAR(t.step_x, 0.00761905, near_enough);
    EXPECT_NEAR(t.step_y, -0.00761905, near_enough);
    EXPECT_NEAR(t.disc, 55.78125, 1e-4);
    EXPECT_EQ(t.falloff, -4);
    const reference::Tap& tap = reference::taps_of_high()[0];
    EXPECT_NEAR(slice.offset(tap, t, 100, 60)[0], -44.088, 1e-3);
    EXPECT_NEAR(slice.offset(tap, t, 100, 60)[1], 31.828, 1e-3);
    EXPECT_EQ(reference::High::mip(tap, t), 1);
    const auto d = slice.place(t.u - 44 * k.slice_inv.x, t.v + 32 * k.slice_inv.y, 1.8F) - k.depth_offset * t.point;
    EXPECT_NEAR(d[0], -0.256744, 2e-6);
    EXPECT_NEAR(d[1], -0.264399, 2e-6);
    EXPECT_NEAR(d[2], -0.198400, 2e-6);
    EXPECT_NEAR(reference::obscurance({0, 0, -1}, d, t.falloff, k.horizon), 0.123895, 2e-6);
    EXPECT_EQ(tap.weight, 1.5F);
}

/// Counts of a comparison of many values.
struct Agreement {
    int equal = 0, all = 0;
    void add(bool same) { equal += same, ++all; }
    [[nodiscard]] double share() const {
        fmt::print("             {} of {} agree\n", equal, all);
        return static_cast<double>(equal) / all;
    }
};

TEST_F(cacao_formulas, edges_are_those_of_the_documentation) {
    // Every packed edge byte of a scene, from the depth slices. Ties may round the other way.
    const Both maps = both(options(Quality::medium), ball_on_floor(camera_of(125)));
    for (const Seen* seen : {&maps.scan, &maps.reference}) {
        const bool scan = seen == &maps.scan;
        Agreement agreement;
        for (std::size_t a = 0; a < 4; ++a) {
            const cv::Mat1f& z = seen->depth[a][0];
            for (int y = 1; y + 1 < z.rows; ++y)
                for (int x = 1; x + 1 < z.cols; ++x) {
                    const Around around{z(y, x - 1), z(y, x + 1), z(y - 1, x), z(y + 1, x)};
                    const Around e =
                        scan ? reference::edges_of_inverse(z(y, x), around) : reference::edges(z(y, x), around);
                    agreement.add(reference::packed(e) == seen->raw[a].edges(y, x));
                }
        }
        EXPECT_GE(agreement.share(), 0.999) << (scan ? "scan" : "reference");
    }
}

TEST_F(cacao_formulas, mips_are_means_of_the_nearest_surface) {
    // Mip 1 from the full-precision depth. AMD's weight always assumes a radius of 1, and its stored copies are
    // binary16.
    const DepthImage depth = ball_on_floor(camera_of(125));
    const Both maps = both(options(), depth);
    for (const Seen* seen : {&maps.scan, &maps.reference}) {
        const bool scan = seen == &maps.scan;
        const float phi = scan ? -1 / (0.5F * 0.5F) : -1;
        Agreement agreement;
        for (int a = 0; a < 4; ++a) {
            const cv::Mat1f& mip = seen->depth[static_cast<std::size_t>(a)][1];
            const auto at = [&](int x, int y) { return depth.z_m(2 * y + a / 2, 2 * x + a % 2); };
            for (int y = 0; y < mip.rows; ++y)
                for (int x = 0; x < mip.cols; ++x) {
                    const float expected = reference::nearest_mean(
                        {at(2 * x, 2 * y), at(2 * x, 2 * y + 1), at(2 * x + 1, 2 * y), at(2 * x + 1, 2 * y + 1)}, phi);
                    if (scan)
                        agreement.add(std::abs(mip(y, x) - expected) <= 1e-6F * expected);
                    else
                        agreement.add(mip(y, x) == reference::half_toward_zero(expected));
                }
        }
        EXPECT_GE(agreement.share(), 0.999) << (scan ? "scan" : "reference");
    }
}

TEST_F(cacao_formulas, normals_are_those_of_the_four_quadrants) {
    // Every derived normal of a scene with holes, from depth, up to one step of its storage. The reference replicates
    // depth at the rim and knows no holes (it is given none); scan takes a hole of one pixel to lie on the line of 1/z
    // to what is beyond it, within the block of 2x2 and the pixels around it. It has no normal where no quadrant is
    // whole.
    const DepthImage whole = ball_on_floor(camera_of(125)), punched = with_holes(whole, 0.2);
    for (const bool scan : {true, false}) {
        const DepthImage& depth = scan ? punched : whole;
        const Seen seen =
            run(options(Quality::high, false, scan ? CacaoProfile::scan : CacaoProfile::reference), depth);
        const Pinhole& camera = depth.camera;
        const auto z_at = [&](int x, int y) {
            const bool inside = cv::Rect({0, 0}, usual).contains({x, y});
            if (scan && !inside)
                return 0.0F;
            return depth.z_m(std::clamp(y, 0, usual.height - 1), std::clamp(x, 0, usual.width - 1));
        };
        const auto place = [&](int x, int y, double z) {
            const Eigen::Vector3f point = camera.point(x, y, z).cast<float>();
            return cv::Vec3f(point.x(), -point.y(), point.z());
        };
        Agreement agreement;
        for (int y = 0; y < usual.height; ++y)
            for (int x = 0; x < usual.width; ++x) {
                if (depth.z_m(y, x) == 0)
                    continue;
                const float own = z_at(x, y);
                const auto towards = [&](int dx, int dy) {
                    const float next = z_at(x + dx, y + dy), beyond = z_at(x + 2 * dx, y + 2 * dy);
                    const bool across_the_block = dx == 1 - 2 * (x % 2) || dy == 1 - 2 * (y % 2);
                    return scan && across_the_block && next == 0 && beyond > 0 ? 2 / (1 / own + 1 / beyond) : next;
                };
                const Around z{towards(-1, 0), towards(1, 0), towards(0, -1), towards(0, 1)};
                const Around e = scan ? reference::edges_of_inverse(own, z) : reference::edges(own, z);
                const cv::Vec3f n =
                    reference::normal_of(e, place(x, y, own), place(x - 1, y, z.left), place(x + 1, y, z.right),
                                         place(x, y - 1, z.top), place(x, y + 1, z.bottom));
                if (scan && cv::norm(n) < 0.01)
                    continue; // taken from a neighbour, or absent: another test
                const cv::Vec3f ours = seen.normals[static_cast<std::size_t>(x % 2 + 2 * (y % 2))](y / 2, x / 2);
                agreement.add(cv::norm(cv::normalize(n) - ours, cv::NORM_INF) <= 1.01 / (scan ? 511 : 127));
            }
        EXPECT_GE(agreement.share(), 0.998) << (scan ? "scan" : "reference");
        EXPECT_GT(agreement.all, 10000);
    }
}

TEST_F(cacao_formulas, one_blur_pass_is_the_documented_sum) {
    // From the AO and edges before the blur. The reference mirrors at the rim and rounds to 8 bits. Scan has 16 bits,
    // and nothing passes a cut edge.
    CacaoOptions o = options();
    o.blur_passes = 1;
    const Both maps = both(o, ball_on_floor(camera_of(125)));
    for (const Seen* seen : {&maps.scan, &maps.reference}) {
        const bool scan = seen == &maps.scan;
        Agreement agreement;
        for (std::size_t a = 0; a < 4; ++a) {
            const cv::Mat1f& v = seen->raw[a].ao;
            const auto half = [&](float value) { return scan ? value : reference::half_even(value); };
            for (int y = 0; y < v.rows; ++y)
                for (int x = 0; x < v.cols; ++x) {
                    const auto at = [&](int u, int w) {
                        return half(v(std::clamp(w, 0, v.rows - 1), std::clamp(u, 0, v.cols - 1)));
                    };
                    const int byte = seen->raw[a].edges(y, x);
                    Around e = reference::unpacked(byte, o.sharpness < 1 ? 1 - o.sharpness : 0);
                    if (scan)
                        e = {byte >> 6 & 3 ? e.left : 0, byte >> 4 & 3 ? e.right : 0, byte >> 2 & 3 ? e.top : 0,
                             byte & 3 ? e.bottom : 0};
                    const float expected =
                        reference::blurred(at(x, y), {at(x - 1, y), at(x + 1, y), at(x, y - 1), at(x, y + 1)}, e);
                    const float ours = seen->blurred[a].ao(y, x);
                    if (scan)
                        agreement.add(std::abs(ours - expected) <= 1.01F / 65535);
                    else
                        agreement.add(std::nearbyint(255 * ours) == std::nearbyint(255 * half(expected)));
                    EXPECT_EQ(seen->blurred[a].edges(y, x), byte);
                }
        }
        EXPECT_GE(agreement.share(), 0.999) << (scan ? "scan" : "reference");
    }
}

TEST_F(cacao_formulas, high_is_the_documented_kernel) {
    // Every texel of every slice, from its depth mips and normals: 12 tap pairs, detail shadows, edges,
    // fade. Ties of taps and mips may go the other way.
    const Seen seen = run(options(Quality::high, false, CacaoProfile::reference), ball_on_floor(camera_of(125)));
    Agreement agreement;
    for (int a = 0; a < 4; ++a) {
        const auto i = static_cast<std::size_t>(a);
        const reference::High cpu{seen.k, a, seen.depth[i], seen.normals[i]};
        for (int y = 0; y < seen.k.slice.y; ++y)
            for (int x = 0; x < seen.k.slice.x; ++x)
                agreement.add(std::abs(std::nearbyint(255 * cpu(x, y)) - std::nearbyint(255 * seen.raw[i].ao(y, x))) <=
                              1);
    }
    EXPECT_GE(agreement.share(), 0.999);
}

} // namespace
} // namespace scanshade
