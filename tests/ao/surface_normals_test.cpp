// Normals that screen-space methods derive from clean depth: true beside holes, where differences of neighbours fail.
#include "ao/gpu/transfer.h"
#include "ao/screen/screen.h"
#include "tests/support/scenes.h"
#include "tests/support/watched.h"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace scanshade {
namespace {

using namespace tests;

/// What the pass `normals` makes of depth.
cv::Mat3f normals_of(const DepthImage& depth) {
    using Host = gpu::BufferRow::Host;
    using Texels = gpu::BufferRow::Texels;
    const std::size_t pixels = depth.z_m.total();
    ScreenTables tables{
        {{}, depth.z_m.size()},
        depth.z_m.size(),
        0,
        {{"depth", pixels * 4, Host::upload, Texels::r32f}, {"surfaces", pixels * 16, Host::download, Texels::rgba32f}},
        {}};
    tables.add_pass("normals", "normals", {0, 0}, {1}, {{shared::spec_supplied, 0}});
    const shared::ScreenConstants constants = constants_from(ScreenOptions{}, {depth});
    const std::unique_ptr<gpu::Program> program = tables.program(watched_device(), sizeof constants);
    gpu::upload_depth(depth.z_m, program->host_as<float>(0));
    program->run(bytes_of(constants));
    cv::Mat3f normals(depth.z_m.size());
    const auto surfaces = program->host_as<cv::Vec4f>(1);
    std::transform(surfaces.begin(), surfaces.end(), normals.begin(),
                   [](const cv::Vec4f& s) { return cv::Vec3f(s[0], s[1], s[2]); });
    return normals;
}

double degrees_between(const cv::Vec3f& a, const cv::Vec3f& b) {
    return std::acos(std::clamp(static_cast<double>(a.dot(b)), -1.0, 1.0)) * 180 / std::numbers::pi;
}

const cv::Vec3f left_wall = cv::Vec3f(1, 0, -1) / std::sqrt(2.0F), right_wall = cv::Vec3f(-1, 0, -1) / std::sqrt(2.0F);

/// The first column of the right wall in wall_corner().
int edge_of(const DepthImage& corner) {
    for (int u = 1; u < corner.z_m.cols; ++u)
        if (corner.z_m(60, u) < corner.z_m(60, u - 1))
            return u;
    return 0;
}

TEST(SurfaceNormals, both_walls_of_a_corner_have_theirs_up_to_the_edge) {
    const DepthImage corner = wall_corner(test_camera());
    const cv::Mat3f normals = normals_of(corner);
    const int edge = edge_of(corner);
    ASSERT_GT(edge, 20);
    for (int v = 2; v < normals.rows - 2; ++v)
        for (int u = 2; u < normals.cols - 2; ++u)
            if (u < edge - 1 || u > edge) {
                ASSERT_LT(degrees_between(normals(v, u), u < edge ? left_wall : right_wall), 1) << u << ", " << v;
            }
}

TEST(SurfaceNormals, a_surface_beside_a_hole_does_not_lean_to_what_is_beyond_it) {
    // Two columns of the left wall, holes to either side of them, the right wall behind the hole: across it, both walls
    // are as deep, so that the line from one to the other faces the camera, 45 degrees off. It is gentler than the
    // wall, too.
    DepthImage corner = wall_corner(test_camera());
    const int edge = edge_of(corner), last = edge - 2;
    corner.z_m.colRange(last + 1, last + 2).setTo(0);
    corner.z_m.colRange(last - 3, last - 1).setTo(0);
    const cv::Mat3f normals = normals_of(corner);
    for (int v = 2; v < normals.rows - 2; ++v)
        ASSERT_LT(degrees_between(normals(v, last), left_wall), 2) << v;
}

TEST(SurfaceNormals, a_pixel_between_holes_takes_its_plane_from_farther_pixels) {
    // Of a wall at 45 degrees only every third pixel of every third row is known: no neighbour, nor the pixel behind
    // it. By itself such a pixel would face the camera.
    DepthImage wall = tilted_plane(test_camera(), 45);
    for (int v = 0; v < wall.z_m.rows; ++v)
        for (int u = 0; u < wall.z_m.cols; ++u)
            if (u % 3 != 0 || v % 3 != 0)
                wall.z_m(v, u) = 0;
    const cv::Mat3f normals = normals_of(wall);
    const cv::Vec3f truth = cv::Vec3f(1, 0, -1) / std::sqrt(2.0F);
    int known = 0;
    for (int v = 6; v < normals.rows - 6; ++v)
        for (int u = 6; u < normals.cols - 6; ++u) {
            ASSERT_EQ(cv::norm(normals(v, u)) > 0, wall.z_m(v, u) > 0);
            if (!(wall.z_m(v, u) > 0))
                continue;
            ++known;
            ASSERT_LT(degrees_between(normals(v, u), truth), 1) << u << ", " << v;
        }
    EXPECT_GT(known, 500);
}

TEST(SurfaceNormals, pixels_need_not_be_square) {
    // A plane that leans both ways, through pixels twice as high as wide.
    const Pinhole camera{200, 100, 75, 33, {160, 60}};
    DepthImage plane{camera, cv::Mat1f(camera.size), {}};
    const cv::Vec3f normal = cv::normalize(cv::Vec3f(0.4F, -0.5F, -1));
    for (int v = 0; v < 60; ++v)
        for (int u = 0; u < 160; ++u) {
            const Eigen::Vector3d ray = camera.ray(u, v);
            plane.z_m(v, u) = static_cast<float>(-2 / (normal[0] * ray.x() + normal[1] * ray.y() + normal[2]));
        }
    const cv::Mat3f normals = normals_of(plane);
    for (int v = 2; v < 58; ++v)
        for (int u = 2; u < 158; ++u)
            ASSERT_LT(degrees_between(normals(v, u), normal), 0.5) << u << ", " << v;
}

} // namespace
} // namespace scanshade
