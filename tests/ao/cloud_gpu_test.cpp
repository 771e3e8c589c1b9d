// Clouds on a Vulkan device: the same neighbours, planes and values as on the processor.
#include "ao/cloud/cloud_ao.h"
#include "ao/cloud/surface/cloud_gpu.h"
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scene_cloud.h"

#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;
using Points = std::vector<Vector3d>;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

gpu::Device& device() {
    static gpu::Device opened;
    return opened;
}

class CloudGpuTest : public testing::Test {
  protected:
    void TearDown() override {
        for (const std::string& message : device().validation_messages())
            ADD_FAILURE() << message;
    }
};

/// A generated room: its points, with the normals of its surfaces.
const scene::SceneCloud& office() {
    static const scene::SceneCloud cloud = scene::scene_cloud(scene::World(scene::scene_named("office")), 30000);
    return cloud;
}

/// Both ways; values must be known for the same points.
void expect_alike(const PointSet& set, const CloudAoOptions& options, double rms, double worst) {
    const PointVisibility here = CloudAo(options).compute(set), there = CloudAo(options, &device()).compute(set);
    ASSERT_EQ(here.visibility.size(), there.visibility.size());
    double squares = 0, largest = 0;
    for (std::size_t i = 0; i < here.visibility.size(); ++i) {
        const float a = here.visibility[i], b = there.visibility[i];
        ASSERT_EQ(std::isnan(a), std::isnan(b)) << i;
        ASSERT_EQ(std::isnan(here.error[i]), std::isnan(a)) << i;
        if (std::isnan(a))
            continue;
        ASSERT_NEAR(here.error[i], there.error[i], 1e-3) << i;
        const double apart = std::abs(static_cast<double>(a) - static_cast<double>(b));
        squares += apart * apart;
        largest = std::max(largest, apart);
    }
    std::printf("rms %g, largest %g\n", std::sqrt(squares / static_cast<double>(here.visibility.size())), largest);
    EXPECT_LE(squares, rms * rms * static_cast<double>(here.visibility.size()));
    EXPECT_LE(largest, worst);
}

TEST_F(CloudGpuTest, neighbours_and_planes_are_those_of_the_processor) {
    for (const std::size_t count : {std::size_t(1), std::size_t(2), std::size_t(9), std::size_t(16), std::size_t(40),
                                    std::size_t(1000), office().points.size()}) {
        Points points(office().points.begin(), office().points.begin() + static_cast<std::ptrdiff_t>(count));
        if (count > 100)
            points[10] = points[20] = points[30]; // at one place
        CloudGpu gpu(device());
        const CloudSurface here = cloud_surface(LocalCloud(points), {}),
                           there = cloud_surface(LocalCloud(points), {}, &gpu);
        ASSERT_EQ(there.size(), count);
        EXPECT_NEAR(there.spacing, here.spacing, 1e-5F * here.spacing);
        std::size_t other_planes = 0;
        for (std::size_t i = 0; i < count; ++i) {
            for (std::size_t k = 0; k < CloudSurface::kept; ++k) {
                const float a = (here.tree[here.near[i][k]] - here.tree[i]).norm(),
                            b = (there.tree[there.near[i][k]] - there.tree[i]).norm();
                ASSERT_NEAR(a, b, 1e-5F * a) << count << " points, " << i << ", neighbour " << k;
            }
            ASSERT_EQ(here.normals[i].isZero(), there.normals[i].isZero()) << i;
            ASSERT_NEAR(here.disc_radius[i], there.disc_radius[i], 2e-3F * here.disc_radius[i]) << i;
            ASSERT_NEAR(here.roughness[i], there.roughness[i], 1e-3F * here.disc_radius[i]) << i;
            ASSERT_NEAR(here.flatness[i], there.flatness[i], 1e-3F) << i;
            if (!here.normals[i].isZero()) {
                ASSERT_NEAR(there.normals[i].norm(), 1, 1e-5);
                other_planes += std::abs(here.normals[i].dot(there.normals[i])) < 0.9999F;
            }
        }
        EXPECT_LE(static_cast<double>(other_planes), 0.001 * static_cast<double>(count)); // where two ways are as good
    }
}

TEST_F(CloudGpuTest, values_are_those_of_the_processor) {
    expect_alike({office().points, office().normals}, {.radius = 0.5, .rays = 16}, 0.001, 0.06);
    expect_alike({office().points, office().normals}, {.rays = 4, .smooth = 5}, 0.001, 0.06);
    expect_alike({office().points, office().normals}, {.radius = 0.3, .rays = 33, .smooth = 0}, 0.002, 0.07);
}

TEST_F(CloudGpuTest, the_sky_is_that_of_the_processor) {
    expect_alike({office().points, office().normals}, {.rays = 16, .sky = true, .up = "0.2,0,1"}, 0.002, 0.06);
}

TEST_F(CloudGpuTest, small_clouds_and_holes_are_no_matter) {
    for (const std::size_t count : {std::size_t(0), std::size_t(1), std::size_t(3), std::size_t(11), std::size_t(60)}) {
        Points points(office().points.begin(), office().points.begin() + static_cast<std::ptrdiff_t>(count));
        if (count > 20)
            points[7] = {nan, 0, 0};
        expect_alike({points, {}}, {.radius = 0.5, .rays = 16, .outside = "up"}, 0.001, 0.01);
    }
}

TEST_F(CloudGpuTest, tiles_are_those_of_the_processor) {
    const scene::SceneCloud cloud = scene::scene_cloud(scene::World(scene::scene_named("office")), 170000);
    const CloudAoOptions options{.radius = 0.2, .rays = 4, .smooth = 3, .memory_mib = 64};
    ASSERT_EQ(CloudAo(options).compute({cloud.points, cloud.normals}).tiles, 2);
    expect_alike({cloud.points, cloud.normals}, options, 0.002, 0.25);
}

/// So many that a part of them is judged, beside the device's work: right ones, and all of them turned.
TEST_F(CloudGpuTest, recorded_sides_of_many_points_are_judged_as_on_the_processor) {
    const scene::SceneCloud cloud = scene::scene_cloud(scene::World(scene::scene_named("office")), 210000);
    Points turned = cloud.normals;
    for (Vector3d& normal : turned)
        normal = -normal;
    const CloudAoOptions options{.radius = 0.2, .rays = 4};
    for (const Points* normals : {&cloud.normals, static_cast<const Points*>(&turned)}) {
        const PointSet set{cloud.points, *normals};
        const PointVisibility here = CloudAo(options).compute(set), there = CloudAo(options, &device()).compute(set);
        std::size_t other_sides = 0;
        for (std::size_t i = 0; i < cloud.points.size(); ++i)
            other_sides += here.normals[i].dot(there.normals[i]) < 0;
        EXPECT_EQ(other_sides, 0U);
        EXPECT_EQ(doubts_in(here.findings), doubts_in(there.findings));
        EXPECT_EQ(doubts_in(here.findings).empty(), normals == &cloud.normals);
    }
}

TEST_F(CloudGpuTest, many_points_at_one_place_are_no_matter) {
    constexpr std::size_t many = 100000; // each with each, they would take minutes
    Points points = office().points, normals = office().normals;
    points.insert(points.end(), many, Vector3d(0.1, 0.2, 0.3));
    normals.insert(normals.end(), many, Vector3d(0, 0, 1));
    expect_alike({points, normals}, {.radius = 0.5, .rays = 4}, 0.001, 0.25);
}

TEST_F(CloudGpuTest, same_input_same_bits) {
    const PointSet set{office().points, office().normals};
    CloudAo method({.radius = 0.2, .rays = 8}, &device());
    EXPECT_EQ(method.compute(set).visibility, method.compute(set).visibility);
}

} // namespace
} // namespace scanshade
