// Textures of occlusion: each texel once, values of a closed form, no seam, margins, overlap.
#include "ao/texture/texture_ao.h"

#include "projection/base/error.h"

#include <cmath>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using Eigen::Vector2f, Eigen::Vector3d;

/// A mesh of rectangles, each with a chart: a place in the image for its corner, and for its two sides.
struct Charts {
    std::vector<Vector3d> points;
    std::vector<std::array<int, 3>> triangles;
    std::vector<TextureCorners> corners;
    std::vector<int> faces;

    void add(const Vector3d& at, const Vector3d& s, const Vector3d& t, const Vector2f& o, const Vector2f& u,
             const Vector2f& v) {
        const int k = static_cast<int>(points.size());
        points.insert(points.end(), {at, at + s, at + s + t, at + t});
        triangles.insert(triangles.end(), {{k, k + 1, k + 2}, {k, k + 2, k + 3}});
        corners.push_back({o, o + u, o + u + v});
        corners.push_back({o, o + u + v, o + v});
        for (int i = 2; i > 0; --i)
            faces.push_back(static_cast<int>(triangles.size()) - i);
    }
};

TEST(Texels, of_charts_that_share_edges_belong_to_one_triangle) {
    for (const bool mirrored : {false, true}) {
        Charts mesh;
        const Vector2f u(mirrored ? -0.5F : 0.5F, 0), o(mirrored ? 0.75F : 0.25F, 0.25F);
        mesh.add({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, o, u, {0, 0.5F});
        const Texels texels = texels_of(mesh.corners, mesh.faces, 64);
        EXPECT_EQ(texels.covered, 32u * 32u) << "16 .. 48 of 64";
        EXPECT_EQ(texels.shared, 0u);
        for (int y = 0; y < 64; ++y)
            for (int x = 0; x < 64; ++x)
                if (x >= 16 && x < 48 && y >= 16 && y < 48) {
                    const std::int32_t face = texels.face[texels.index(x, y)];
                    ASSERT_GE(face, 0);
                    const Vector3d weights = weights_at(mesh.corners[static_cast<std::size_t>(face)], x, y, 64);
                    Vector2f at = Vector2f::Zero();
                    for (int i = 0; i < 3; ++i)
                        at += static_cast<float>(weights[i]) *
                              mesh.corners[static_cast<std::size_t>(face)][static_cast<std::size_t>(i)];
                    EXPECT_LE((64 * at - Vector2f(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F)).norm(),
                              0.2F)
                        << "at most a tenth of a texel from each of two edges";
                }
    }
}

TEST(Texels, that_triangles_reach_without_their_centre_are_shown_too) {
    const std::vector<TextureCorners> thin{{Vector2f(0.1F, 0.51F), {0.9F, 0.51F}, {0.9F, 0.512F}}};
    const Texels texels = texels_of(thin, std::vector{0}, 16);
    EXPECT_EQ(texels.covered, 0u);
    EXPECT_EQ(std::ranges::count(texels.face, 0), 14) << "columns 1 to 14 of a row";
}

TEST(Texels, repeat_and_overlap_is_counted) {
    Charts mesh;
    mesh.add({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0}, {0.5F, 0}, {0, 1});
    mesh.add({0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {3, -2}, {0.25F, 0}, {0, 1}); // other whole numbers, the same place
    const Texels texels = texels_of(mesh.corners, mesh.faces, 32);
    EXPECT_EQ(texels.covered, 16u * 32u);
    EXPECT_EQ(texels.shared, 8u * 32u);
    EXPECT_EQ(texels.claims.size(), 2 * texels.shared);
    EXPECT_DOUBLE_EQ(texels.overlap(), 0.5);
    Charts tiled;
    tiled.add({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0}, {4, 0}, {0, 4});
    EXPECT_TRUE(texels_of(tiled.corners, tiled.faces, 32).too_many) << "sixteen times the image";
}

/// Floor at distance d from a long wall of height h sees (1 + d / sqrt(d^2 + h^2)) / 2.
TEST(Textures, of_a_floor_have_the_closed_form_in_charts_of_any_direction) {
    Charts mesh;
    constexpr double height = 1, length = 60;
    mesh.add({0, -0.5, 0}, {1, 0, 0}, {0, 1, 0}, {0.45F, 0.05F}, {-0.4F, 0}, {0, 0.4F}); // mirrored
    mesh.add({1, -0.5, 0}, {1, 0, 0}, {0, 1, 0}, {0.55F, 0.55F}, {0, 0.4F}, {0.4F, 0});  // turned: s goes down
    const std::size_t charts = mesh.corners.size();
    const int k = static_cast<int>(mesh.points.size()); // an occluder in no image
    mesh.points.insert(mesh.points.end(), {{0, -length, 0}, {0, length, 0}, {0, length, height}, {0, -length, height}});
    mesh.triangles.insert(mesh.triangles.end(), {{k, k + 1, k + 2}, {k, k + 2, k + 3}});
    mesh.corners.resize(mesh.triangles.size());
    ASSERT_EQ(charts, mesh.faces.size());
    constexpr int size = 256;
    const TextureAo ao(mesh.points, mesh.triangles, {}, {.radius = 1000});
    const OcclusionTexture made = ao.image(mesh.corners, mesh.faces, size, 4);
    EXPECT_EQ(made.rays, 8);
    const auto expected = [](double d) { return (1 + d / std::hypot(d, height)) / 2; };
    double squares = 0;
    int count = 0;
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) {
            const double u = (x + 0.5) / size, v = (y + 0.5) / size;
            const bool first = u > 0.05 && u < 0.45 && v > 0.05 && v < 0.45;
            const bool second = u > 0.55 && u < 0.95 && v > 0.55 && v < 0.95;
            if (!first && !second)
                continue;
            squares += std::pow(made.visibility(y, x) - expected(first ? (0.45 - u) / 0.4 : 1 + (v - 0.55) / 0.4), 2);
            ++count;
        }
    EXPECT_LT(std::sqrt(squares / count), 0.018) << "texels are so small that every second one casts";
    // Along the cut, x = 1: the left border of the first chart, and the upper one of the second.
    for (int i = 10; i < 90; ++i) {
        const auto along = [&](double a) { return static_cast<int>(a * size); };
        const float one = made.visibility(along(0.05 + 0.004 * i), along(0.0501)),
                    other = made.visibility(along(0.5501), along(0.55 + 0.004 * i));
        EXPECT_NEAR(one, other, 0.02) << i;
    }
    EXPECT_NEAR(made.visibility(50, 10), made.visibility(50, 13), 0.05) << "the margin goes on";
    EXPECT_EQ(made.visibility(200, 20), 1) << "nothing is near";
}

TEST(Textures, of_both_sides_see_what_their_normals_face) {
    Charts mesh; // a floor under a lid; turned over, the floor sees what is below
    mesh.add({-1, -1, 0}, {2, 0, 0}, {0, 2, 0}, {0.1F, 0.1F}, {0.8F, 0}, {0, 0.8F});
    mesh.add({-5, -5, 0.1}, {10, 0, 0}, {0, 10, 0}, {0, 0}, {1, 0}, {0, 1});
    const std::vector<int> floor{0, 1};
    for (const bool reversed : {false, true}) {
        const std::vector<bool> sides(mesh.triangles.size(), reversed);
        const TextureAo ao(mesh.points, mesh.triangles, sides, {.radius = 1});
        EXPECT_NEAR(ao.image(mesh.corners, floor, 32, 0).visibility(16, 16), reversed ? 1 : 0.01, 0.05);
    }
}

TEST(Textures, paint_nothing_for_triangles_without_area_and_refuse_piles) {
    Charts mesh;
    mesh.add({0, 0, 0}, {1, 0, 0}, {0, 0, 0}, {0, 0}, {1, 0}, {0, 1});       // no area in space
    mesh.add({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.5F, 0.5F}, {0, 0}, {0, 0}); // none in the image
    const OcclusionTexture made =
        TextureAo(mesh.points, mesh.triangles, {}, {.radius = 1}).image(mesh.corners, mesh.faces, 16, 2);
    EXPECT_EQ(made.covered, 0u);
    EXPECT_EQ(cv::countNonZero(made.visibility != 1), 0);
    Charts pile;
    for (int i = 0; i < 6; ++i)
        pile.add({0, 0, 1.0 * i}, {1, 0, 0}, {0, 1, 0}, {0, 0}, {1, 0}, {0, 1});
    EXPECT_THROW((void)TextureAo(pile.points, pile.triangles, {}, {.radius = 1}).image(pile.corners, pile.faces, 16, 2),
                 Error);
    pile.faces.resize(4); // two floors: the lower one is closed by the upper within the radius, the upper one open
    const OcclusionTexture both =
        TextureAo(pile.points, pile.triangles, {}, {.radius = 0.5}).image(pile.corners, pile.faces, 16, 2);
    EXPECT_DOUBLE_EQ(both.overlap, 1);
}

TEST(Margin, takes_the_nearest_value_and_ends) {
    cv::Mat1f values(9, 20, std::nanf(""));
    values(4, 3) = 0.25F;
    values(4, 12) = 0.75F;
    fill_margin(values, 5);
    for (int y = 0; y < values.rows; ++y)
        for (int x = 0; x < values.cols; ++x) {
            const double one = std::hypot(x - 3, y - 4), other = std::hypot(x - 12, y - 4);
            if (std::min(one, other) > 5)
                EXPECT_TRUE(std::isnan(values(y, x))) << x << ' ' << y;
            else
                EXPECT_EQ(values(y, x), one < other ? 0.25F : 0.75F) << x << ' ' << y;
        }
}

} // namespace
} // namespace scanshade
