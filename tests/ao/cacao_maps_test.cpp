// CACAO's maps: from metric and from device depth the same, and as they were when last reviewed.
#include "io/images/image_file.h"
#include "tests/support/cacao_runs.h"
#include "tests/support/scenes.h"

#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;
using cacao_depth_input = CacaoTest;
using cacao_golden = CacaoTest;

TEST_F(cacao_depth_input, device_depth_is_the_same_scene) {
    // z = mu / (alpha - d) undoes the projection for both orders of near and far, up to the rounding of d: the same
    // map.
    const DepthImage metric = ball_on_floor(camera_of(125));
    const double n = 0.1, f = 1000;
    for (const CacaoProfile profile : {CacaoProfile::scan, CacaoProfile::reference}) {
        CacaoOptions o = options(Quality::high, false, profile);
        const cv::Mat1f expected = run(o, metric).visibility;
        for (const CacaoDepthInput kind : {CacaoDepthInput::normal_z, CacaoDepthInput::reverse_z}) {
            o.depth_input = kind;
            DepthImage device_depth{metric.camera, cv::Mat1f(usual), {}};
            for (int i = 0; i < usual.area(); ++i) {
                const double z = metric.z_m(i / usual.width, i % usual.width);
                const double d =
                    kind == CacaoDepthInput::normal_z ? f / (f - n) * (1 - n / z) : n / (f - n) * (f / z - 1);
                device_depth.z_m(i / usual.width, i % usual.width) = static_cast<float>(d);
            }
            const cv::Mat1f apart = difference(run(o, device_depth).visibility, expected);
            fmt::print("             {} {}: mean {:.4f}, worst {:.2f} of 255\n", name_of(profile), name_of(kind),
                       255 * average(apart), 255 * highest(apart));
            EXPECT_LE(average(apart), 0.1 / 255) << name_of(profile) << " " << name_of(kind);
            EXPECT_LE(cv::countNonZero(apart > 2.001 / 255), usual.area() / 1000)
                << name_of(profile) << " " << name_of(kind);
        }
    }
}

TEST_F(cacao_golden, maps_are_as_they_were) {
    // A change of a map must not go unnoticed. UPDATE_GOLDEN=1 rewrites the maps, and the change is reviewed with the
    // code. Devices may differ in single pixels; a changed formula differs everywhere.
    namespace fs = std::filesystem;
    struct Case {
        Quality quality;
        bool downsampled;
        CacaoProfile profile;
    };
    const DepthImage whole = ball_on_floor(test_camera({96, 72})), punched = with_holes(whole, 0.1);
    for (const Case& c :
         {Case{Quality::high, false, CacaoProfile::scan}, Case{Quality::highest, true, CacaoProfile::scan},
          Case{Quality::high, false, CacaoProfile::reference}, Case{Quality::low, true, CacaoProfile::reference}}) {
        const std::string name = fmt::format("cacao_{}_{}{}.png", name_of(c.profile), name_of(c.quality),
                                             c.downsampled ? "_downsampled" : "");
        const fs::path file = fs::path(SCANSHADE_SOURCE) / "tests/golden" / name;
        CacaoOptions o = options(c.quality, c.downsampled, c.profile);
        o.radius = 1;
        Cacao cacao(device(), o);
        const bool scan = o.scan();
        const cv::Mat1f ours = cacao.compute({scan ? punched : whole}).visibility;
        if (const char* update = std::getenv("UPDATE_GOLDEN"); update && std::string(update) == "1")
            write_ao(file, ours, AoFormat::png16);
        const cv::Mat1f golden = read_ao(file);
        ASSERT_EQ(golden.size(), ours.size()) << name;
        EXPECT_EQ(cv::countNonZero((golden == golden) != (ours == ours)), 0) << name << ": the same holes";
        const cv::Mat1f apart = difference(golden, ours);
        // From one driver to another AMD's own shaders break ties of texels differently, most in the plain upsampler.
        const bool ties = !scan && device().info().kind != "CPU";
        if (average(apart) <= 0.3 / 255 && (ties || highest(apart) <= 6.0 / 255))
            continue;
        const fs::path folder = fs::path(SCANSHADE_PROGRAM).parent_path() / "golden_failures";
        fs::create_directories(folder);
        write_ao(folder / name, ours, AoFormat::png16);
        write_ao(folder / ("difference_" + name), cv::Mat1f(cv::min(apart * 16, 1.0)), AoFormat::png16);
        ADD_FAILURE() << fmt::format(
            "{}: mean difference {:.2f}, worst {:.1f} of 255; map and 16 times the difference in {}", name,
            255 * average(apart), 255 * highest(apart), folder.string());
    }
}

} // namespace
} // namespace scanshade
