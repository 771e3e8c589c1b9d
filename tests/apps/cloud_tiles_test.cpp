// --write tiles3d from the command line: places on the Earth, clouds without one, and what is refused.
#include "io/clouds/cloud_file.h"
#include "io/rasters/geocentric.h"
#include "tests/support/laz_file.h"
#include "tests/support/points.h"
#include "tests/support/says.h"
#include "tests/support/tileset.h"

#include <fmt/format.h>

namespace scanshade {
namespace {

using namespace tests;
namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr const char* utm33 = "PROJCS[\"WGS 84 / UTM zone 33N\",GEOGCS[\"WGS 84\",UNIT[\"degree\",0.0174532925199433],"
                              "AUTHORITY[\"EPSG\",\"4326\"]],UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"32633\"]]";

/// A corner 2 m wide on the map of UTM zone 33, in millimetres.
Points surveyed(std::size_t count = 3000) {
    Points points = corner(count);
    for (Vector3d& p : points)
        p = (1000 * p).array().round() / 1000 + Eigen::Array3d(380000, 5820000, 40);
    return points;
}
std::string las_of(const Points& points) {
    std::string records;
    for (const Vector3d& p : points) {
        std::string record(30, '\0');
        for (int axis = 0; axis < 3; ++axis)
            store(record.data() + 4 * axis,
                  static_cast<std::int32_t>(std::lround(1000 * (p - Vector3d(380000, 5820000, 40))[axis])));
        record[14] = 0x11;
        records += record;
    }
    std::string header = las_header(6, 30, static_cast<int>(points.size()), nullptr);
    for (int axis = 0; axis < 3; ++axis) {
        store(header.data() + 131 + 8 * axis, 0.001);
        store(header.data() + 155 + 8 * axis, Vector3d(380000, 5820000, 40)[axis]);
    }
    header += vlr("LASF_Projection", 2112, utm33);
    header[6] = 0x10; // the reference is text
    store(header.data() + 96, static_cast<std::uint32_t>(header.size()));
    store(header.data() + 100, 1U);
    return header + records;
}

class CloudTiles : public testing::Test {
  protected:
    Ran run(const fs::path& file, const std::string& more = "") const {
        return run_program(
            fmt::format("run {} -o {} --overwrite --write tiles3d --radius 0.5 --cloud.outside inward {}",
                        file.string(), (folder / "out").string(), more));
    }
    [[nodiscard]] Tileset tiles(const std::string& name) const {
        return TilesetReader(folder / "out/tiles" / name).read();
    }
    [[nodiscard]] std::string manifest() const { return file_bytes(folder / "out/manifest.json"); }

    /// Each tile's point is within half a millimetre, less than points are apart, of one of the survey by PROJ, tested
    /// elsewhere, and no two of one.
    static void expect_on_earth(const Tileset& found, Points survey) {
        ASSERT_TRUE(found.transform);
        ASSERT_EQ(found.points.size(), survey.size());
        rasters::Geocentric(rasters::crs_of_code("EPSG:32633")).place(survey);
        Points there;
        for (const Vector3d& p : found.points)
            there.push_back((*found.transform * p.homogeneous()).head<3>());
        std::ranges::sort(there, std::ranges::less(), [](const Vector3d& p) { return p.x(); });
        std::vector<char> met(there.size(), 0);
        constexpr double near = 0.002;
        for (const Vector3d& p : survey) {
            auto at = std::ranges::lower_bound(there, p.x() - near, std::ranges::less(),
                                               [](const Vector3d& q) { return q.x(); });
            while (at != there.end() && at->x() <= p.x() + near &&
                   (met[static_cast<std::size_t>(at - there.begin())] || (*at - p).norm() > near / 4))
                ++at;
            ASSERT_TRUE(at != there.end() && at->x() <= p.x() + near) << "no point of a tile is at this of the survey";
            met[static_cast<std::size_t>(at - there.begin())] = 1;
        }
    }

    TemporaryFolder folder;
};

TEST_F(CloudTiles, of_a_survey_are_on_the_earth) {
    const Points points = surveyed();
    const Ran ran = run(write_file(folder / "tile.las", las_of(points)));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    expect_on_earth(tiles("tile"), points);
    EXPECT_TRUE(says(ran.err, "tiles are on the Earth by EPSG:32633."));
    EXPECT_TRUE(says(ran.err, "heights are taken as ellipsoidal"));
    EXPECT_TRUE(says(manifest(), "tiles/tile/r.glb"));
    EXPECT_TRUE(says(manifest(), "\"not_of_this_run\": []"));
    const Tileset found = tiles("tile");
    EXPECT_EQ(found.fields.size(), 2U);
    for (const auto& [name, values] : found.fields)
        for (const float value : values)
            ASSERT_TRUE(value >= 0 && value <= 1) << name;
    EXPECT_GT(mean(found.fields.at("_AMBIENT_OCCLUSION")), 0.5);
}

TEST_F(CloudTiles, of_a_cloud_without_a_system_are_local_unless_it_is_given) {
    const Points points = surveyed();
    write_new_ply(folder / "a.ply", points, {}, {});
    Ran ran = run(folder / "a.ply");
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.err, "the cloud has no coordinate system: tiles are local, a globe shows them at the Earth's "
                              "centre; --tiles-crs EPSG:n"));
    EXPECT_FALSE(tiles("a").transform);
    EXPECT_EQ(tiles("a").points.size(), points.size());
    ran = run(folder / "a.ply", "--tiles-crs EPSG:32633");
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    expect_on_earth(tiles("a"), points);
    ran = run(folder / "a.ply", "--tiles-crs EPSG:1");
    EXPECT_TRUE(says(ran.err, "PROJ knows no way from the coordinate system \"EPSG:1\" to the Earth: tiles are local"));
    EXPECT_FALSE(tiles("a").transform);
}

TEST_F(CloudTiles, of_a_cloud_from_disk_are_the_same) {
    const Points points = surveyed(200000);
    const Ran ran = run(write_file(folder / "tile.las", las_of(points)), "--cloud.memory 64 --cloud.rays 4");
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    EXPECT_TRUE(says(ran.err, "computed from disk, in tiles"));
    EXPECT_TRUE(says(ran.err, "tiles are on the Earth by EPSG:32633."));
    const Tileset found = tiles("tile");
    expect_on_earth(found, points);
    EXPECT_LE(std::ranges::max(found.sizes), 50000U);
    EXPECT_GT(found.sizes.size(), 3U);
    EXPECT_GT(mean(found.fields.at("_AMBIENT_OCCLUSION")), 0.5);
    EXPECT_TRUE(says(manifest(), "\"not_of_this_run\": []"));
}

TEST_F(CloudTiles, are_resumed_only_where_something_changed) {
    const fs::path file = write_file(folder / "tile.las", las_of(surveyed()));
    ASSERT_EQ(run(file).exit_code, 0);
    const auto again = [&](const std::string& more) {
        return run_program(fmt::format("run {} -o {} --resume --write tiles3d --radius 0.5 --cloud.outside inward {}",
                                       file.string(), (folder / "out").string(), more))
            .err;
    };
    const auto time = [&] { return fs::last_write_time(folder / "out/tiles/tile/tileset.json"); };
    auto before = time();
    (void)again("");
    EXPECT_EQ(time(), before);
    (void)again("--tiles-crs EPSG:25833");
    EXPECT_NE(time(), before) << "another place";
    fs::remove(folder / "out/tiles/tile/r.glb");
    (void)again("--tiles-crs EPSG:25833");
    EXPECT_TRUE(fs::exists(folder / "out/tiles/tile/r.glb")) << "what is missing is made again";
}

TEST_F(CloudTiles, refuse_what_has_none) {
    write_capture(folder / "capture", 1);
    const Ran depth = run(folder / "capture", "--page no");
    EXPECT_EQ(depth.exit_code, 3);
    EXPECT_TRUE(says(depth.err, "no cloud, so no tiles"));
    const fs::path file = write_file(folder / "tile.las", las_of(surveyed()));
    EXPECT_TRUE(says(run(file, "--tar 1").err, "--write tiles3d makes folders whose files name each other"));
    EXPECT_TRUE(
        says(run(file, "--tiles-crs 25832").err, "tiles-crs: \"25832\" given, expected a code such as EPSG:25832"));
}

} // namespace
} // namespace scanshade
