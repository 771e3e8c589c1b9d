// Pages without a browser: names that could break out of a script, files that a run leaves, and what `view`, `merge`
// and several captures make. browser_test looks at the pages themselves.
#include "apps/page/list_page.h"
#include "apps/page/points.h"
#include "apps/page/preview.h"
#include "apps/page/run_page.h"
#include "apps/page/text.h"
#include "apps/results/captures_page.h"
#include "io/captures/capture.h"
#include "io/clouds/cloud_file.h"
#include "io/clouds/number_fields.h"
#include "io/compression/inflate.h"
#include "tests/support/files.h"
#include "tests/support/points.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"
#include "tests/support/tile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::Ran;
using tests::read_bytes;
using tests::run_program;
using tests::says;
using tests::TemporaryFolder;

// ---------------------------------------------------------------------------------------------------- texts

TEST(PageTextTest, html_has_no_character_that_ends_text_or_an_attribute) {
    EXPECT_EQ(page::escaped("<a href='x' title=\"y\">&"), "&lt;a href=&#39;x&#39; title=&quot;y&quot;&gt;&amp;");
}

TEST(PageTextTest, a_script_keeps_its_text_and_cannot_be_ended_by_it) {
    // U+2028 and U+2029 end lines in older scripts, "</script" and "<!--" end or comment out scripts in HTML.
    const std::string text = "</script><!-- & \xE2\x80\xA8 \xE2\x80\xA9 \xE2\x80\xA6";
    const std::string script = page::for_script(nlohmann::json(text).dump());
    for (const char* part : {"<", "&", "\xE2\x80\xA8", "\xE2\x80\xA9"})
        EXPECT_EQ(script.find(part), std::string::npos) << script;
    EXPECT_EQ(nlohmann::json::parse(script).get<std::string>(), text);
}

TEST(PageTextTest, base64_is_that_of_the_standard) { // RFC 4648, section 10
    for (const auto& [plain, coded] :
         {std::pair("", ""), std::pair("f", "Zg=="), std::pair("fo", "Zm8="), std::pair("foo", "Zm9v"),
          std::pair("foob", "Zm9vYg=="), std::pair("fooba", "Zm9vYmE="), std::pair("foobar", "Zm9vYmFy")})
        EXPECT_EQ(page::base64(plain), coded);
    EXPECT_EQ(page::base64("\xff\xfe\xfd"), "//79") << "bytes above 127";
}

// ---------------------------------------------------------------------------------------------------- previews

TEST(PreviewTest, equal_frames_have_equal_previews_and_other_depths_another_one) {
    const cv::Mat1f z_m = tests::corner_depth(0), ao(z_m.size(), 0.5F);
    const page::Preview preview{.z_m = z_m, .visibility = ao, .camera = tests::small_camera().pinhole};
    EXPECT_EQ(page::preview_script(preview), page::preview_script(preview));
    cv::Mat1f nearer;
    z_m.convertTo(nearer, CV_32F, 0.5);
    EXPECT_NE(page::preview_script(preview),
              page::preview_script({.z_m = nearer, .visibility = ao, .camera = preview.camera}));
}

TEST(PreviewTest, a_large_image_becomes_a_small_preview) {
    const cv::Mat1f z_m(3000, 4000, 2.0F), ao(3000, 4000, 1.0F);
    const cv::Mat3b colour(3000, 4000, cv::Vec3b(1, 2, 3));
    const std::string script =
        page::preview_script({.z_m = z_m, .visibility = ao, .camera = {}, .colour = colour, .colour_fits = true});
    EXPECT_TRUE(says(script, "\"size\":[235,176],\"step\":17")); // 17 = 4000 / 240, rounded up
    EXPECT_LT(script.size(), 20000u);
}

TEST(PreviewTest, maps_without_any_value_are_no_error) {
    const cv::Mat1f holes(48, 64, 0.0F), none(48, 64, std::numeric_limits<float>::quiet_NaN());
    EXPECT_TRUE(says(page::preview_script({.z_m = holes, .visibility = none, .confidence = none}), "\"range\":[0,0]"));
}

// ---------------------------------------------------------------------------------------------------- points

/// What a script of points holds.
nlohmann::json chunk_in(const fs::path& file) {
    const std::string text = read_bytes(file), call = "scanshade.points(";
    EXPECT_TRUE(text.starts_with(call) && text.ends_with(")\n"));
    return nlohmann::json::parse(text.substr(call.size(), text.size() - call.size() - 2));
}

TEST(PagePointsTest, no_more_points_are_written_than_asked_for_and_the_page_knows_of_the_rest) {
    const TemporaryFolder folder;
    const tests::Points points = tests::square(30000);
    const std::vector<float> ao(points.size(), 0.5F);
    const auto files = page::write_points(folder.path(), "points/a", {.points = points, .visibility = ao}, 10000);
    ASSERT_EQ(files, std::vector<fs::path>{"points/a.000.js"});
    const nlohmann::json chunk = chunk_in(folder / files[0]), facts = chunk["facts"];
    EXPECT_EQ(chunk["count"], 10000);
    EXPECT_EQ(facts["total"], 10000);
    EXPECT_EQ(facts["of"], 30000);
    EXPECT_EQ(facts["left_out"], 0);
    (void)page::write_points(folder.path(), "b", {.points = points, .visibility = ao}, 10000);
    EXPECT_EQ(read_bytes(folder / "b.000.js"), read_bytes(folder / files[0])) << "equal clouds, equal bytes";
}

TEST(PagePointsTest, clouds_without_extent_or_points_are_no_error) {
    const TemporaryFolder folder;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(page::write_points(folder.path(), "none", {.points = {}}, 1000).empty());
    const tests::Points invalid(5, {nan, nan, nan}), same(5, {1, 2, 3}), line = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
    EXPECT_TRUE(page::write_points(folder.path(), "invalid", {.points = invalid}, 1000).empty());
    for (const auto& [name, points] : {std::pair("same", same), std::pair("line", line)}) {
        ASSERT_EQ(page::write_points(folder.path(), name, {.points = points}, 1000).size(), 1u);
        EXPECT_TRUE(
            says(read_bytes(folder / (std::string(name) + ".000.js")), fmt::format("\"count\":{}", points.size())));
    }
}

TEST(PagePointsTest, fields_have_steps_that_keep_integers_and_names_that_end_no_script) {
    const TemporaryFolder folder;
    const auto points = tests::corner(1000);
    const auto read = [](std::size_t i, std::span<double> values) {
        values[0] = static_cast<double>(i % 7);
        values[1] = i == 3 ? std::numeric_limits<double>::quiet_NaN() : 1e9 + static_cast<double>(i);
        values[2] = 4;
        values[3] = std::numeric_limits<double>::quiet_NaN();
        values[4] = static_cast<double>(i) * 1000;
    };
    (void)page::write_points(
        folder.path(), "a",
        {.points = points,
         .fields = {{"</script><b>", true}, {"time", false}, {"constant", true}, {"nothing", false}, {"wide", true}},
         .read = read},
        10000);
    EXPECT_EQ(read_bytes(folder / "a.000.js").find('<'), std::string::npos);
    const auto chunk = chunk_in(folder / "a.000.js");
    const auto fields = chunk["facts"]["fields"], codes = chunk["codes"];
    ASSERT_EQ(fields.size(), 4u) << "a field without any value is left out";
    ASSERT_EQ(codes.size(), 4u);
    nlohmann::json counts = nlohmann::json::array();
    for (int value = 0; value < 7; ++value)
        counts.push_back({value, value < 6 ? 143 : 142});
    EXPECT_EQ(
        fields[0],
        nlohmann::json(
            {{"name", "</script><b>"}, {"low", 0}, {"high", 6}, {"step", 1}, {"whole", true}, {"counts", counts}}));
    EXPECT_NEAR(fields[1]["step"].get<double>(), 999.0 / 65534, 1e-9);
    EXPECT_EQ(codes[2], "") << "a constant needs no codes";
    EXPECT_GT(fields[3]["step"].get<double>(), 1) << "integers of a wide range are rounded";
    EXPECT_EQ(fields[3]["name"], "wide");
}

TEST(PagePointsTest, more_fields_than_are_shown_are_counted) {
    const TemporaryFolder folder;
    const auto points = tests::corner(10);
    const std::vector<page::Field> fields(page::most_fields + 5, {"f", true});
    (void)page::write_points(
        folder.path(), "a",
        {.points = points,
         .fields = fields,
         .read = [](std::size_t i, std::span<double> values) { std::ranges::fill(values, static_cast<double>(i)); }},
        10000);
    const auto chunk = chunk_in(folder / "a.000.js");
    EXPECT_EQ(chunk["facts"]["fields"].size(), page::most_fields);
    EXPECT_EQ(chunk["facts"]["more_fields"], 5);
}

/// What packed() packed.
std::string unpacked(const std::string& base64) {
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string bytes;
    std::uint32_t bits = 0, count = 0;
    for (const char digit : base64.substr(0, base64.find('='))) {
        bits = bits << 6 | static_cast<std::uint32_t>(digits.find(digit));
        if ((count += 6) >= 8)
            bytes += static_cast<char>(bits >> (count -= 8));
    }
    return inflated(bytes, Inflate::zlib, 1 << 26);
}

/// Numbers of planes of folded differences.
std::vector<std::uint32_t> numbers_in(const std::string& bytes, std::size_t at, std::size_t count, std::size_t planes) {
    std::vector<std::uint32_t> numbers(count);
    std::uint32_t before = 0;
    for (std::size_t i = 0; i < count; ++i) {
        std::uint32_t folded = 0;
        for (std::size_t plane = 0; plane < planes; ++plane)
            folded |= std::uint32_t(static_cast<unsigned char>(bytes.at(at + plane * count + i))) << (8 * plane);
        before += folded & 1U ? ~(folded >> 1) : folded >> 1;
        numbers[i] = before &= (1U << (8 * planes)) - 1;
    }
    return numbers;
}

/// A cloud as a page reads it: of each node its level, box, the places of its points, and their numbers in the cloud.
struct ReadNode {
    int level = 0;
    Eigen::Vector3d low = Eigen::Vector3d::Zero();
    double edge = 0, step = 0, spacing = 0;
    tests::Points points;
    std::vector<std::size_t> numbers;
};

std::vector<ReadNode> read_octree(const fs::path& folder, const std::string& stem) {
    const auto facts = chunk_in(folder / (stem + ".000.js"))["facts"];
    const auto cube = facts["cube"].get<std::array<double, 4>>();
    std::vector<ReadNode> nodes;
    for (std::size_t part = 0; part < facts["tree"].size(); ++part) {
        const auto& [parent, octant, count, spacing] = facts["tree"][part].get<std::array<double, 4>>();
        ReadNode node;
        node.spacing = spacing;
        node.low = {cube[0], cube[1], cube[2]};
        node.edge = cube[3];
        if (part > 0) {
            const ReadNode& above = nodes.at(static_cast<std::size_t>(parent));
            node.level = above.level + 1;
            node.edge = above.edge / 2;
            for (int axis = 0; axis < 3; ++axis)
                node.low[axis] = above.low[axis] + (static_cast<int>(octant) >> axis & 1) * node.edge;
        }
        const auto chunk = chunk_in(folder / fmt::format("{}.{:03}.js", stem, part));
        const int bits = chunk["bits"];
        const auto size = chunk["count"].get<std::size_t>(), planes = std::size_t(bits > 16 ? 3 : 2);
        EXPECT_EQ(static_cast<double>(size), count);
        node.step = node.edge / std::exp2(bits);
        const std::string bytes = unpacked(chunk["positions"]);
        node.points.resize(size);
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::vector<std::uint32_t> codes = numbers_in(bytes, axis * planes * size, size, planes);
            for (std::size_t i = 0; i < size; ++i) {
                EXPECT_LT(codes[i], 1U << bits);
                const auto along = static_cast<Eigen::Index>(axis);
                node.points[i][along] = node.low[along] + (codes[i] + 0.5) * node.step;
            }
        }
        const auto low = numbers_in(unpacked(chunk["codes"][0]), 0, size, 2),
                   high = numbers_in(unpacked(chunk["codes"][1]), 0, size, 2);
        for (std::size_t i = 0; i < size; ++i)
            node.numbers.push_back((low[i] - 1) + 1000 * std::size_t(high[i] - 1));
        nodes.push_back(node);
    }
    return nodes;
}

std::vector<ReadNode> written_octree(const tests::Points& points, std::size_t most = 1 << 30) {
    const TemporaryFolder folder;
    (void)page::write_points(folder.path(), "a",
                             {.points = points,
                              .fields = {{"low", true}, {"high", true}},
                              .read =
                                  [](std::size_t i, std::span<double> values) {
                                      values[0] = static_cast<double>(i % 1000);
                                      values[1] = static_cast<double>(i / 1000);
                                  }},
                             most);
    return read_octree(folder.path(), "a");
}

TEST(PagePointsTest, every_point_is_in_one_node_and_where_it_was_to_half_a_step) {
    // A floor and a wall, and a dense spot, which makes the octree deep.
    tests::Points points = tests::corner(300000);
    tests::Dice dice;
    for (int i = 0; i < 300000; ++i)
        points.emplace_back(0.7 + 0.01 * dice.roll(), 0.3 + 0.01 * dice.roll(), 0.001 * dice.roll());
    const auto nodes = written_octree(points);
    ASSERT_GT(nodes.size(), 8u);
    std::vector<int> seen(points.size());
    for (const ReadNode& node : nodes) {
        EXPECT_NEAR(node.step, nodes[0].step, 1e-12) << "all nodes have the same steps";
        for (std::size_t i = 0; i < node.points.size(); ++i) {
            ++seen.at(node.numbers[i]);
            const Eigen::Vector3d off = node.points[i] - points[node.numbers[i]];
            ASSERT_LT(off.cwiseAbs().maxCoeff(), 0.5001 * node.step) << "level " << node.level;
        }
    }
    EXPECT_TRUE(std::ranges::all_of(seen, [](int times) { return times == 1; }));
    EXPECT_GT(nodes.back().level, 5);
    EXPECT_LT(nodes[0].step, 2.0 / 65536 / 20) << "the deeper the octree, the finer the steps";
}

TEST(PagePointsTest, a_node_and_those_above_it_are_an_even_sample_of_its_box) {
    const auto nodes = written_octree(tests::corner(900000, 1e-4));
    ASSERT_GT(nodes.size(), 4u);
    const ReadNode& root = nodes[0];
    // Twelve parts of equal area have equal shares: a random sample's would differ by 2 %, a grid's by a row of cells
    // in 43.
    std::array<int, 12> parts{};
    for (const Eigen::Vector3d& p : root.points)
        ++parts.at(static_cast<std::size_t>(6 * (p.x() > 0.01) + 3 * (p.y() > 1) +
                                            std::min(2.0, std::floor(1.5 * std::max(p.x(), p.z())))));
    for (const int part : parts)
        EXPECT_NEAR(part, static_cast<double>(root.points.size()) / 12,
                    0.06 * static_cast<double>(root.points.size()) / 12);
    for (const ReadNode& node : nodes) {
        EXPECT_LT(node.points.size(), 160000u);
        EXPECT_LE(node.spacing, root.spacing);
        for (const Eigen::Vector3d& p : node.points)
            ASSERT_TRUE(((p - node.low).array() >= 0).all() && ((p - node.low).array() <= node.edge).all());
    }
}

TEST(PagePointsTest, copies_of_one_point_end_in_one_node) {
    const auto nodes = written_octree(tests::Points(250000, {1, 2, 3}));
    std::size_t all = 0;
    for (const ReadNode& node : nodes)
        all += node.points.size();
    EXPECT_EQ(all, 250000u);
    EXPECT_EQ(nodes[0].points[0], Eigen::Vector3d(1, 2, 3));
}

TEST(PagePointsTest, a_sample_of_many_points_is_written_once_each) {
    const auto nodes = written_octree(tests::corner(400000), 150000);
    std::vector<std::size_t> all;
    for (const ReadNode& node : nodes)
        all.insert(all.end(), node.numbers.begin(), node.numbers.end());
    EXPECT_EQ(all.size(), 150000u);
    std::ranges::sort(all);
    EXPECT_EQ(std::ranges::adjacent_find(all), all.end());
}

/// The numbers of a point by their names.
std::map<std::string, double> numbers_of(const Cloud& cloud, std::size_t point) {
    const auto fields = number_fields(*cloud.records);
    std::vector<double> values(fields.size());
    read_numbers(*cloud.records, fields, point, values);
    std::map<std::string, double> named;
    for (std::size_t i = 0; i < fields.size(); ++i)
        named[fields[i].name] = values[i];
    return named;
}

TEST(NumberFieldsTest, bits_of_las_are_taken_apart_and_extra_fields_scaled) {
    const TemporaryFolder folder;
    std::vector<std::string> warnings;
    const Cloud cloud = read_cloud(tests::write_file(folder / "a.las", tests::tile({0, 0, 0})), warnings);
    const std::map<std::string, double> tree = {{"intensity", std::round(1000 * cloud.points[7].x())},
                                                {"return", 2},
                                                {"returns", 3},
                                                {"scanner_channel", 0},
                                                {"classification", 5},
                                                {"user_data", 0},
                                                {"scan_angle", 0},
                                                {"point_source_id", 0},
                                                {"gps_time", 300000 + 0.007}};
    EXPECT_EQ(numbers_of(cloud, 7), tree);
    // An extra field: 32 bits without a sign, whose value is a tenth of what is stored, plus 5.
    std::string description(192, '\0'), file = tests::las_file(6, 34, std::string(34, '\0'));
    description[2] = 5, description[3] = 8 | 16;
    std::string_view("height").copy(description.data() + 4, 32);
    tests::store(description.data() + 112, 0.1);
    tests::store(description.data() + 136, 5.0);
    tests::store(file.data() + 375 + 30, std::uint32_t(120));
    const std::string record = tests::vlr("LASF_Spec", 4, description);
    tests::store(file.data() + 96, static_cast<std::uint32_t>(375 + record.size()));
    tests::store(file.data() + 100, 1U);
    file.insert(375, record);
    const auto numbers = numbers_of(read_cloud(tests::write_file(folder / "b.las", file), warnings), 0);
    EXPECT_DOUBLE_EQ(numbers.at("height"), 17);
}

// ---------------------------------------------------------------------------------------------------- files of a run

class PageFilesTest : public testing::Test {
  protected:
    [[nodiscard]] Ran run(const std::string& flags = "") const {
        return run_program(fmt::format("run '{}' -o '{}' {}", capture().string(), out().string(), flags));
    }
    [[nodiscard]] fs::path capture() const { return folder / "capture"; }
    [[nodiscard]] fs::path out() const { return folder / "out"; }
    /// The texts of index.js: the head, and a line per frame.
    [[nodiscard]] static std::pair<nlohmann::json, nlohmann::json> data_of(const fs::path& results) {
        const std::string script = read_bytes(results / "index.js");
        const std::string head = "scanshade.set_head(", rows = ");\nscanshade.add_rows(";
        const auto at = script.find(rows);
        return {nlohmann::json::parse(script.substr(head.size(), at - head.size())),
                nlohmann::json::parse(script.substr(at + rows.size(), script.rfind(')') - at - rows.size()))};
    }

    TemporaryFolder folder;
};

TEST_F(PageFilesTest, a_run_leaves_a_page_with_every_frame_and_a_preview_of_each) {
    tests::write_capture(capture(), 3);
    tests::write_file(capture() / "depth/001.png", "no PNG");
    const Ran ran = run();
    ASSERT_EQ(ran.exit_code, 2) << ran.err;
    EXPECT_TRUE(says(ran.err, "page -> " + (out() / "index.html").string()));
    const auto [head, rows] = data_of(out());
    ASSERT_EQ(rows.size(), 3u);
    EXPECT_EQ(rows[0][2], "ok");
    EXPECT_EQ(rows[1][2], "failed");
    EXPECT_TRUE(says(rows[1][3], "001.png"));
    EXPECT_EQ(head["title"], "capture");
    EXPECT_TRUE(fs::exists(out() / "previews/000.js"));
    EXPECT_FALSE(fs::exists(out() / "previews/001.js")) << "a failed frame leaves no file";
    EXPECT_TRUE(says(read_bytes(out() / "index.html"), "<title>capture - scanshade</title>"));
}

/// Every script and style of the text, by its start tag: what is between the tags, for the tags without attributes.
std::vector<std::string> between(const std::string& html, const std::string& tag) {
    std::vector<std::string> parts;
    const std::string begin = "\n<" + tag + ">", end = "</" + tag + ">";
    for (std::size_t at = html.find(begin); at != std::string::npos; at = html.find(begin, at)) {
        at += begin.size();
        parts.push_back(html.substr(at, html.find(end, at) - at));
    }
    return parts;
}

TEST_F(PageFilesTest, a_page_runs_its_own_scripts_and_those_of_its_folder_only) {
    tests::write_capture(capture(), 1);
    ASSERT_EQ(run().exit_code, 0);
    const std::string html = read_bytes(out() / "index.html");
    const std::size_t at = html.find("<meta http-equiv=\"Content-Security-Policy\" content=\"");
    ASSERT_NE(at, std::string::npos);
    EXPECT_LT(at, html.find("<style")) << "a policy holds for what follows it";
    EXPECT_LT(at, html.find("<script"));
    const std::string policy = html.substr(at, html.find('>', at) - at);
    EXPECT_TRUE(says(policy, "default-src 'none'"));
    EXPECT_FALSE(says(policy, "unsafe"));
    const auto scripts = between(html, "script"), styles = between(html, "style");
    EXPECT_EQ(scripts.size(), 18u);
    EXPECT_EQ(styles.size(), 1u);
    std::size_t hashes = 0;
    for (std::size_t each = policy.find("'sha256-"); each != std::string::npos;
         each = policy.find("'sha256-", each + 1))
        ++hashes;
    EXPECT_EQ(hashes, scripts.size() + styles.size()); // browser_test sees that they are the right ones
}

TEST_F(PageFilesTest, a_clouds_page_has_as_many_points_as_asked_for_or_all) {
    write_new_ply(folder / "a.ply", tests::corner(3000), {}, {});
    const auto run_with = [&](const std::string& points) {
        return run_program(
            fmt::format("run '{0}/a.ply' -o '{0}/out' --overwrite --clouds points --cloud.rays 1 --page-points {1}",
                        folder.path().string(), points));
    };
    for (const auto& [asked, written] : {std::pair("1000", 1000), std::pair("all", 3000), std::pair("1000000", 3000)}) {
        ASSERT_NE(run_with(asked).exit_code, 1);
        const nlohmann::json facts = chunk_in(out() / "points/a.000.js")["facts"];
        EXPECT_EQ(facts["total"], written) << asked;
        EXPECT_EQ(facts["of"], 3000);
    }
    for (const char* wrong : {"999", "some", "1e6", "-5", "2000x"}) {
        const Ran ran = run_with(wrong);
        EXPECT_EQ(ran.exit_code, 1);
        EXPECT_TRUE(
            says(ran.err, fmt::format("page-points: '{}' given, expected all or a number from 1000 on", wrong)));
    }
}

TEST_F(PageFilesTest, without_a_page_nothing_of_it_is_written) {
    tests::write_capture(capture(), 2);
    ASSERT_EQ(run("--page no").exit_code, 0);
    for (const char* part : {"index.html", "index.js", "previews"})
        EXPECT_FALSE(fs::exists(out() / part)) << part;
}

TEST_F(PageFilesTest, a_page_is_made_anew_with_the_frames_of_the_run_before) {
    tests::write_capture(capture(), 4);
    ASSERT_EQ(run("--depth-noise none --frames :2").exit_code, 0);
    ASSERT_EQ(data_of(out()).second.size(), 2u);
    ASSERT_EQ(run("--depth-noise none --resume").exit_code, 0);
    ASSERT_EQ(data_of(out()).second.size(), 4u);
    fs::remove(out() / "index.html");
    ASSERT_EQ(run("--depth-noise none --resume").exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "index.html")) << "a page that was removed comes back, though all frames are done";
    fs::remove(out() / "previews/002.js");
    ASSERT_EQ(run("--depth-noise none --resume").exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "previews/002.js")) << "so does a preview";
}

TEST_F(PageFilesTest, view_makes_the_page_that_a_run_makes) {
    tests::write_capture(capture(), 2);
    ASSERT_EQ(run().exit_code, 0);
    const auto [head, rows] = data_of(out());
    fs::remove(out() / "index.html");
    const Ran view = run_program(fmt::format("view '{}'", out().string()));
    ASSERT_EQ(view.exit_code, 0) << view.err;
    EXPECT_EQ(view.out, fs::canonical(out() / "index.html").string() + "\n");
    const auto [new_head, new_rows] = data_of(out());
    EXPECT_EQ(new_head, head);
    EXPECT_EQ(new_rows, rows);
}

TEST_F(PageFilesTest, a_manifest_cannot_lead_a_page_out_of_its_folder) {
    tests::write_file(out() / "manifest.json",
                      R"({"frames": [{"index": 0, "name": "a", "status": "ok", "files": ["ao/a.png", "../a.png"]},
                                     {"index": 1, "name": "../b", "status": "ok", "files": ["ao/../b.png"]}]})");
    ASSERT_EQ(run_program(fmt::format("view '{}'", out().string())).exit_code, 0);
    const auto [head, rows] = data_of(out());
    EXPECT_EQ(rows.size(), 2u);
    EXPECT_EQ(head["file_sets"], nlohmann::json::parse(R"([[["ao", ".png"]], []])"));
}

TEST_F(PageFilesTest, a_manifest_nested_without_end_is_refused_and_not_followed) {
    const std::string deep = std::string(200000, '[') + std::string(200000, ']');
    tests::write_file(out() / "manifest.json", R"({"frames": [], "capture": {"camera": )" + deep + "}}");
    const Ran ran = run_program(fmt::format("view '{}'", out().string()));
    EXPECT_EQ(ran.exit_code, 3);
    EXPECT_NE(ran.err.find("nested deeper than 64 levels"), std::string::npos) << ran.err;
}

TEST_F(PageFilesTest, the_cloud_of_a_recording_is_on_its_page_until_the_next_run) {
    const std::string made =
        fmt::format("generate office --frames 2 --size 160x120 --truth=false -o '{}'", capture().string());
    ASSERT_EQ(run_program(made).exit_code, 0);
    ASSERT_EQ(run(fmt::format("--cloud '{}/all.ply'", folder.path().string())).exit_code, 0);
    EXPECT_TRUE(fs::exists(out() / "recording.000.js"));
    EXPECT_EQ(data_of(out()).first["recording_points"], "recording");
    fs::remove(out() / "index.html");
    ASSERT_EQ(run_program(fmt::format("view '{}'", out().string())).exit_code, 0);
    EXPECT_EQ(data_of(out()).first["recording_points"], "recording");
    ASSERT_EQ(run("--overwrite").exit_code, 0);
    EXPECT_FALSE(fs::exists(out() / "recording.000.js"));
    EXPECT_FALSE(data_of(out()).first.contains("recording_points"));
}

TEST_F(PageFilesTest, view_refuses_what_is_no_result) {
    const auto refused = [&](const fs::path& path) {
        const Ran ran = run_program(fmt::format("view '{}'", path.string()));
        EXPECT_EQ(ran.exit_code, 3);
        return ran.err;
    };
    EXPECT_TRUE(says(refused(folder / "none"), "not there"));
    EXPECT_TRUE(says(refused(folder.path()), "neither index.html nor manifest.json"));
    EXPECT_TRUE(says(refused(tests::write_file(folder / "a.txt", "a")), "a page (.html) expected"));
    tests::write_file(folder / "torn/manifest.json", "{\"frames\": [{\"index\": 0, \"na");
    EXPECT_TRUE(says(refused(folder / "torn"), "manifest.json"));
    tests::write_file(folder / "odd/manifest.json", "{\"frames\": [{\"index\": -1}]}");
    EXPECT_TRUE(says(refused(folder / "odd"), "manifest.json"));
    tests::write_file(folder / "list/manifest.json", "[1, 2]");
    EXPECT_TRUE(says(refused(folder / "list"), "a JSON object expected"));
}

TEST_F(PageFilesTest, several_captures_have_a_list_with_links_to_their_pages) {
    tests::write_capture(folder / "a", 2);
    tests::write_capture(folder / "b", 1);
    const Ran ran = run_program(fmt::format("run '{0}/a' '{0}/b' -o '{0}/out'", folder.path().string()));
    ASSERT_EQ(ran.exit_code, 0) << ran.err;
    const auto [head, rows] = data_of(out());
    EXPECT_EQ(head["kind"], "list");
    ASSERT_EQ(rows.size(), 2u);
    EXPECT_EQ(rows[0][0], "a");
    EXPECT_EQ(rows[0][1], 2);
    EXPECT_EQ(rows[1][9], "b/index.html");
    EXPECT_TRUE(fs::exists(out() / rows[1][10].get<std::string>())) << rows[1][10];
    EXPECT_TRUE(fs::exists(out() / "b/index.html"));
}

TEST_F(PageFilesTest, the_list_of_captures_names_those_that_could_not_be_opened) {
    tests::write_capture(folder / "a", 1);
    fs::create_directories(folder / "empty");
    ASSERT_EQ(run_program(fmt::format("run '{0}/a' '{0}/empty' -o '{0}/out'", folder.path().string())).exit_code, 2);
    const auto [head, rows] = data_of(out());
    EXPECT_EQ(rows.size(), 1u);
    ASSERT_EQ(head["notes"].size(), 1u);
    EXPECT_TRUE(says(head["notes"][0], "not opened: no frames found in " + (folder / "empty").string()));
}

TEST_F(PageFilesTest, a_list_counts_frames_that_an_interruption_left) {
    CapturesPage page(folder.path());
    const std::size_t first = page.add("a", folder / "a", 3);
    EXPECT_EQ(page.add("a", folder / "a", 2), first) << "a second block of the same capture";
    page.add("b", folder / "b", 4);
    FrameRow done, ended;
    done.status = FrameStatus::ok;
    done.coverage = done.mean_visibility = 0.5;
    ended.status = FrameStatus::failed;
    ended.fault = Fault::outage;
    page.take(first, {done, ended});
    page.write("two", {});
    const auto [head, rows] = data_of(folder.path());
    EXPECT_EQ(rows[0], nlohmann::json({"a", 5, 1, 0, 0, 4, 0.5, 0.5, 0.0, "", ""}));
    EXPECT_EQ(rows[1], nlohmann::json({"b", 4, 0, 0, 0, 4, nullptr, nullptr, nullptr, "", ""}));
}

TEST_F(PageFilesTest, merge_makes_one_page_of_a_capture_computed_in_blocks) {
    tests::write_capture(folder / "data/a", 5);
    const std::string job = (folder / "job").string();
    ASSERT_EQ(run_program(fmt::format("plan '{}' -o '{}' --block 2", (folder / "data").string(), job)).exit_code, 0);
    ASSERT_EQ(run_program(fmt::format("run '{}'", job)).exit_code, 0);
    EXPECT_FALSE(fs::exists(folder / "job/index.html"));
    ASSERT_EQ(run_program(fmt::format("merge '{}' --page no", job)).exit_code, 0);
    EXPECT_FALSE(fs::exists(folder / "job/index.html"));
    const Ran merged = run_program(fmt::format("merge '{}'", job));
    ASSERT_EQ(merged.exit_code, 0) << merged.err;
    const auto [head, rows] = data_of(folder / "job");
    ASSERT_EQ(rows.size(), 1u);
    EXPECT_EQ(rows[0][1], 5);
    EXPECT_EQ(rows[0][2], 5);
    const auto [of_a, frames] = data_of((folder / "job" / rows[0][9].get<std::string>()).parent_path());
    ASSERT_EQ(frames.size(), 5u);
    for (std::size_t i = 0; i < 5; ++i)
        EXPECT_EQ(frames[i][0], i);
}

TEST_F(PageFilesTest, poses_of_a_manifest_are_those_of_the_capture) {
    ASSERT_EQ(
        run_program(fmt::format("generate office --frames 1 --size 160x120 --truth=false -o '{}'", capture().string()))
            .exit_code,
        0);
    ASSERT_EQ(run("--write ao").exit_code, 0);
    const Capture listed = open_capture(capture());
    ASSERT_TRUE(listed.entries.at(0).world_from_camera.has_value());
    const auto manifest = nlohmann::json::parse(read_bytes(out() / "manifest.json"));
    const auto& pose = manifest["frames"][0]["world_from_camera"];
    ASSERT_EQ(pose.size(), 12u);
    for (int i = 0; i < 12; ++i)
        EXPECT_NEAR(pose[static_cast<std::size_t>(i)], listed.entries[0].world_from_camera->matrix()(i / 4, i % 4),
                    1e-6);
    EXPECT_EQ(data_of(out()).second[0][14], pose);
}

} // namespace
} // namespace scanshade
