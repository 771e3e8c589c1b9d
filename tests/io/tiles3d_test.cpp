// 3D Tiles as they are written: each point once, boxes within boxes, and what is refused.
#include "io/clouds/tiles3d.h"
#include "projection/base/error.h"
#include "tests/support/points.h"
#include "tests/support/tileset.h"

#include <cmath>
#include <limits>

namespace scanshade {
namespace {

using Eigen::Vector3d;
using tests::Dice, tests::TemporaryFolder, tests::Tileset, tests::TilesetReader;

/// A hilly sheet, and a ball in which points are everywhere.
std::vector<Vector3d> hills(std::size_t count) {
    Dice dice;
    std::vector<Vector3d> points;
    for (std::size_t i = 0; i < count; ++i) {
        const Vector3d p(30 * dice.roll() - 15, 20 * dice.roll(), 0);
        points.emplace_back(p.x(), p.y(), 0.3 * std::sin(p.x()) * std::cos(p.y()));
        if (i % 4 == 0)
            points.back() = Vector3d(3 + dice.gauss(), 5 + dice.gauss(), 4 + dice.gauss());
    }
    return points;
}

/// Each point with its number in the field _NUMBER; one of them has no coordinates.
Tileset written_and_read(const std::filesystem::path& folder, std::vector<Vector3d> points,
                         const TilesetOptions& options, TilesWritten& written) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    points.emplace_back(nan, nan, nan);
    std::vector<float> numbers(points.size());
    std::iota(numbers.begin(), numbers.end(), 0.0F);
    const std::vector<cv::Vec3b> colours(points.size(), cv::Vec3b(0, 128, 255));
    written = write_tiles3d(folder, {.points = points, .colours = colours, .fields = {{"_NUMBER", numbers}}}, options);
    EXPECT_EQ(written.left_out, 1u);
    EXPECT_EQ(written.points, points.size() - 1);
    Tileset back = TilesetReader(folder).read();
    EXPECT_EQ(back.points.size(), points.size() - 1);
    std::vector<int> met(points.size(), 0);
    for (std::size_t i = 0; i < back.points.size(); ++i) {
        const auto number = static_cast<std::size_t>(back.fields["_NUMBER"][i]);
        ++met[number];
        EXPECT_LE((back.points[i] - points[number]).cwiseAbs().maxCoeff(), back.most_step + 1e-12);
    }
    met.back() = 1;
    EXPECT_EQ(std::ranges::count(met, 1), static_cast<std::ptrdiff_t>(met.size())) << "each point once";
    return back;
}

TEST(Tiles3d, have_each_point_once_in_boxes_within_boxes) {
    const TemporaryFolder folder;
    TilesWritten written;
    const Tileset back = written_and_read(folder / "tiles/a", hills(20000), {.most_points = 300}, written);
    EXPECT_LE(std::ranges::max(back.sizes), 300u);
    EXPECT_GT(back.sizes.size(), 100u);
    EXPECT_EQ(back.sizes.size(), written.tiles);
    EXPECT_EQ(back.documents, 1u);
    EXPECT_EQ(written.files.size(), written.tiles + 1);
    EXPECT_EQ(written.files.front(), "tileset.json");
    EXPECT_GT(written.levels, 2);
    EXPECT_EQ(back.sizes.front(), 270u) << "a root of many points is full, but for a tenth";
    EXPECT_FALSE(back.transform);
    EXPECT_NEAR(back.colours[1] / 65535.0, 0.2158, 1e-3) << "linear light of 128";
    for (const auto& entry : std::filesystem::directory_iterator(folder / "tiles"))
        EXPECT_EQ(entry.path().filename(), "a") << "nothing temporary stays";
}

TEST(Tiles3d, of_many_are_in_several_documents) {
    const TemporaryFolder folder;
    TilesWritten written;
    const Tileset back = written_and_read(folder / "a", hills(20000), {.most_points = 100, .most_tiles = 60}, written);
    EXPECT_GT(back.documents, 3u);
    EXPECT_LE(back.most_in_document, 60u);
    EXPECT_EQ(back.sizes.size(), written.tiles);
    EXPECT_EQ(written.files.size(), written.tiles + back.documents);
}

TEST(Tiles3d, of_a_cloud_larger_than_the_memory_have_the_bytes_of_others) {
    const TemporaryFolder folder;
    const std::vector<Vector3d> points = hills(20000);
    std::vector<float> numbers(points.size());
    std::iota(numbers.begin(), numbers.end(), 0.0F);
    const std::vector<cv::Vec3b> colours(points.size(), cv::Vec3b(0, 128, 255));
    const TilesetOptions options{.most_points = 300};
    const TilesWritten whole =
        write_tiles3d(folder / "a", {.points = points, .colours = colours, .fields = {{"_NUMBER", numbers}}}, options);
    for (const std::size_t at_once : {1500U, 300U}) {
        LargeTileset large(folder / "b", options, at_once);
        for (std::size_t first = 0; first < points.size(); first += 700) {
            const std::size_t count = std::min<std::size_t>(700, points.size() - first);
            large.add({.points = std::span(points).subspan(first, count),
                       .colours = std::span(colours).subspan(first, count),
                       .fields = {{"_NUMBER", std::span(numbers).subspan(first, count)}}});
        }
        const TilesWritten parts = large.finish({});
        EXPECT_EQ(parts.files, whole.files);
        EXPECT_EQ(parts.levels, whole.levels);
        for (const auto& file : whole.files)
            ASSERT_EQ(tests::file_bytes(folder / "b" / file), tests::file_bytes(folder / "a" / file)) << file;
        const auto entries = std::distance(std::filesystem::directory_iterator(folder / "b"), {});
        EXPECT_EQ(static_cast<std::size_t>(entries), whole.files.size()) << "nothing temporary stays";
    }
    {
        LargeTileset left(folder / "c", options);
        left.add({.points = points, .colours = colours});
    }
    EXPECT_FALSE(std::filesystem::exists(folder / ".c.part")) << "unfinished";
    EXPECT_THROW(LargeTileset(folder / "d", options).finish({}), Error);
}

TEST(Tiles3d, of_few_points_or_of_one_place_end) {
    const TemporaryFolder folder;
    TilesWritten written;
    EXPECT_EQ(written_and_read(folder / "a", {Vector3d(1, 2, 3)}, {}, written).sizes.size(), 1u);
    const Tileset same = written_and_read(folder / "b", std::vector<Vector3d>(500, Vector3d(1e6, 2e6, 3)),
                                          {.most_points = 100}, written);
    EXPECT_GE(std::ranges::max(same.sizes), 400u) << "what has one place is not parted for ever";
}

TEST(Tiles3d, replace_those_of_before_and_have_their_place_on_the_earth) {
    const TemporaryFolder folder;
    tests::write_file(folder / "a/r7.glb", "of an earlier run");
    tests::write_file(folder / ".a.part/r6.glb", "of a killed run");
    Eigen::Isometry3d place = Eigen::Isometry3d::Identity();
    place.translation() = Vector3d(3786248.4557544487, 890254.7472238652, 5038041.62391188);
    place.linear() = Eigen::AngleAxisd(1.2345, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    const std::vector<Vector3d> points = hills(100);
    const std::vector<cv::Vec3b> colours(points.size());
    write_tiles3d(folder / "a", {.points = points, .colours = colours, .earth_from_tiles = place});
    EXPECT_EQ(TilesetReader(folder / "a").read().transform, place.matrix()) << "with all digits";
    EXPECT_FALSE(std::filesystem::exists(folder / "a/r7.glb"));
    EXPECT_FALSE(std::filesystem::exists(folder / ".a.part"));
}

TEST(Tiles3d, of_no_points_are_refused) {
    const TemporaryFolder folder;
    EXPECT_THROW(write_tiles3d(folder / "a", {.name = "a"}), Error);
    EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

} // namespace
} // namespace scanshade
