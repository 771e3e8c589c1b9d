// Files of several scans, from the file to its values: PTX and E57 say where each scanner stood.
#include "apps/scenes/places/scenes.h"
#include "apps/scenes/scanner.h"
#include "tests/support/e57_file.h"
#include "tests/support/files.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <filesystem>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using nlohmann::json;
using tests::read_bytes, tests::run_program, tests::says, tests::write_file;
namespace fs = std::filesystem;

/// The points of a scan, relative to its station.
std::vector<Vector3d> scan_of(const scene::SceneCloud& cloud, std::size_t station) {
    const std::size_t end = station + 1 < cloud.starts.size() ? cloud.starts[station + 1] : cloud.points.size();
    std::vector<Vector3d> points;
    for (std::size_t i = cloud.starts[station]; i < end; ++i)
        points.push_back(cloud.points[i] - cloud.stations[station]);
    return points;
}

std::string ptx_of(const scene::SceneCloud& cloud) {
    std::string text;
    for (std::size_t s = 0; s < cloud.stations.size(); ++s) {
        const Vector3d& at = cloud.stations[s];
        const std::vector<Vector3d> points = scan_of(cloud, s);
        text += fmt::format("1\n{0}\n{1} {2} {3}\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n{1} {2} {3} 1\n",
                            points.size(), at.x(), at.y(), at.z());
        for (const Vector3d& p : points)
            text += fmt::format("{} {} {} 0.5\n", p.x(), p.y(), p.z());
    }
    return text;
}

std::string e57_of(const scene::SceneCloud& cloud) {
    std::vector<tests::TestScan> scans;
    for (std::size_t s = 0; s < cloud.stations.size(); ++s) {
        const Vector3d& at = cloud.stations[s];
        const std::vector<Vector3d> points = scan_of(cloud, s);
        tests::TestScan scan{.before = fmt::format("<pose type=\"Structure\"><translation type=\"Structure\">"
                                                   "<x type=\"Float\">{}</x><y type=\"Float\">{}</y>"
                                                   "<z type=\"Float\">{}</z></translation></pose>",
                                                   at.x(), at.y(), at.z()),
                             .prototype = tests::floats,
                             .streams = std::vector<std::string>(3),
                             .count = points.size()};
        for (const Vector3d& p : points)
            for (int axis = 0; axis < 3; ++axis)
                scan.streams[static_cast<std::size_t>(axis)] += tests::raw(p[axis]);
        scans.push_back(std::move(scan));
    }
    return tests::e57_file(scans);
}

TEST(Scans, of_one_file_are_computed_with_the_sides_that_their_stations_saw) {
    const tests::TemporaryFolder folder;
    const auto cloud = scene::scanned_cloud(scene::World(scene::scene_named("outdoor")), 40000, {.stations = 2});
    std::vector<double> means;
    for (const auto& [file, bytes] : {std::pair("scans.ptx", ptx_of(cloud)), {"scans.e57", e57_of(cloud)}}) {
        write_file(folder / file, bytes);
        const fs::path out = folder / (std::string(file) + "-out");
        const auto ran =
            run_program(fmt::format("run {} -o {} --write cloud --radius 0.5", (folder / file).string(), out.string()));
        ASSERT_EQ(ran.exit_code, 0) << ran.err;
        const json frame = json::parse(read_bytes(out / "manifest.json"))["frames"][0];
        EXPECT_TRUE(says(frame["notes"].dump(), "turned to the position that each point was seen from")) << file;
        EXPECT_FALSE(says(ran.err, "is not used")) << file;
        means.push_back(frame["mean_visibility"].get<double>());
    }
    EXPECT_NEAR(means[0], means[1], 0.001) << "coordinates of text are rounded";
}

} // namespace
} // namespace scanshade
