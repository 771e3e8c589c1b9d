// Pictures of clouds show the cloud: filled, tight, whatever strays, colours of zero and the side that normals face.
#include "apps/picture.h"
#include "apps/results/cloud_picture.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

const cv::Vec3b nothing_there(64, 40, 28);

struct Scanned {
    Cloud cloud;
    PointVisibility found;

    void add(const Vector3d& point, const Vector3f& normal, float visibility = 0.8F) {
        cloud.points.push_back(point);
        cloud.grid = {static_cast<int>(cloud.points.size()), 1};
        found.normals.push_back(normal);
        found.visibility.push_back(visibility);
    }
    [[nodiscard]] cv::Mat3b picture(const std::optional<Vector3d>& viewpoint = {}) const {
        return cloud_picture(cloud, found, viewpoint, 1);
    }
};

/// A ball of 2 m with normals outward, at map coordinates.
Scanned ball() {
    Scanned scanned;
    constexpr int count = 4000;
    for (int i = 0; i < count; ++i) {
        const double z = 1 - (2 * i + 1.0) / count, turn = i * 2.399963, r = std::sqrt(1 - z * z);
        const Vector3d normal(r * std::cos(turn), r * std::sin(turn), z);
        scanned.add(Vector3d(512000, 5403000, 300) + normal, normal.cast<float>());
    }
    return scanned;
}

/// A room of 6 x 4 x 3 m with normals inward, one corner at (100, 200, 0).
Scanned room() {
    Scanned scanned;
    const Vector3d size(6, 4, 3), corner(100, 200, 0);
    constexpr double step = 0.08;
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {0.0, 1.0}) {
            const int a = (axis + 1) % 3, b = (axis + 2) % 3;
            for (double u = 0; u <= size[a]; u += step)
                for (double v = 0; v <= size[b]; v += step) {
                    Vector3d point;
                    point[axis] = side * size[axis];
                    point[a] = u;
                    point[b] = v;
                    scanned.add(corner + point, Vector3f::Unit(axis) * static_cast<float>(1 - 2 * side));
                }
        }
    return scanned;
}

double drawn_share(const cv::Mat3b& picture) {
    return static_cast<double>(
               std::count_if(picture.begin(), picture.end(), [](const cv::Vec3b& p) { return p != nothing_there; })) /
           static_cast<double>(picture.total());
}

double differing_share(const cv::Mat3b& a, const cv::Mat3b& b) {
    if (a.size() != b.size())
        return 1;
    std::size_t differing = 0;
    for (int v = 0; v < a.rows; ++v)
        for (int u = 0; u < a.cols; ++u)
            differing += cv::norm(cv::Vec3i(a(v, u)) - cv::Vec3i(b(v, u))) > 24;
    return static_cast<double>(differing) / static_cast<double>(a.total());
}

TEST(cloud_picture, a_ball_fills_its_frame) {
    const cv::Mat3b picture = ball().picture();
    EXPECT_GT(drawn_share(picture), 0.7) << "discs in squares cover pi / 4 = 0.785, without holes between the points";
    EXPECT_LT(drawn_share(picture), 0.9);
}

TEST(cloud_picture, stray_points_a_thousand_kilometres_away_hardly_shrink_the_rest) {
    const Scanned clean = ball();
    Scanned stray = clean;
    for (int i = 0; i < 20; ++i)
        stray.add({1e6 * i, -1e6, 1e6}, Vector3f::UnitZ());
    EXPECT_GT(drawn_share(stray.picture()), 0.6) << "frames are a tenth wider where anything is beyond the quantiles";
    EXPECT_LT(std::abs(stray.picture().rows - clean.picture().rows), 40);
}

TEST(cloud_picture, both_sides_of_surfaces_are_drawn) {
    Scanned inside_out = ball();
    for (Vector3f& normal : inside_out.found.normals)
        normal = -normal;
    EXPECT_GT(drawn_share(inside_out.picture()), 0.5);
}

TEST(cloud_picture, colours_that_are_all_zero_are_none) {
    const Scanned bare = ball();
    Scanned black = bare;
    black.cloud.colours.assign(black.cloud.points.size(), cv::Vec3b());
    EXPECT_FALSE(has_colours(black.cloud));
    EXPECT_EQ(differing_share(bare.picture(), black.picture()), 0);
    black.cloud.colours[7] = {0, 0, 1};
    EXPECT_TRUE(has_colours(black.cloud));
}

TEST(cloud_picture, the_two_views_differ) {
    const cv::Mat3b picture = room().picture();
    ASSERT_GT(picture.cols, 1500) << "a panorama from the middle of the room is wide";
    EXPECT_GT(drawn_share(picture.rowRange(0, picture.rows / 2)), 0.8) << "from inside, walls are everywhere";
    EXPECT_LT(drawn_share(picture.rowRange(picture.rows * 2 / 3, picture.rows)), 0.8) << "from outside they are not";
}

TEST(cloud_picture, a_room_is_opened_so_that_its_inside_shows) {
    Scanned closed = room(); // the inner half of the floor is darker than everything else
    for (std::size_t i = 0; i < closed.cloud.points.size(); ++i)
        if (closed.cloud.points[i].z() == 0)
            closed.found.visibility[i] = 0.1F;
    const cv::Mat3b picture = closed.picture();
    const cv::Mat3b below =
        picture(cv::Rect(picture.cols / 2, picture.rows * 2 / 3, picture.cols / 2, picture.rows / 3));
    const auto dark =
        std::count_if(below.begin(), below.end(), [](const cv::Vec3b& p) { return p[0] == p[2] && p[0] < 60; });
    EXPECT_GT(static_cast<double>(dark) / static_cast<double>(below.total()), 0.1) << "the floor is seen from above";
}

TEST(cloud_picture, clouds_of_few_points_and_of_one_place_have_a_picture) {
    Scanned one;
    one.add({1, 2, 3}, Vector3f::UnitZ());
    EXPECT_FALSE(one.picture().empty());
    for (int i = 0; i < 50; ++i)
        one.add({1, 2, 3}, Vector3f::Zero(), std::nanf(""));
    EXPECT_FALSE(one.picture().empty());
    Scanned none;
    none.add(Vector3d::Constant(std::nan("")), Vector3f::Zero(), std::nanf(""));
    EXPECT_FALSE(none.picture().empty());
}

} // namespace
} // namespace scanshade
