// The grid of an organised cloud determines its camera, and shows distortion that is left in it.
#include "io/clouds/cloud_file.h"
#include "projection/calibration/boards/organised_clouds.h"
#include "projection/calibration/refinement.h"
#include "projection/undistort.h"
#include "tests/support/chessboards.h"
#include "tests/support/data.h"

#include <cmath>
#include <filesystem>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using namespace calibration;
using namespace tests;

TEST(Clouds, OrganisedCloudsDetermineTheirCameraToAThousandthOfAPixel) {
    const fs::path folder = data_folder() / "organised";
    NEEDS(folder);
    for (const auto& [name, px, py] : {std::tuple{"learn0", 319.5, 239.5},
                                       {"learn40", 319.5, 239.5},
                                       {"office1", 320.0, 240.0},
                                       {"capture0001", 319.5, 239.5},
                                       {"frame_20121214T142255.814212", 320.0, 240.0}}) {
        std::vector<std::string> warnings;
        OrganisedClouds problem;
        problem.add(name, read_cloud(folder / (std::string(name) + ".pcd"), warnings));
        RefineOptions options;
        options.selection.guessed = true;
        const Camera guess{{576, 576, 319.5, 239.5, image}, {}, "guess"};
        const Refinement result = refine(problem, guess, camera_groups(LensModel::brown_conrady), options, "");
        EXPECT_NEAR(result.after.pinhole.fx, 525, 1e-3) << name;
        EXPECT_NEAR(result.after.pinhole.fy, 525, 1e-3) << name;
        EXPECT_NEAR(result.after.pinhole.cx, px, 1e-3) << name;
        EXPECT_NEAR(result.after.pinhole.cy, py, 1e-3) << name;
        EXPECT_FALSE(result.after.distortion.any()) << name << " was rectified";
    }
}

TEST(Clouds, DistortionLeftInACloudsGridIsFound) {
    const Camera truth{{525, 525, 325, 240, {160, 120}}, {-0.2, 0.05, 0, 0, 0}, "truth"};
    Camera small = truth;
    small.pinhole = scaled({525, 525, 325, 240, image}, {160, 120});
    Cloud cloud{small.pinhole.size, {}, {}, {}};
    for (int v = 0; v < 120; ++v)
        for (int u = 0; u < 160; ++u) {
            const auto ray = undistorted(small.distortion, small.pinhole.ray(u, v).head<2>());
            const double z = 2 + 0.3 * std::sin(u * 0.1);
            cloud.points.push_back(ray ? Eigen::Vector3d(z * ray->x(), z * ray->y(), z)
                                       : Eigen::Vector3d::Constant(NAN));
        }
    OrganisedClouds problem;
    problem.add("bent", cloud);
    Camera first{{130, 130, 79.5, 59.5, {160, 120}}, {}, "first"};
    const Refinement result = refine(problem, first, camera_groups(LensModel::brown_conrady), {}, "");
    EXPECT_NEAR(result.after.pinhole.fx, small.pinhole.fx, 0.01);
    EXPECT_NEAR(result.after.distortion.k1, -0.2, 1e-3);
    EXPECT_NEAR(result.after.distortion.k2, 0.05, 2e-3);
}

} // namespace
} // namespace scanshade
