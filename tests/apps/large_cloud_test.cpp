// Clouds computed from disk: the same values and bytes as in memory, no seams, and nothing left behind.
#include "ao/cloud/cloud_ao.h"
#include "ao/cloud/large_cloud.h"
#include "ao/cloud/surface/neighbours.h"
#include "ao/gpu/device.h"
#include "apps/large/large_cloud_run.h"
#include "apps/large/survey.h"
#include "apps/large/tiles_on_disk.h"
#include "apps/walk/batch_options.h"
#include "apps/walk/large_frames.h"
#include "io/clouds/cloud_file.h"
#include "projection/base/error.h"
#include "projection/sensor/expected_error.h"
#include "tests/support/files.h"
#include "tests/support/points.h"

#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <limits>
#include <map>
#include <tbb/global_control.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>
#include <thread>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d, Eigen::Vector3f;
using tests::Points, tests::file_bytes;

constexpr int little_memory_mib = 64; // for 160,000 points
CloudAoOptions quick(double radius = 0.1) {
    return {.radius = radius, .rays = 4, .outside = "1,1,1", .memory_mib = little_memory_mib};
}

template <class Number>
void put(std::string& bytes, std::size_t at, Number value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

/// A corner with copies of points, holes and strays.
Points odd_corner(std::size_t count) {
    Points points = tests::corner(count);
    for (std::size_t i = 0; i < count; i += 50)
        points[i] = points[count - 1 - i];
    for (std::size_t i = 7; i < count; i += 5000)
        points[i].setConstant(std::numeric_limits<double>::quiet_NaN());
    for (std::size_t i = 11; i < count; i += count / 20)
        points[i] = {500 + static_cast<double>(i % 17), 300, -400};
    return points;
}

fs::path write_ply(const fs::path& file, const Points& points) {
    std::vector<float> numbers(points.size());
    for (std::size_t i = 0; i < numbers.size(); ++i)
        numbers[i] = static_cast<float>(i);
    write_new_ply(file, points, std::vector<cv::Vec3b>(points.size(), {1, 2, 3}), {{"number", numbers}}, {"a comment"});
    return file;
}

fs::path write_pcd(const fs::path& file, const Points& points) {
    std::string bytes =
        fmt::format("# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH "
                    "{}\nHEIGHT 1\nVIEWPOINT 1 1 1 1 0 0 0\nPOINTS {}\nDATA binary\n",
                    points.size(), points.size());
    bytes.append(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(Vector3d));
    return tests::write_file(file, bytes + "trailing");
}

fs::path write_las(const fs::path& file, const Points& points) {
    std::string bytes(227 + 20 * points.size(), '\0');
    std::memcpy(bytes.data(), "LASF", 4);
    bytes[24] = 1, bytes[25] = 2;
    put(bytes, 94, std::uint16_t(227)), put(bytes, 96, std::uint32_t(227)), put(bytes, 105, std::uint16_t(20));
    put(bytes, 107, static_cast<std::uint32_t>(points.size()));
    std::array<double, 3> low{1e30, 1e30, 1e30}, high{-1e30, -1e30, -1e30};
    for (std::size_t axis = 0; axis < 3; ++axis)
        put(bytes, 131 + 8 * axis, 1e-5);
    for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const double along = points[i].allFinite() ? points[i][static_cast<int>(axis)] : 0;
            const auto whole = static_cast<std::int32_t>(std::lround(along * 1e5));
            put(bytes, 227 + 20 * i + 4 * axis, whole);
            low[axis] = std::min(low[axis], whole * 1e-5), high[axis] = std::max(high[axis], whole * 1e-5);
        }
    for (std::size_t axis = 0; axis < 3; ++axis)
        put(bytes, 179 + 16 * axis, high[axis]), put(bytes, 187 + 16 * axis, low[axis]);
    return tests::write_file(file, bytes);
}

CloudStream stream_of(const fs::path& file) {
    std::vector<std::string> warnings;
    CloudShape shape = cloud_shape(file, warnings).value();
    EXPECT_EQ(shape.whole_since, "");
    return {file, std::move(shape)};
}

/// Computes and writes a file from disk.
LargeCloudRun::Result from_disk(const fs::path& file, const fs::path& target, const CloudAoOptions& options,
                                LargeSettings settings) {
    CloudAo method(options);
    std::vector<CloudStream> files{stream_of(file)};
    LargeCloudRun run(std::move(files), std::move(settings));
    run.compute(method);
    EXPECT_GT(run.found().tiles, 1);
    return run.result(0, target, {}, true);
}

/// Computes and writes a file that is read as a whole.
void in_memory(const fs::path& file, const fs::path& target, const CloudAoOptions& options) {
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(file, warnings);
    std::optional<Vector3d> scanner;
    if (cloud.records->viewpoint)
        scanner = cloud.records->viewpoint->translation();
    const auto normals = recorded_normals(cloud);
    const PointVisibility found = CloudAo(options).compute({cloud.points, normals, {}, z_is_up(cloud)}, scanner);
    EXPECT_GT(found.tiles, 1);
    const std::vector<float> confidence = confidence_of_points(found.error);
    write_cloud(target, cloud,
                {{"ambient_occlusion", found.visibility}, {"ao_confidence", confidence}, {"ao_error", found.error}});
}

TEST(LargeCloud, files_from_disk_have_the_bytes_of_those_computed_in_memory) {
    const tests::TemporaryFolder folder;
    const Points points = odd_corner(200000);
    for (const fs::path& file : {write_ply(folder / "a.ply", points), write_pcd(folder / "a.pcd", points),
                                 write_las(folder / "a.las", points)}) {
        const fs::path one = folder / ("one" + file.extension().string()),
                       other = folder / ("other" + file.extension().string());
        in_memory(file, one, quick());
        const auto result = from_disk(file, other, quick(), {.folder = folder / "tiles", .shown = 1000});
        EXPECT_TRUE(file_bytes(one) == file_bytes(other)) << file;
        EXPECT_FALSE(fs::exists(folder / "tiles")) << "temporary files are removed";
        EXPECT_NEAR(static_cast<double>(result.shown.points.size()), 1000, 150) << file;
        EXPECT_EQ(result.points, points.size());
        EXPECT_GT(static_cast<double>(result.known), 0.99 * static_cast<double>(result.valid)) << file;
    }
}

TEST(LargeCloud, an_interrupted_run_goes_on_to_equal_bytes) {
    const tests::TemporaryFolder folder;
    const fs::path file = write_ply(folder / "a.ply", tests::corner(200000));
    (void)from_disk(file, folder / "once.ply", quick(), {.folder = folder / "tiles"});
    int asked = 0, resumed = 0;
    bool done = false;
    for (int stops = 3; !done && stops < 1000; stops += 3) { // later each time, from the first pass to the last tile
        asked = 0;
        const auto stop = [&] { return ++asked > stops; };
        try {
            (void)from_disk(file, folder / "twice.ply", quick(),
                            {.folder = folder / "tiles", .stop = stop, .say = [&](const std::string& sentence) {
                                 resumed += sentence.find("of an earlier run") != std::string::npos;
                             }});
            done = true;
        } catch (const Outage&) {
        }
    }
    EXPECT_TRUE(done);
    EXPECT_GT(resumed, 0);
    EXPECT_TRUE(file_bytes(folder / "once.ply") == file_bytes(folder / "twice.ply"));
    EXPECT_FALSE(fs::exists(folder / "tiles"));
}

TEST(LargeCloud, a_helper_computes_tiles_and_the_bytes_stay) {
    const tests::TemporaryFolder folder;
    const fs::path file = write_ply(folder / "a.ply", odd_corner(200000)), tiles = folder / "tiles";
    (void)from_disk(file, folder / "alone.ply", quick(), {.folder = folder / "other"});
    const auto sorted = [&] { return fs::exists(tiles / "index"); };
    EXPECT_THROW((void)from_disk(file, folder / "stopped.ply", quick(), {.folder = tiles, .stop = sorted}), Outage);
    ASSERT_TRUE(sorted());

    CloudAo method(quick());
    {
        LargeCloudRun helper({stream_of(file)}, {.folder = tiles, .helps = true});
        EXPECT_TRUE(helper.has_tiles());
        helper.compute(method);
    }
    EXPECT_TRUE(sorted()) << "the tiles are not the helper's to remove";
    std::string said;
    (void)from_disk(file, folder / "helped.ply", quick(),
                    {.folder = tiles, .say = [&](const std::string& sentence) { said += sentence; }});
    EXPECT_NE(said.find("3 of 3 tiles are done"), std::string::npos) << said;
    EXPECT_TRUE(file_bytes(folder / "alone.ply") == file_bytes(folder / "helped.ply"));
    EXPECT_FALSE(fs::exists(tiles));

    CloudAo other(quick(0.2));
    LargeCloudRun helper({stream_of(file)}, {.folder = tiles, .helps = true});
    EXPECT_FALSE(helper.has_tiles());
    EXPECT_THROW(helper.compute(other), Outage) << "it neither sorts points nor makes the folder";
    EXPECT_FALSE(fs::exists(tiles));
}

TEST(LargeCloud, a_tile_is_computed_by_one_process_at_a_time) {
    const tests::TemporaryFolder folder;
    const auto store = [&](bool helps) {
        return std::make_unique<TilesOnDisk>(folder / "tiles", "", 10, 0, 1 << 20,
                                             std::function<void(const std::string&)>(), helps);
    };
    std::string decided;
    const auto one = store(false), other = store(true);
    EXPECT_FALSE(one->begin("plan", 3, false, 1, decided));
    one->decide("sorted");
    EXPECT_TRUE(other->begin("plan", 3, false, 1, decided));
    EXPECT_EQ(decided, "sorted");
    EXPECT_TRUE(one->claim(0));
    EXPECT_FALSE(other->claim(0));
    EXPECT_TRUE(other->claim(1));
    EXPECT_FALSE(one->claim(1)) << "and 0 is free again";
    EXPECT_TRUE(other->claim(0)) << "a process holds one at a time";
    other->keep(0, {});
    other->release();
    EXPECT_TRUE(one->claim(0));
    EXPECT_FALSE(other->claim(0)) << "it is done";
}

TEST(LargeCloud, tiles_of_other_settings_are_not_taken) {
    const tests::TemporaryFolder folder;
    const fs::path file = write_ply(folder / "a.ply", tests::corner(200000));
    int asked = 0;
    const auto late = [&] { return ++asked > 6; };
    EXPECT_THROW((void)from_disk(file, folder / "b.ply", quick(0.1), {.folder = folder / "tiles", .stop = late}),
                 Outage);
    std::string said;
    (void)from_disk(file, folder / "b.ply", quick(0.12),
                    {.folder = folder / "tiles", .say = [&](const std::string& sentence) { said += sentence; }});
    EXPECT_EQ(said.find("of an earlier run"), std::string::npos) << said;
    EXPECT_NE(said.find("of temporary files in"), std::string::npos) << said;
    (void)from_disk(file, folder / "c.ply", quick(0.12), {.folder = folder / "other"});
    EXPECT_TRUE(file_bytes(folder / "b.ply") == file_bytes(folder / "c.ply"));
}

TEST(LargeCloud, tiles_that_do_not_fit_on_the_disk_are_refused_before_they_are_written) {
    const tests::TemporaryFolder folder;
    TilesOnDisk tiles(folder / "tiles", "key", std::size_t(1) << 50, 0, 1 << 20, {});
    std::string decided;
    try {
        (void)tiles.begin("plan", 4, false, 1.5, decided);
        FAIL() << "a petabyte fits";
    } catch (const Error& failure) {
        EXPECT_NE(std::string(failure.what()).find("too little"), std::string::npos) << failure.what();
    }
    EXPECT_FALSE(fs::exists(folder / "tiles"));
}

/// What a run takes beside the points in work: a program of 30 MiB, samples, buffers. Software drivers would be 60
/// more.
TEST(LargeCloud, a_run_from_disk_takes_little_memory_beside_the_points_in_work) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers take memory of their own";
#endif
    ::unsetenv("SCANSHADE_VALIDATE"); // which loads drivers
    if (gpu::may_have_gpu())
        GTEST_SKIP() << "drivers of GPUs take memory of their own";
    const tests::TemporaryFolder folder;
    const fs::path file = write_ply(folder / "a.ply", tests::corner(400000));
    const std::string command =
        fmt::format("'{}' run '{}' -o '{}' --page no --write cloud --cloud.outside 1,1,1 --cloud.rays 4 --cloud.memory "
                    "{} -q >/dev/null 2>&1",
                    SCANSHADE_PROGRAM, file.string(), (folder / "out").string(), little_memory_mib);
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
    const std::string manifest = file_bytes(folder / "out" / "manifest.json"), key = "\"peak_memory_mib\": ";
    const std::size_t at = manifest.find(key);
    ASSERT_NE(at, std::string::npos);
    EXPECT_LT(std::stod(manifest.substr(at + key.size())), little_memory_mib + 96);
}

TEST(LargeCloud, cut_files_are_refused_by_name) {
    const tests::TemporaryFolder folder;
    const Points points = tests::corner(1000);
    for (const fs::path& file : {write_ply(folder / "a.ply", points), write_pcd(folder / "a.pcd", points),
                                 write_las(folder / "a.las", points)}) {
        fs::resize_file(file, fs::file_size(file) / 2);
        std::vector<std::string> warnings;
        try {
            (void)cloud_shape(file, warnings);
            ADD_FAILURE() << file << " is taken";
        } catch (const Error& failure) {
            EXPECT_NE(std::string(failure.what()).find(file.filename().string()), std::string::npos) << failure.what();
        }
    }
}

/// Points in memory.
class Source final : public PointSource {
  public:
    explicit Source(const Points& points) : points_(points) {}
    [[nodiscard]] std::size_t size() const override { return points_.size(); }
    void pass(const Visit& visit) override { visit(0, points_, {}); }
    [[nodiscard]] bool has_normals() const override { return false; }
    [[nodiscard]] bool z_up() const override { return false; }
    [[nodiscard]] std::optional<Vector3d> scanner() const override { return std::nullopt; }

  private:
    const Points& points_;
};

/// Remembers which tile computes each point.
class Observed final : public TileStore {
  public:
    Observed(const fs::path& folder, std::size_t points)
        : tile_of(points), visibility(points, std::numeric_limits<float>::quiet_NaN()),
          tiles_(folder, "", points, 0, 1 << 20, {}) {}
    bool begin(const std::string& plan, std::size_t tiles, bool normals, double copies, std::string& decided) override {
        last_ = tiles - 2;
        return tiles_.begin(plan, tiles, normals, copies, decided);
    }
    void add(std::size_t tile, std::uint32_t number, const Vector3d& point, const Vector3f& normal,
             bool core) override {
        if (core && tile < last_)
            tile_of[number] = tile;
        tiles_.add(tile, number, point, normal, core);
    }
    void decide(const std::string& decided) override { tiles_.decide(decided); }
    [[nodiscard]] std::size_t count(std::size_t tile) const override { return tiles_.count(tile); }
    [[nodiscard]] TilePoints points(std::size_t tile) override { return tiles_.points(tile); }
    [[nodiscard]] std::optional<TileValues> values(std::size_t tile) override { return tiles_.values(tile); }
    void keep(std::size_t tile, TileValues values) override {
        for (std::size_t k = 0; k < values.numbers.size(); ++k)
            visibility[values.numbers[k]] = values.visibility[k];
        tiles_.keep(tile, std::move(values));
    }
    std::vector<std::size_t> tile_of;
    std::vector<float> visibility;

  private:
    std::size_t last_ = 0;
    TilesOnDisk tiles_;
};

/// A mean over points, and its standard error where neighbouring points are alike: sums of blocks are taken for
/// independent (a ratio estimator; Cochran, Sampling Techniques, ch. 2.11 and 6.4).
class BlockMean {
  public:
    void add(const Vector3d& point, double block, double value) {
        const Eigen::Vector3i cell = (point / block).array().floor().cast<int>();
        auto& [sum, count] = blocks_[{cell.x(), cell.y(), cell.z()}];
        sum += value, count += 1;
    }
    [[nodiscard]] double mean() const {
        double sum = 0, count = 0;
        for (const auto& [cell, block] : blocks_)
            sum += block.first, count += block.second;
        return sum / count;
    }
    [[nodiscard]] double error() const {
        const double all = mean();
        double squares = 0, count = 0;
        for (const auto& [cell, block] : blocks_)
            squares += std::pow(block.first - all * block.second, 2), count += block.second;
        const auto blocks = static_cast<double>(blocks_.size());
        return std::sqrt(squares * blocks / (blocks - 1)) / count;
    }

  private:
    std::map<std::array<int, 3>, std::pair<double, double>> blocks_;
};

/// Tiles against one tile of all points, within a spacing of borders and elsewhere. Tiles throw other rays, since
/// directions follow from a tile's tree. Without seams, their differences are therefore those between two runs on all
/// points with other seeds: at the same points, squares of both have one expectation, and means are 0. A seam is
/// what is more beside borders than elsewhere.
struct Seams {
    BlockMean excess[2]; ///< difference squared, less that of the seeds; elsewhere, and beside borders
    BlockMean shift[2];  ///< difference
    BlockMean seeds[2];  ///< that of the seeds, squared
    std::size_t beside = 0;
    double told_error = 0; ///< of the run in tiles

    /// Three standard errors, and half a step of 8 bits, which nobody sees. Standard errors are of blocks, so they do
    /// not cover what all blocks share, the directions of a seed: with five seeds the noisy corner's squares were
    /// -1.9e-6 .. 4.2e-6 more beside borders than elsewhere, where one standard error is 0.7e-6 .. 3e-6.
    ///
    /// A cloud that is cleaned differs by more everywhere, since its discs depend on points farther away than a rim is
    /// wide (0.0105 RMS where other rays differ by 0.0079; 0.0089 with rims of twice the radius): `cleaned` allows
    /// that.
    void check(const char* what, bool cleaned = false) const {
        fmt::print(
            "seams, {}: {} points beside borders; RMS of rays {:.4f} there, {:.4f} elsewhere; excess of squares "
            "{:.2e} +- {:.1e} there, {:.2e} +- {:.1e} elsewhere; shift {:.5f} +- {:.5f} there; told error {:.3f}\n",
            what, beside, std::sqrt(seeds[1].mean()), std::sqrt(seeds[0].mean()), excess[1].mean(), excess[1].error(),
            excess[0].mean(), excess[0].error(), shift[1].mean(), shift[1].error(), told_error);
        EXPECT_GT(beside, 500U) << what;
        const double uncertain = std::hypot(excess[1].error(), excess[0].error());
        constexpr double unseen = 0.5 / 255;
        EXPECT_LT(excess[1].mean() - excess[0].mean(), 3 * uncertain + unseen * unseen) << what;
        constexpr double of_cleaning = 1.5e-4;
        EXPECT_LT(excess[0].mean(), cleaned ? of_cleaning : 0.2 * seeds[0].mean() + 3 * excess[0].error())
            << what << ": tiles change values everywhere by more than other rays do";
        EXPECT_LT(std::abs(shift[1].mean()), 3 * shift[1].error()) << what;
        EXPECT_LT(std::sqrt(3 * uncertain + unseen * unseen), 0.02) << what << ": a step of that height would be seen";
    }
};
Seams seams_of(const Points& points, CloudAoOptions options) {
    const tests::TemporaryFolder folder;
    Source source(points);
    Observed store(folder / "tiles", points.size());
    const PointVisibility told = CloudAo(options).compute_large(source, store, 1000, {});
    EXPECT_GT(told.tiles, 1);
    options.memory_mib = 4096;
    const PointVisibility whole = CloudAo(options).compute({points});
    EXPECT_EQ(whole.tiles, 1);
    options.seed = 2;
    const PointVisibility other_rays = CloudAo(options).compute({points});
    const LocalCloud cloud(points);
    Seams seams;
    seams.told_error = told.expected_error.value_or(0);
    for (std::size_t i = 0; i < points.size(); ++i) {
        bool border = false;
        const std::size_t number = cloud.tree.original(i);
        cloud.tree.for_each_within(cloud.tree[i], static_cast<float>(told.spacing), [&](std::size_t other) {
            border |= store.tile_of[cloud.tree.original(other)] != store.tile_of[number];
        });
        const auto all = static_cast<double>(whole.visibility[number]);
        const double off = static_cast<double>(store.visibility[number]) - all,
                     seed = static_cast<double>(other_rays.visibility[number]) - all;
        if (std::isnan(off) || std::isnan(seed))
            continue;
        const double block = told.radius; // what occludes is shared within
        seams.excess[border].add(points[number], block, off * off - seed * seed);
        seams.shift[border].add(points[number], block, off);
        seams.seeds[border].add(points[number], block, seed * seed);
        seams.beside += border;
    }
    return seams;
}

/// Hills of several sizes, seen from above; noise is a fourteenth of the spacing, as of airborne scans.
Points terrain(std::size_t count, double sigma = 0.0005) {
    Points points;
    tests::Dice dice;
    for (std::size_t i = 0; i < count; ++i) {
        const double x = 4 * dice.roll(), y = 4 * dice.roll();
        points.emplace_back(x, y,
                            0.3 * std::sin(2 * x) * std::cos(1.5 * y) + 0.08 * std::sin(9 * x + 2 * y) +
                                0.03 * std::sin(25 * y) + sigma * dice.gauss());
    }
    return points;
}

TEST(LargeCloud, indoors_values_differ_no_more_beside_borders_of_tiles_than_rays_do) {
    const std::array names{"corner", "noisy corner", "cleaned corner"};
    for (const int sigma_mm : {0, 1, 2})
        seams_of(tests::corner(400000, 0.001 * sigma_mm), {.radius = 0.2, .outside = "1,1,1", .memory_mib = 64})
            .check(names[static_cast<std::size_t>(sigma_mm)], sigma_mm == 2);
}

TEST(LargeCloud, on_terrain_values_differ_no_more_beside_borders_of_tiles_than_rays_do) {
    seams_of(terrain(400000), {.radius = 0.2, .outside = "up", .memory_mib = 64}).check("terrain");
}

/// Noise of a third of the spacing: which points are taken together decides on all values.
TEST(LargeCloud, values_of_noisy_points_do_not_depend_on_the_memory) {
    seams_of(terrain(400000, 0.002), {.radius = 0.2, .outside = "up", .memory_mib = 64}).check("noisy terrain");
}

/// Without recorded normals, and from all sides: a part of a ball by itself could be seen from either.
TEST(LargeCloud, tiles_agree_about_sides_and_noise) {
    Points points = tests::sphere(300000, {10, 20, 30});
    tests::Dice dice;
    for (Vector3d& point : points)
        point += 0.004 * dice.gauss() * (point - Vector3d(10, 20, 30)).normalized();
    seams_of(points, {.radius = 0.2, .memory_mib = 64}).check("noisy ball");
}

SurveyTile tile(double x, double y, double wide = 10, const std::string& kind = "LAS") {
    return {{Vector3d(x, y, 0), Vector3d(x + wide, y + wide, 3)}, kind};
}

TEST(Survey, adjoining_files_of_one_kind_are_tiles) {
    const auto groups = surveys_in({tile(0, 0), tile(10, 0), tile(0, 10.1), tile(500, 0), tile(20, 0, 10, "PLY")});
    ASSERT_EQ(groups.size(), 1U);
    EXPECT_EQ(groups[0], (std::vector<std::size_t>{0, 1, 2})) << "the others are far off, or of another kind";
    EXPECT_EQ(surveys_in({tile(0, 0), tile(9, 0), std::nullopt, tile(18, 0)}).size(), 1U) << "strips overlap a little";
}

TEST(Survey, scans_of_one_place_are_no_tiles) {
    EXPECT_TRUE(surveys_in({tile(0, 0), tile(1, 1), tile(10, 0)}).empty());
    EXPECT_TRUE(surveys_in({tile(0, 0), tile(0, 0)}).empty());
    EXPECT_TRUE(surveys_in({tile(0, 0), tile(30, 0)}).empty()) << "apart";
    EXPECT_TRUE(surveys_in({tile(0, 0)}).empty());
}

/// The border crosses floor and wall: by itself, a tile does not see the other's half of the wall.
TEST(Survey, points_at_borders_see_the_neighbouring_tile) {
    const tests::TemporaryFolder folder;
    const Points all = tests::corner(120000);
    Points near, far;
    for (const Vector3d& point : all)
        (point.y() < 1 ? near : far).push_back(point);
    Points in_order = near;
    in_order.insert(in_order.end(), far.begin(), far.end());
    const double radius = 0.3;
    const CloudAoOptions options{.radius = radius, .outside = "1,1,1"};
    const auto whole = CloudAo(options).compute({in_order}).visibility;
    std::vector<CloudStream> files{stream_of(write_las(folder / "a.las", near)),
                                   stream_of(write_las(folder / "b.las", far))};
    std::vector<std::optional<SurveyTile>> boxes;
    for (const CloudStream& file : files)
        boxes.push_back(SurveyTile{file.box().value(), "LAS"});
    EXPECT_EQ(surveys_in(boxes).size(), 1U);
    std::vector<float> joined, apart;
    CloudAo method(options);
    LargeCloudRun run(files, {.folder = folder / "tiles"});
    run.compute(method);
    for (std::size_t k = 0; k < files.size(); ++k) {
        const fs::path target = folder / fmt::format("{}.las", k);
        (void)run.result(k, target, {}, false);
        std::vector<std::string> warnings;
        std::ranges::copy(recorded_field(read_cloud(target, warnings), "ambient_occlusion", target),
                          std::back_inserter(joined));
        std::ranges::copy(CloudAo(options).compute({k == 0 ? near : far}).visibility, std::back_inserter(apart));
    }
    const auto beside = [&](const std::vector<float>& values) {
        std::vector<float> some, same;
        for (std::size_t i = 0; i < in_order.size(); ++i)
            if (std::abs(in_order[i].y() - 1) < radius / 4) {
                some.push_back(values[i]);
                same.push_back(whole[i]);
            }
        return tests::rms_between(some, same);
    };
    fmt::print("beside the border: RMS {:.4f} as tiles of one survey, {:.4f} each by itself\n", beside(joined),
               beside(apart));
    EXPECT_LT(beside(joined), 0.01);
    EXPECT_GT(beside(apart), 3 * beside(joined));
}

/// The frame that looks for surveys waits for tasks of its own; were it to begin another frame meanwhile, it would wait
/// for itself.
TEST(Survey, frames_begun_together_do_not_wait_for_each_other) {
    const tests::TemporaryFolder folder;
    const fs::path file = folder / "a.ply"; // whose header takes a while to read
    {
        std::ofstream text(file);
        text << "ply\nformat ascii 1.0\n";
        for (int i = 0; i < 2000; ++i)
            text << "comment line " << i << '\n';
        text << "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
    }
    Capture capture;
    for (int i = 0; i < 50; ++i) {
        CaptureEntry entry;
        entry.name = fmt::format("{:03}", i);
        entry.cloud = file;
        capture.entries.push_back(std::move(entry));
    }
    CloudAo method({.memory_mib = 64});
    BatchOptions options;
    options.outputs.folder = folder / "out";
    options.points = &method;
    const tbb::global_control more_threads(tbb::global_control::max_allowed_parallelism, 8);
    tbb::task_arena(8).execute([&] {
        for (int again = 0; again < 100; ++again) {
            LargeFrames frames(capture, options);
            std::atomic<int> in_memory = 0;
            std::size_t next = 0;
            const auto begun =
                tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, [&](tbb::flow_control& control) {
                    if (next == 4 * capture.entries.size())
                        control.stop();
                    return next++;
                });
            const auto loaded = tbb::make_filter<std::size_t, void>(tbb::filter_mode::parallel, [&](std::size_t i) {
                std::vector<std::string> warnings, notes;
                if (i % 4 == 1)
                    in_memory += frames.part_of(i / 4, warnings, notes).run == nullptr;
                else // other work, whose threads help with the search
                    std::this_thread::sleep_for(std::chrono::microseconds(50));
            });
            tbb::parallel_pipeline(32, begun & loaded);
            EXPECT_EQ(in_memory, capture.entries.size());
        }
    });
}

TEST(LargeCloud, laz_from_disk_is_that_of_laz_in_memory) {
    const char* const data = std::getenv("SCANSHADE_LAZ"); // a file with more points than 64 MiB hold
    if (!data)
        GTEST_SKIP() << "SCANSHADE_LAZ names no file";
    const tests::TemporaryFolder folder;
    const fs::path file = data;
    const CloudAoOptions options{.rays = 4, .memory_mib = little_memory_mib};
    in_memory(file, folder / "one.laz", options);
    (void)from_disk(file, folder / "other.laz", options, {.folder = folder / "tiles", .shown = 1000});
    EXPECT_TRUE(file_bytes(folder / "one.laz") == file_bytes(folder / "other.laz"));
}

} // namespace
} // namespace scanshade
