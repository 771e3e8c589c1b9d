// Ray casting is the truth for the methods. Here it is compared with closed forms (methods.md's 1.3), with brute force,
// and far from the origin.
#include "ao/raycast/raycast.h"

#include "ao/raycast/depth_surface.h"
#include "ao/raycast/point_surface.h"
#include "io/clouds/cloud_file.h"
#include "projection/base/error.h"
#include "projection/base/hash.h"
#include "tests/support/files.h"
#include "tests/support/scenes.h"
#include "tests/support/small_capture.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <numbers>
#include <tbb/global_control.h>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using namespace tests;
constexpr double pi = std::numbers::pi, endless = 1e6;

void add_quad(Mesh& mesh, const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
    const int first = static_cast<int>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {a, b, c, d});
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
}

/// A sphere of quads, poles up; `from` and `to` are polar angles.
Mesh ball(const Vector3d& centre, double radius, int sides, double from = 0, double to = pi) {
    Mesh mesh;
    const auto at = [&](int ring, int side) {
        const double polar = std::lerp(from, to, 2.0 * ring / sides), turn = 2 * pi * side / sides;
        return Vector3d(centre + radius * Vector3d(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn),
                                                   std::cos(polar)));
    };
    for (int ring = 0; ring < sides / 2; ++ring)
        for (int side = 0; side < sides; ++side)
            add_quad(mesh, at(ring, side), at(ring + 1, side), at(ring + 1, side + 1), at(ring, side + 1));
    return mesh;
}

/// Mean of eight independent sets of 2048 rays: one standard error is below 0.0007 even beside an edge.
std::array<double, 3> visibility(const Mesh& mesh, const Vector3d& point, const Vector3d& normal, double radius_m) {
    const RaySurface surface(mesh);
    const CosineDirections directions(2048, 1);
    const RayHemisphere hemisphere(surface, directions, radius_m, true);
    std::array<double, 3> mean{};
    for (std::uint32_t key = 0; key < 8; ++key)
        for (std::size_t f = 0; f < 3; ++f)
            mean[f] += static_cast<double>(hemisphere.at({point, normal, key}).visibility[f]) / 8;
    return mean;
}
double hard(const Mesh& mesh, const Vector3d& point, const Vector3d& normal, double radius_m) {
    return visibility(mesh, point, normal, radius_m)[0];
}

const Vector3d up(0, 0, 1);
constexpr double tolerance = 0.003;

// ---------------------------------------------------------------------------------------------------- closed forms

TEST(ClosedForms, a_wall_beside_a_floor) { // case b
    Mesh wall;
    add_quad(wall, {0, -50, 0}, {0, 50, 0}, {0, 50, 50}, {0, -50, 50});
    for (const auto& [c, expected] :
         {std::pair{0.05, 0.53182}, {0.25, 0.65748}, {0.5, 0.80450}, {0.8, 0.94796}, {1.2, 1.0}})
        EXPECT_NEAR(hard(wall, {0.5 * c, 0, 0}, up, 0.5), expected, tolerance) << c;
}

TEST(ClosedForms, a_wall_beside_a_floor_under_every_falloff) { // case b; hard, quad, lin
    Mesh wall;
    add_quad(wall, {0, -50, 0}, {0, 50, 0}, {0, 50, 50}, {0, -50, 50});
    struct Row {
        double c, hard, quad, lin;
    };
    for (const Row& row : {Row{0.1, .5636, .6175, .5983},
                           {0.25, .6575, .7592, .7391},
                           {0.5, .8045, .9136, .9156},
                           {0.8, .9480, .9913, .9925}}) {
        const auto v = visibility(wall, {2 * row.c, 0, 0}, up, 2);
        EXPECT_NEAR(v[0], row.hard, tolerance) << row.c;
        EXPECT_NEAR(v[1], row.quad, tolerance) << row.c;
        EXPECT_NEAR(v[2], row.lin, tolerance) << row.c;
    }
}

TEST(ClosedForms, wedges_of_any_angle) { // case c
    for (const double degrees : {30.0, 60.0, 90.0, 120.0, 150.0}) {
        const double beta = degrees * pi / 180;
        const Vector3d far(200 * std::cos(beta), 0, 200 * std::sin(beta)), along(0, 200, 0);
        Mesh wall;
        add_quad(wall, -along, along, far + along, far - along);
        EXPECT_NEAR(hard(wall, {0.7, 0, 0}, up, endless), (1 - std::cos(beta)) / 2, tolerance) << degrees;
    }
}

TEST(ClosedForms, the_corner_of_a_room_and_a_trench) { // cases d and e
    Mesh corner;
    add_quad(corner, {0, 0, 0}, {0, 200, 0}, {0, 200, 200}, {0, 0, 200});
    add_quad(corner, {0, 0, 0}, {200, 0, 0}, {200, 0, 200}, {0, 0, 200});
    EXPECT_NEAR(hard(corner, {0.01, 0.01, 0}, up, endless), 0.25, tolerance);
    const double a = 0.4, h = 0.7, off = 0.15;
    Mesh trench;
    for (const double x : {-a, a})
        add_quad(trench, {x, -200, 0}, {x, 200, 0}, {x, 200, h}, {x, -200, h});
    EXPECT_NEAR(hard(trench, {0, 0, 0}, up, endless), a / std::hypot(a, h), tolerance);
    const double expected = ((a - off) / std::hypot(a - off, h) + (a + off) / std::hypot(a + off, h)) / 2;
    EXPECT_NEAR(hard(trench, {off, 0, 0}, up, endless), expected, tolerance);
}

TEST(ClosedForms, ceilings_discs_and_rods_overhead) { // cases f, g and k
    Mesh ceiling;
    add_quad(ceiling, {-50, -50, 0.3}, {50, -50, 0.3}, {50, 50, 0.3}, {-50, 50, 0.3});
    EXPECT_NEAR(hard(ceiling, {0, 0, 0}, up, 0.5), 0.36, tolerance);
    const std::vector<Disc> disc{{{0, 0, 0.3}, up, 0.2}};
    const RaySurface surface{std::span(disc)};
    const CosineDirections directions(4096, 1);
    EXPECT_NEAR(RayHemisphere(surface, directions, 0.5, false).at({{0, 0, 0}, up}).visibility[0],
                1 - 0.04 / (0.04 + 0.09), tolerance);
    Mesh strip; // of angular half-width arcsin(a / h): its rim is where a rod's is
    const double sine = 0.2, half = std::tan(std::asin(sine));
    add_quad(strip, {-half, -200, 1}, {half, -200, 1}, {half, 200, 1}, {-half, 200, 1});
    EXPECT_NEAR(hard(strip, {0, 0, 0}, up, endless), 1 - sine, tolerance);
}

TEST(ClosedForms, balls_from_outside_and_inside) { // cases h, i and j
    for (const double x : {0.1, 0.2, 0.4})
        EXPECT_NEAR(hard(ball({0, 0, 0.1}, 0.1, 200), {x, 0, 0}, up, 1), 1 - std::pow(0.01 / (x * x + 0.01), 1.5),
                    tolerance)
            << x;
    const Mesh hollow = ball({0, 0, 0}, 1, 300);
    for (const double radius : {0.4, 1.0, 1.6})
        EXPECT_NEAR(hard(hollow, {0, 0, -0.9999}, up, radius), 1 - radius * radius / 4, tolerance) << radius;
    EXPECT_NEAR(hard(hollow, {0, 0, -0.9999}, up, 2.5), 0, tolerance);
    const Mesh bowl = ball({0, 0, 0}, 1, 300, pi / 2, pi); // half a sphere: half is open at every point
    for (const double polar : {0.0, 0.5, 1.0, 1.3}) {
        const Vector3d in(-std::sin(polar), 0, std::cos(polar));
        EXPECT_NEAR(hard(bowl, -0.9998 * in, in, endless), 0.5, 2 * tolerance) << polar;
    }
}

// ---------------------------------------------------------------------------------------------------- precision

TEST(Precision, open_surfaces_are_open_wherever_they_lie) {
    // A float counts in steps of 31 mm at 500 km and half a metre at 5000 km: only recentred geometry survives.
    for (const double away : {0.0, 1e5, 5e6}) {
        const Vector3d there(away, -away, 0.3 * away);
        const Mesh sphere = ball(there, 0.25, 100); // 10000 triangles
        Mesh floor;
        add_quad(floor, there + Vector3d(-20, -20, 0), there + Vector3d(20, -20, 0), there + Vector3d(20, 20, 0),
                 there + Vector3d(-20, 20, 0));
        for (const auto& mesh : {sphere, floor}) {
            const RaySurface surface(mesh);
            const CosineDirections directions(4096, 1);
            const RayHemisphere hemisphere(surface, directions, 0.5, false);
            for (std::size_t i = 1000 % mesh.triangles.size(); i < mesh.triangles.size(); i += 397) {
                const auto& t = mesh.triangles[i];
                const Vector3d a = mesh.vertices[t[0]], b = mesh.vertices[t[1]], c = mesh.vertices[t[2]];
                const Vector3d centroid = (a + b + c) / 3;
                Vector3d normal = (b - a).cross(c - a).normalized();
                if (mesh.triangles.size() > 2 && normal.dot(centroid - there) < 0)
                    normal = -normal;
                EXPECT_GE(hemisphere.at({centroid, normal, static_cast<std::uint32_t>(i)}).visibility[0], 0.9995)
                    << away;
            }
        }
    }
}

TEST(Precision, occlusion_is_the_same_far_from_the_origin) {
    const Vector3d there(4.5e5, 5.2e6, 120);
    Mesh near, far;
    add_quad(near, {0, -5, 0}, {0, 5, 0}, {0, 5, 5}, {0, -5, 5});
    far = near;
    for (Vector3d& vertex : far.vertices)
        vertex += there;
    EXPECT_NEAR(hard(near, {0.2, 0, 0}, up, 0.5), hard(far, there + Vector3d(0.2, 0, 0), up, 0.5), 1e-3);
}

// ---------------------------------------------------------------------------------------------------- the tree

/// Moeller and Trumbore, without a tree.
double brute_distance(const Mesh& mesh, const Vector3d& origin, const Vector3d& direction) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& t : mesh.triangles) {
        const Vector3d a = mesh.vertices[t[0]], side = mesh.vertices[t[1]] - a, other = mesh.vertices[t[2]] - a;
        const Vector3d lever = direction.cross(other), from = origin - a, turned = from.cross(side);
        const double volume = side.dot(lever), u = from.dot(lever) / volume, v = direction.dot(turned) / volume;
        if (u >= 0 && v >= 0 && u + v <= 1 && other.dot(turned) / volume > 0)
            nearest = std::min(nearest, other.dot(turned) / volume);
    }
    return nearest;
}

Vector3d scattered(std::uint32_t i) {
    return Vector3d(hash(i, 1), hash(i, 2), hash(i, 3)) * 0x1p-31 - Vector3d::Ones();
}

TEST(Tree, finds_what_brute_force_finds) {
    Mesh mesh;
    for (std::uint32_t i = 0; i < 1500; ++i) {
        const Vector3d at = scattered(3 * i);
        mesh.vertices.insert(mesh.vertices.end(),
                             {at, at + 0.15 * scattered(3 * i + 1), at + 0.15 * scattered(3 * i + 2)});
        const int first = static_cast<int>(3 * i);
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    const RaySurface surface(mesh);
    int differing = 0, met = 0;
    for (std::uint32_t i = 0; i < 4000; ++i) {
        const Vector3d origin = scattered(90000 + i), direction = scattered(70000 + i).normalized();
        const double brute = brute_distance(mesh, origin, direction);
        const auto found = surface.nearest(origin, direction);
        met += found.has_value();
        differing += found ? std::abs(found->distance - brute) > 1e-4 : std::isfinite(brute);
    }
    EXPECT_GT(met, 1000);
    EXPECT_LE(differing, 2) << "rays through the very edge of a triangle may go either way in single precision";
}

TEST(Tree, degenerate_triangles_are_left_out) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const Mesh mesh{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {nan, 0, 0}, {0, 1, 0}},
                    {{0, 1, 2}, {0, 1, 3}, {0, 1, 9}, {-1, 1, 4}}};
    EXPECT_TRUE(RaySurface(mesh).empty());
    EXPECT_EQ(hard(mesh, {0, 0, 0.1}, -up, 1), 1);
}

// ---------------------------------------------------------------------------------------------------- the rays

TEST(Rays, directions_are_cosine_weighted) {
    // Mean of z under the density cos / pi is 2/3, of z^2 1/2, of x and y 0.
    const CosineDirections directions(256, 5);
    for (std::uint32_t key = 0; key < 50; ++key) {
        Vector3d mean = Vector3d::Zero();
        double z2 = 0;
        for (const auto& d : directions.set_for(key)) {
            mean += Vector3d(d.x, d.y, d.z) / 256;
            z2 += static_cast<double>(d.z) * static_cast<double>(d.z) / 256;
        }
        EXPECT_NEAR(mean.x(), 0, 0.01);
        EXPECT_NEAR(mean.y(), 0, 0.01);
        EXPECT_NEAR(mean.z(), 2.0 / 3, 0.003);
        EXPECT_NEAR(z2, 0.5, 0.003);
    }
}

TEST(Rays, the_standard_error_is_the_actual_error) {
    // Next to a wall, where visibility is known: the root mean square of the actual errors equals that of the standard
    // errors.
    Mesh wall;
    add_quad(wall, {0, -50, 0}, {0, 50, 0}, {0, 50, 50}, {0, -50, 50});
    const RaySurface surface(wall);
    double before = 1;
    for (const int rays : {64, 256, 1024}) {
        const CosineDirections directions(rays, 3);
        const RayHemisphere hemisphere(surface, directions, 1, false);
        double made = 0, told = 0;
        for (std::uint32_t i = 0; i < 2000; ++i) {
            const double c = 0.05 + 0.9 * i / 2000;
            const double expected = 1 - (std::acos(c) - c * std::sqrt(1 - c * c)) / pi;
            const RayEstimate estimate = hemisphere.at({{c, 0, 0}, up, i});
            made += std::pow(static_cast<double>(estimate.visibility[0]) - expected, 2);
            told += std::pow(static_cast<double>(estimate.standard_error[0]), 2);
        }
        const double ratio = std::sqrt(told / made), rms = std::sqrt(made / 2000);
        EXPECT_GT(ratio, 0.7) << rays;
        EXPECT_LT(ratio, 1.6) << rays;
        EXPECT_LT(rms, before / 2) << "four times the rays: less than half the error, as no random set would have";
        EXPECT_LT(rms, 0.7 * std::pow(rays, -0.75)) << rays;
        before = rms;
    }
}

TEST(Rays, the_standard_error_of_an_image_can_be_dumped) {
    const DepthImage depth = with_holes(ball_on_floor(test_camera()), 0.1);
    Raycast raycast(RaycastOptions{.rays = 16});
    EXPECT_TRUE(raycast.intermediates().empty());
    const cv::Mat1f visibility = raycast.compute({depth}).visibility;
    const std::vector<Intermediate> all = raycast.intermediates();
    ASSERT_EQ(all.size(), 1U);
    EXPECT_EQ(all[0].shape, (std::vector<int>{depth.z_m.rows, depth.z_m.cols}));
    ASSERT_EQ(all[0].data.size(), visibility.total() * sizeof(float));
    cv::Mat1f error(visibility.size());
    std::memcpy(error.data, all[0].data.data(), all[0].data.size());
    EXPECT_EQ(cv::countNonZero((error == error) != (visibility == visibility)), 0) << "NaN where there is no value";
    EXPECT_GT(cv::countNonZero(error > 0.01F), 100) << "in the shade of the ball rays disagree";
}

TEST(Rays, threads_do_not_matter) {
    const DepthImage depth = with_holes(ball_on_floor(test_camera()), 0.1);
    const cv::Mat1f all = Raycast(RaycastOptions{.rays = 32}).compute({depth}).visibility;
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const cv::Mat1f alone = Raycast(RaycastOptions{.rays = 32}).compute({depth}).visibility;
    EXPECT_EQ(std::memcmp(all.data, alone.data, all.total() * sizeof(float)), 0);
}

// ---------------------------------------------------------------------------------------------------- depth images

/// Two walls across the view, the left one nearer.
DepthImage step(double near_m, double far_m) {
    DepthImage depth{{525, 525, 159.5, 119.5, {320, 240}}, cv::Mat1f(240, 320), {}};
    depth.z_m.colRange(0, 160) = static_cast<float>(near_m);
    depth.z_m.colRange(160, 320) = static_cast<float>(far_m);
    return depth;
}

TEST(DepthSurface, a_step_is_open_as_a_sheet_and_closed_as_a_solid) {
    // methods.md's 11, jump 1.0 -> 1.3 m, 5 px beside it on the far side: .700 as a sheet, about .52 as a solid.
    const auto beside = [](double thickness_m) {
        Raycast raycast({.rays = 256, .thickness_m = thickness_m});
        DepthImage depth = step(1.0, 1.3);
        depth.camera.fx = depth.camera.fy = 260; // wide enough to hold the radius: 2.5 px here are 5 px at 525
        return cv::mean(raycast.compute({depth}).visibility(cv::Rect(162, 110, 1, 20)))[0];
    };
    const double sheet = beside(0), half = beside(0.1), solid = beside(1000);
    EXPECT_NEAR(sheet, 0.700, 0.03);
    EXPECT_NEAR(solid, 0.52, 0.03);
    EXPECT_LT(half, sheet - 0.03);
    EXPECT_GT(half, solid + 0.03);
}

TEST(DepthSurface, occluders_beyond_the_radius_cast_no_halo) {
    const DepthImage depth = step(1, 3);
    for (const double thickness : {0.0, 1.0}) {
        const cv::Mat1f v = Raycast({.rays = 64, .thickness_m = thickness}).compute({depth}).visibility;
        EXPECT_EQ(cv::countNonZero(v(cv::Rect(164, 0, 156, 240)) < 1), 0) << thickness;
    }
}

TEST(DepthSurface, the_sheet_is_never_darker_than_the_solid) {
    const DepthImage depth = ball_on_floor(test_camera());
    const cv::Mat1f sheet = Raycast(RaycastOptions{.rays = 128}).compute({depth}).visibility;
    const cv::Mat1f solid = Raycast({.rays = 128, .thickness_m = 1000}).compute({depth}).visibility;
    EXPECT_EQ(cv::countNonZero(solid > sheet), 0) << "the same rays against more geometry";
    EXPECT_GT(cv::countNonZero(solid < sheet), 100);
}

TEST(DepthSurface, grazing_planes_stay_whole) {
    for (const double tilt : {0.0, 60.0, 85.0, 89.0}) {
        const DepthImage depth = tilted_plane(test_camera({320, 240}), tilt);
        const Mesh mesh = surface_of(depth, {}, 0);
        int blocks = 0;
        for (int v = 0; v + 1 < depth.z_m.rows; ++v)
            for (int u = 0; u + 1 < depth.z_m.cols; ++u)
                blocks += cv::countNonZero(depth.z_m(cv::Rect(u, v, 2, 2))) == 4;
        EXPECT_GE(mesh.triangles.size(), 1.999 * blocks) << tilt << ": all but single corners at the horizon";
        const NormalImage normals = normals_of(depth);
        const double expected = std::sin(tilt * pi / 180);
        for (int v = 0; v < depth.z_m.rows; ++v)
            for (int u = 2; u + 2 < depth.z_m.cols; ++u)
                if (cv::countNonZero(depth.z_m(cv::Rect(u - 2, v, 5, 1))) == 5) {
                    ASSERT_NEAR(normals.normals(v, u)[0], expected, 0.01) << tilt << " at " << u << ", " << v;
                }
    }
}

TEST(DepthSurface, a_corner_follows_the_closed_form) {
    // Two walls at a right angle, exact normals: 1 - (acos c - c sqrt(1 - c^2)) / pi at c radii from the edge.
    const Pinhole camera = test_camera({320, 240});
    const DepthImage depth = wall_corner(camera, 2);
    const cv::Mat1f v = Raycast(RaycastOptions{.rays = 512}).compute({depth}).visibility;
    double squares = 0;
    int count = 0;
    for (int row = 80; row < 160; row += 4)
        for (int u = 20; u < 300; ++u) {
            const Vector3d point = camera.point(u, row, static_cast<double>(depth.z_m(row, u)));
            const double c = std::hypot(point.x(), point.z() - 2) / 0.5;
            if (c < 0.02)
                continue;
            const double expected = c >= 1 ? 1 : 1 - (std::acos(c) - c * std::sqrt(1 - c * c)) / pi;
            squares += std::pow(static_cast<double>(v(row, u)) - expected, 2);
            ++count;
        }
    EXPECT_LT(std::sqrt(squares / count), 0.01) << "of which 0.005 are the rays' own";
}

// ---------------------------------------------------------------------------------------------------- clouds

/// Floor and wall sampled unevenly, 12 mm apart on average; the floor begins at the wall x = 0.
std::vector<Vector3d> corner_cloud(const Vector3d& shift) {
    std::vector<Vector3d> points;
    for (std::uint32_t i = 0; i < 10000; ++i) {
        const double a = hash(i, 4) * 0x1p-32, b = hash(i, 5) * 0x1p-32 - 0.5;
        points.push_back(shift + (i % 2 ? Vector3d(0, 1.2 * b, 0.6 * a) : Vector3d(0.6 * a, 1.2 * b, 0)));
    }
    return points;
}

TEST(Clouds, discs_reproduce_a_corner) {
    const Vector3d shift(-0.3, 0, -1.5); // the sensor, at the origin, looks down on it
    const auto points = corner_cloud(shift);
    Raycast raycast({.radius_m = 0.3, .rays = 512});
    const auto values = raycast.compute({points}).visibility;
    double squares = 0;
    int count = 0;
    for (std::size_t i = 0; i < points.size(); i += 2) {
        const Vector3d at = points[i] - shift;
        const double c = at.x() / 0.3;
        if (c < 0.1 || c > 1.3 || std::abs(at.y()) > 0.25)
            continue;
        const double expected = c >= 1 ? 1 : 1 - (std::acos(c) - c * std::sqrt(1 - c * c)) / pi;
        squares += std::pow(static_cast<double>(values[i]) - expected, 2);
        ++count;
    }
    ASSERT_GT(count, 500);
    EXPECT_LT(std::sqrt(squares / count), 0.03);
}

TEST(Clouds, every_point_gets_a_value_wherever_the_cloud_lies) {
    auto points = corner_cloud({-0.3, 0, -1.5});
    const auto here = Raycast({.radius_m = 0.3, .rays = 64}).compute({points}).visibility;
    std::vector<Vector3d> normals;
    for (const Disc& disc : discs_of(points))
        normals.push_back(disc.normal);
    for (Vector3d& point : points)
        point += Vector3d(4.5e5, 5.2e6, 120);
    points.push_back(Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    normals.emplace_back(0, 0, 1);
    const auto there = Raycast({.radius_m = 0.3, .rays = 64}).compute({points, normals}).visibility;
    double difference = 0;
    for (std::size_t i = 0; i < here.size(); ++i) {
        ASSERT_FALSE(std::isnan(here[i]));
        difference += std::abs(static_cast<double>(here[i] - there[i])) / static_cast<double>(here.size());
    }
    EXPECT_LT(difference, 0.003);
    EXPECT_TRUE(std::isnan(there.back()));
}

TEST(Clouds, a_ball_is_open_and_a_point_alone_too) {
    std::vector<Vector3d> points;
    for (int i = 0; i < 4000; ++i) { // a spiral from pole to pole
        const double z = 1 - (2 * i + 1) / 4000.0, turn = 2.399963 * i, r = std::sqrt(1 - z * z);
        points.emplace_back(0.3 * r * std::cos(turn), 0.3 * r * std::sin(turn), 0.3 * z);
    }
    std::vector<Vector3d> normals = points;
    for (const float v : Raycast({.rays = 256}).compute({points, normals}).visibility)
        EXPECT_GT(v, 0.99F);
    for (const int count : {1, 2, 3}) {
        const std::vector<Vector3d> few(points.begin(), points.begin() + count);
        for (const float v : Raycast({.rays = 16}).compute({few}).visibility)
            EXPECT_GE(v, 0.0F) << count;
    }
    EXPECT_TRUE(Raycast({.rays = 16}).compute(PointSet{}).visibility.empty());
}

// ---------------------------------------------------------------------------------------------------- meshes

/// Corners shared by all faces, outward by the order of their corners.
Mesh cube() {
    Mesh mesh;
    for (int i = 0; i < 8; ++i)
        mesh.vertices.emplace_back(i & 1, (i >> 1) & 1, i >> 2);
    for (const auto& [a, b, c, d] :
         {std::array{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
    }
    return mesh;
}

TEST(Meshes, a_cube_is_open_at_every_vertex_and_a_box_closed_from_inside) {
    const Mesh outside = cube();
    Mesh inside = cube();
    for (auto& triangle : inside.triangles)
        std::swap(triangle[1], triangle[2]);
    for (const MeshRays from : {MeshRays::triangles, MeshRays::vertices}) {
        for (const float v :
             Raycast({.rays = 256, .mesh = from}).compute({outside.vertices, {}, outside.triangles}).visibility)
            EXPECT_EQ(v, 1) << static_cast<int>(from);
        const auto closed = Raycast({.radius_m = endless, .rays = 256, .mesh = MeshRays::triangles})
                                .compute({inside.vertices, {}, inside.triangles})
                                .visibility;
        for (const float v : closed)
            EXPECT_EQ(v, 0);
    }
}

TEST(Meshes, vertices_without_a_triangle_have_no_value) {
    Mesh mesh = cube();
    mesh.vertices.emplace_back(3, 3, 3);
    for (const MeshRays from : {MeshRays::triangles, MeshRays::vertices}) {
        const auto values = Raycast({.rays = 16, .mesh = from}).compute({mesh.vertices, {}, mesh.triangles}).visibility;
        EXPECT_EQ(values.size(), 9U);
        EXPECT_TRUE(std::isnan(values.back())) << static_cast<int>(from);
    }
}

/// A NumPy array file of so many floats.
void expect_floats(const std::filesystem::path& file, const std::string& shape, std::size_t count) {
    const std::string bytes = file_bytes(file);
    ASSERT_GT(bytes.size(), 4 * count) << file;
    const std::string header = bytes.substr(0, bytes.size() - 4 * count);
    EXPECT_TRUE(header.ends_with("\n")) << header;
    EXPECT_NE(header.find("'<f4'"), std::string::npos) << header;
    EXPECT_NE(header.find("'shape': " + shape), std::string::npos) << header;
}

TEST(Rays, a_run_writes_the_standard_error_of_every_pixel_when_asked) {
    const TemporaryFolder folder;
    write_capture(folder / "capture", 2);
    const Ran ran = run_program("run " + (folder / "capture").string() + " -o " + (folder / "out").string() +
                                " --method raycast --raycast.rays 16 --dump " + (folder / "dump").string());
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    int frames = 0;
    for (const auto& frame : std::filesystem::directory_iterator(folder / "dump")) {
        ++frames;
        expect_floats(frame.path() / "standard_error.npy", "(48, 64,)", 64 * 48);
        EXPECT_NE(file_bytes(frame.path() / "index.csv").find("standard_error,f4,48x64,"), std::string::npos);
    }
    EXPECT_EQ(frames, 2);
}

TEST(Meshes, the_file_comes_back_with_one_property_more) {
    const TemporaryFolder folder;
    // Two triangles of a valley and a quad; a comment, a colour and a face property that must survive.
    const std::string head = "ply\nformat ascii 1.0\ncomment a valley\nelement vertex 6\nproperty float x\nproperty "
                             "float y\nproperty float z\nproperty uchar red\n";
    const std::string faces =
        "element face 2\nproperty list uchar int vertex_indices\nproperty uchar shade\nend_header\n";
    const std::vector<std::string> vertices{"0 0 0 7", "0 1 0 7", "1 0 1 8", "1 1 1 8", "-1 0 1 9", "-1 1 1 9"};
    std::string body;
    for (const auto& line : vertices)
        body += line + "\n";
    const std::string rest = "4 0 2 3 1 5\n4 1 5 4 0 6\n";
    write_file(folder / "valley.ply", head + faces + body + rest);
    const Ran ran = run_program("run " + (folder / "valley.ply").string() + " -o " + (folder / "out").string() +
                                " --method raycast --radius 2 --raycast.mesh vertices --raycast.rays 1024 --dump " +
                                (folder / "dump").string());
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    expect_floats(folder / "dump/valley/standard_error.npy", "(6,)", 6);
    const std::string written = file_bytes(folder / "out/clouds/valley.ply");
    EXPECT_TRUE(written.starts_with(head + "property float ambient_occlusion\n" + faces)) << written;
    EXPECT_TRUE(written.ends_with(rest));
    for (const auto& line : vertices)
        EXPECT_NE(written.find("\n" + line + " "), std::string::npos) << line;
}

TEST(Settings, impossible_ones_are_refused) {
    EXPECT_THROW(Raycast(RaycastOptions{.radius_m = 0}), Misuse);
    EXPECT_THROW(Raycast(RaycastOptions{.rays = 0}), Misuse);
    RaycastOptions options;
    for (const auto& [name, word] : {std::pair("falloff", "soft"), std::pair("mesh", "edges")})
        EXPECT_THROW(set(*row_named(options.parameters(), name), word), Misuse) << name;
}

} // namespace
} // namespace scanshade
